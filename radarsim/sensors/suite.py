"""Which sensors a recording has."""

import zlib
from collections.abc import Sequence

import numpy as np

from radarize.errors import InputError
from radarsim.sensors.causes import AdcByCause, CauseCounts
from radarsim.sensors.depth import DepthCamera, DepthStrip
from radarsim.sensors.ghosts import Ghosts
from radarsim.sensors.imu import Imu
from radarsim.sensors.lidar import Lidar
from radarsim.sensors.points import ChipPoints
from radarsim.sensors.pose import TruePose
from radarsim.sensors.scan import Occupancy, PlanarScan
from radarsim.sensors.sensor import Frames, Rig, Sensor
from radarsim.sensors.tracking import TrackingCamera
from radarsim.threads import one_blas_thread

#: Sensors that cost next to nothing and are always there.
ALWAYS = {"pose": TruePose, "scan": PlanarScan, "causes": CauseCounts}
#: Sensors to choose from.
SENSORS = {
    "depth": DepthCamera,
    "depth-strip": DepthStrip,
    "occupancy": Occupancy,
    "tracking": TrackingCamera,
    "imu": Imu,
    "points": ChipPoints,
    "ghosts": Ghosts,
    "lidar": Lidar,
}
#: What ``all`` stands for: either depth camera writes the same stream.
_ALL = tuple(name for name in SENSORS if name != "depth-strip")


def chosen(names: Sequence[str]) -> list[str]:
    """Names of sensors without repetition, in the order of `SENSORS`; ``all`` stands for all of them.

    Raises:
        InputError: there is no such sensor, or two exclude each other.
    """
    for name in names:
        if name not in SENSORS and name != "all":
            raise InputError(f"sensors: {name!r} is unknown, expected all or some of {', '.join(SENSORS)}")
    wanted = {*names, *(_ALL if "all" in names else ())}
    if {"depth", "depth-strip"} <= wanted:
        raise InputError("sensors: depth and depth-strip are both asked for, expected one depth camera")
    return [name for name in SENSORS if name in wanted]


class Suite:
    """The sensors of a recording; each has a generator of its own, so that none changes what another measures.

    Args:
        rig: where they are mounted.
        names: of optional sensors, from `SENSORS`.
        seed: of the recording.
        by_cause: with I/Q by cause.

    Attributes:
        clocks: paths of streams that hold stamps, s.
    """

    def __init__(self, rig: Rig, names: Sequence[str], seed: int, by_cause: bool = False):
        kinds = ALWAYS | {name: SENSORS[name] for name in chosen(names)}
        if by_cause:
            kinds["adc_by_cause"] = AdcByCause
        self.sensors: dict[str, Sensor] = {
            name: kind(rig, np.random.default_rng([seed, zlib.crc32(name.encode())])) for name, kind in kinds.items()
        }
        self.streams = {path: s for sensor in self.sensors.values() for path, s in sensor.streams.items()}
        self.products = {path: p for sensor in self.sensors.values() for path, p in sensor.products.items()}
        # Streams of stamps: those in s that others name as their clock, and the truth's.
        named = {"truth/time", *(s.clock for s in self.streams.values())}
        self.clocks = {path for path in named & set(self.streams) if self.streams[path].unit == "s"}

    @one_blas_thread
    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Rows of all streams for a batch of frames."""
        return {path: rows for sensor in self.sensors.values() for path, rows in sensor.observe(frames).items()}
