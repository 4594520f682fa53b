"""How many echoes there are and how strong, by cause, and the I/Q split by cause."""

import numpy as np

from radarize.recording import Stream
from radarsim.physics.echoes import Provenance
from radarsim.sensors.sensor import Frames, Rig, Sensor

_NAMES = ", ".join(p.name.lower() for p in Provenance)
#: Parts of /truth/adc_by_cause, in this order.
CAUSES = (*(p.name.lower() for p in Provenance), "leakage")


class CauseCounts(Sensor):
    """Number and total power of the echoes of each cause."""

    of_radar = True

    streams = {
        "truth/echoes": Stream((len(Provenance),), "i4", "", f"echoes per cause: {_NAMES}"),
        "truth/echo_power": Stream((len(Provenance),), "f4", "1", f"received over transmitted power: {_NAMES}"),
    }

    def __init__(self, rig: Rig, rng: np.random.Generator):
        pass

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Counts and powers."""
        count = [np.bincount(e.provenance, minlength=len(Provenance)) for e in frames.echoes]
        power = [np.bincount(e.provenance, np.abs(e.amplitude) ** 2, minlength=len(Provenance)) for e in frames.echoes]
        return {"truth/echoes": np.array(count), "truth/echo_power": np.array(power)}


class AdcByCause(Sensor):
    """I/Q of each cause before noise and converter."""

    of_radar = True

    def __init__(self, rig: Rig, rng: np.random.Generator):
        about = "I/Q before noise and converter, by cause, which add up: " + ", ".join(CAUSES)
        shape = (len(CAUSES), *rig.config.frame_shape)
        self.streams = {"truth/adc_by_cause": Stream(shape, "f2", "ADC counts", about)}

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """The parts."""
        parts = frames.by_cause
        return {"truth/adc_by_cause": np.stack([parts.real, parts.imag], axis=-1).astype(np.float16)}
