"""Number and power of the echoes of each path type, and the I/Q split by path type."""

import numpy as np

from radarize.io.recording import Stream
from radarsim.propagation.path_types import PathType
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor

#: Names of the path types in the order of their numbers.
TYPES = tuple(p.name.lower() for p in PathType)
#: Parts of /truth/adc_by_cause, in this order; in scenes with other radars, interference precedes leakage.
PARTS = (*TYPES, "leakage")


class PathTypeCounts(Sensor):
    """Number and total power of the echoes of each path type."""

    streams = {
        "truth/echoes": Stream((len(TYPES),), "i4", "", f"echoes per path type: {', '.join(TYPES)}"),
        "truth/echo_power": Stream((len(TYPES),), "f4", "1", f"received over transmitted power: {', '.join(TYPES)}"),
    }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Number and power of echoes by path type, per frame."""
        count = [np.bincount(types, minlength=len(PathType)) for types in frames.types]
        each = zip(frames.types, frames.paths, strict=True)
        power = [np.bincount(types, np.abs(p.amplitude) ** 2, minlength=len(PathType)) for types, p in each]
        return {"truth/echoes": np.array(count), "truth/echo_power": np.array(power)}


class AdcByPathType(Sensor):
    """Noise-free I/Q of each path type before the converter; parts may exceed its range and that of a float16."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        names = PARTS if not scenario.scene.interferers else (*PARTS[:-1], "interference", PARTS[-1])
        about = "I/Q before noise and converter, by path type; the parts add up: " + ", ".join(names)
        shape = (len(names), *scenario.config.frame_shape)
        self.streams = {"truth/adc_by_cause": Stream(shape, "f4", "ADC counts", about)}

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """I/Q of each part, per frame."""
        others = [frames.interference] if self.scenario.scene.interferers else []
        found = []
        for lengths, amplitudes, types, *signals in zip(
            frames.lengths, frames.received, frames.types, *others, strict=True
        ):
            echoes = [self.scenario.synthesize(lengths[types == each], amplitudes[types == each]) for each in PathType]
            found.append(np.stack(self.scenario.board.by_path_type([*echoes, *signals])))
        parts = np.stack(found)
        return {"truth/adc_by_cause": np.stack([parts.real, parts.imag], axis=-1).astype(np.float32)}
