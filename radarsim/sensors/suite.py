"""Choice of a recording's sensors, and their joint rows."""

from collections.abc import Iterable, Sequence

import numpy as np

from radarize.io.errors import InputError
from radarsim.machine.threads import one_blas_thread
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.by_path_type import AdcByPathType, PathTypeCounts
from radarsim.sensors.depth import DepthCamera, DepthStrip
from radarsim.sensors.ghosts import Ghosts
from radarsim.sensors.imu import Imu
from radarsim.sensors.lidar import Lidar
from radarsim.sensors.paths import TruePaths
from radarsim.sensors.points import ChipPoints
from radarsim.sensors.pose import TruePose
from radarsim.sensors.scan import Occupancy, PlanarScan
from radarsim.sensors.sensor import Sensor
from radarsim.sensors.tracking import TrackingCamera
from radarsim.world import plugins

#: Sensors that are always recorded; their cost is negligible.
ALWAYS: dict[str, type[Sensor]] = {"pose": TruePose, "scan": PlanarScan, "causes": PathTypeCounts}
#: Optional sensors; plug-ins add theirs.
SENSORS: dict[str, type[Sensor]] = {
    "depth": DepthCamera,
    "depth-strip": DepthStrip,
    "occupancy": Occupancy,
    "tracking": TrackingCamera,
    "imu": Imu,
    "points": ChipPoints,
    "ghosts": Ghosts,
    "lidar": Lidar,
    "adc-by-cause": AdcByPathType,
    "paths": TruePaths,
}
#: Not part of ``all``: the two depth cameras write the same stream, the others are at least as large as the recording.
_APART = {"depth-strip", "adc-by-cause", "paths"}


def chosen(names: Sequence[str]) -> list[str]:
    """Return names of sensors without repetition, in the order of `SENSORS`; ``all`` stands for all but `_APART`.

    Raises:
        InputError: unknown sensor, or two that exclude each other.
    """
    plugins.load()
    for name in names:
        if name not in SENSORS and name != "all":
            raise InputError(f"sensors: {name!r} is unknown, expected all or some of {', '.join(SENSORS)}")
    wanted = {*names, *(SENSORS.keys() - _APART if "all" in names else ())}
    if {"depth", "depth-strip"} <= wanted:
        raise InputError("sensors: depth and depth-strip are both chosen, expected one depth camera")
    return [name for name in SENSORS if name in wanted]


class Suite:
    """The sensors of a scenario.

    Args:
        scenario: scenario of the recording.
        names: names of the sensors; default: those that are always recorded, and the scenario's.

    Attributes:
        streams, products: those of all sensors, by path.
    """

    def __init__(self, scenario: Scenario, names: Iterable[str] | None = None):
        names = (*ALWAYS, *chosen(scenario.sensors)) if names is None else names
        self.sensors: dict[str, Sensor] = {name: (ALWAYS | SENSORS)[name](scenario) for name in names}
        self.streams = {path: s for sensor in self.sensors.values() for path, s in sensor.streams.items()}
        self.products = {path: p for sensor in self.sensors.values() for path, p in sensor.products.items()}
        # Clocks of the streams, and the truth's.
        self._clocks = {"truth/time", *(s.clock for s in self.streams.values())} & set(self.streams)

    @one_blas_thread
    def observe(self, frames: Frames, first: int = 0, start: float = 0.0) -> dict[str, np.ndarray]:
        """Rows of all streams for some frames.

        Args:
            frames: frames to observe.
            first: index of the first of them in the recording.
            start: time stamp of the motion's zero, s.
        """
        rows = {path: rows for sensor in self.sensors.values() for path, rows in sensor.observe(frames).items()}
        for clock in self._clocks:
            rows[clock] = rows[clock] + (start if self.streams[clock].unit == "s" else first)
        return rows
