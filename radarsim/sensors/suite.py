"""Which sensors a recording has."""

import zlib
from collections.abc import Sequence

import numpy as np

from radarize.errors import InputError
from radarsim.sensors.causes import AdcByCause, CauseCounts
from radarsim.sensors.pose import TruePose
from radarsim.sensors.scan import Occupancy, PlanarScan
from radarsim.sensors.sensor import Frames, Rig, Sensor

#: Sensors that cost next to nothing and are always there.
ALWAYS = {"pose": TruePose, "scan": PlanarScan, "causes": CauseCounts}
#: Sensors to choose from.
SENSORS = {"occupancy": Occupancy}


def chosen(names: Sequence[str]) -> list[str]:
    """Names of sensors without repetition, in the order of `SENSORS`; ``all`` stands for all of them.

    Raises:
        InputError: there is no such sensor.
    """
    for name in names:
        if name not in SENSORS and name != "all":
            raise InputError(f"sensors: {name!r} is unknown, expected all or some of {', '.join(SENSORS)}")
    return [name for name in SENSORS if name in names or "all" in names]


class Suite:
    """The sensors of a recording; each has a generator of its own, so that none changes what another measures.

    Args:
        rig: where they are mounted.
        names: of optional sensors, from `SENSORS`.
        seed: of the recording.
        by_cause: with I/Q by cause.
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

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Rows of all streams for a batch of frames."""
        return {path: rows for sensor in self.sensors.values() for path, rows in sensor.observe(frames).items()}
