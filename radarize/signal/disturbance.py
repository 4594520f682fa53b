"""What is not like the rest of its frame: chirps that interference fell into, and receivers that are broken.

What another radar sends falls into single chirps and, its ramp being another, into most of their range bins. A world of
surfaces does not do that: echoes beat against each other from chirp to chirp, each range bin on its own, and a wall's
flash or the transmitter's leakage is in all chirps. So the level of a chirp is its power over the median of the frame's
chirps of its transmitter, taken in each range bin and averaged over them.
"""

from typing import NamedTuple

import numpy as np
import scipy.fft
from jaxtyping import Bool, Float32, Int16

#: A chirp is off whose level is more than so many times the others', or so small a part of it. Undisturbed ones of 20 s
#: walks in buildings A to D, by hand, on a cart and on a robot, lie between 0.8 and 1.7.
_OFF = 3.0
#: Of fewer chirps a median says little.
_FEWEST = 8
#: Counts^2 of rounding I and Q to whole numbers.
_ROUNDING = 2 / 12
#: A receiver is dead whose power is less than this share of the median receiver's: on the walks above it is 0.8 at
#: least. It is saturated where more than so large a share of its chirps reaches the converter's end.
_DEAD, _SATURATED = 1 / 30, 1 / 4


class Flaws(NamedTuple):
    """What is wrong with frames.

    Attributes:
        disturbed: False where a chirp is like the others, or lost.
        dead, saturated: receivers by their place in the configuration.
    """

    disturbed: Bool[np.ndarray, "frame loop tx"]
    dead: Bool[np.ndarray, "frame rx"]
    saturated: Bool[np.ndarray, "frame rx"]

    @property
    def broken(self) -> Bool[np.ndarray, "frame rx"]:
        """Receivers that are dead or saturated."""
        return self.dead | self.saturated

    def of(self, frames: Bool[np.ndarray, "frame"]) -> "Flaws":
        """Of some of the frames."""
        return Flaws(*(each[frames] for each in self))


def find_flaws(
    samples: Int16[np.ndarray, "frame loop tx rx sample 2"], valid: Bool[np.ndarray, "frame loop tx"]
) -> Flaws:
    """Compare the chirps and receivers of each frame; lost chirps, `valid` being False, have no say."""
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
    """Chirps whose level is not the others'."""
    told = valid.sum(axis=1, keepdims=True)
    ordered = np.sort(np.where(valid[..., None], power, np.inf), axis=1)
    usual = np.take_along_axis(ordered, (told // 2)[..., None].clip(max=power.shape[1] - 1), axis=1)
    level = (power / usual).mean(axis=-1)
    return valid & (told >= _FEWEST) & ((level > _OFF) | (level < 1 / _OFF))
