"""Detection of chirps disturbed by interference, and of broken receivers.

Interference hits single chirps and, because of its different ramp, most of their range bins. Echoes of surfaces do
not: they beat against each other from chirp to chirp, independently in each range bin, and a wall's specular
reflection or the transmitter's leakage is in all chirps. So the level of a chirp is its power over the median of the
frame's chirps of its transmitter, taken in each range bin and averaged over them.
"""

from typing import NamedTuple

import numpy as np
import scipy.fft
from jaxtyping import Bool, Float32, Int16

#: Largest ratio, up or down, of a chirp's level to the others'. Undisturbed chirps of 20 s walks in buildings A to D,
#: handheld, on a cart and on a robot platform, lie between 0.8 and 1.7.
_OFF = 3.0
#: Smallest number of chirps for a meaningful median.
_FEWEST = 8
#: Counts^2 by rounding of I and Q to whole numbers.
_ROUNDING = 2 / 12
#: Power relative to the median receiver's below which a receiver is dead: on the walks above it is 0.8 at
#: least. Fraction of its chirps that reach the converter's limit above which a receiver is saturated.
_DEAD, _SATURATED = 1 / 30, 1 / 4


class Flaws(NamedTuple):
    """Defects of frames.

    Attributes:
        disturbed: disturbed chirps.
        dead, saturated: receivers by their index in the configuration.
    """

    disturbed: Bool[np.ndarray, "frame loop tx"]
    dead: Bool[np.ndarray, "frame rx"]
    saturated: Bool[np.ndarray, "frame rx"]

    @property
    def broken(self) -> Bool[np.ndarray, "frame rx"]:
        """Mask of receivers that are dead or saturated."""
        return self.dead | self.saturated

    def of(self, frames: Bool[np.ndarray, "frame"]) -> "Flaws":
        """Select some of the frames."""
        return Flaws(*(each[frames] for each in self))


def find_flaws(
    samples: Int16[np.ndarray, "frame loop tx rx sample 2"], valid: Bool[np.ndarray, "frame loop tx"]
) -> Flaws:
    """Compare the chirps and receivers of each frame; lost chirps, for which `valid` is False, are ignored."""
    count = samples.shape[4]
    window = np.hanning(count).astype(np.float32)
    signal = samples.astype(np.float32).view(np.complex64)[..., 0]
    profile = scipy.fft.fft(signal * window, axis=-1)
    power = profile.real**2 + profile.imag**2
    broad = (power.sum(axis=-1) * valid[..., None]).sum(axis=(1, 2))
    end = np.iinfo(np.int16)
    spans = samples.reshape(*samples.shape[:4], 2 * count)
    clipped = (spans.max(axis=-1) == end.max) | (spans.min(axis=-1) == end.min)
    return Flaws(
        _disturbed(power.sum(axis=3) + samples.shape[3] * _ROUNDING * float(window @ window), valid),
        broad < _DEAD * np.median(broad, axis=1, keepdims=True),
        clipped.mean(axis=(1, 2)) > _SATURATED,
    )


def _disturbed(
    power: Float32[np.ndarray, "frame loop tx range"], valid: Bool[np.ndarray, "frame loop tx"]
) -> Bool[np.ndarray, "frame loop tx"]:
    """Mask of chirps whose level differs from the others'."""
    count = valid.sum(axis=1, keepdims=True)
    ordered = np.sort(np.where(valid[..., None], power, np.inf), axis=1)
    usual = np.take_along_axis(ordered, (count // 2)[..., None].clip(max=power.shape[1] - 1), axis=1)
    level = (power / usual).mean(axis=-1)
    return valid & (count >= _FEWEST) & ((level > _OFF) | (level < 1 / _OFF))
