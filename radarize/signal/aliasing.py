"""Resolution of Doppler ambiguity: the span of speeds in a frame, from phase steps between transmitters.

Transmitters fire one after the other, so an echo's phase changes by 4 pi v T / wavelength between the slots, T apart.
If its speed v is taken one unambiguous span too low, a residual of 2 pi slot / slots remains, as a step between the
parts of the azimuth row of two transmitters (after Roos, Bechter, Appenrodt, Dickmann and Waldschmidt, "Enhancement of
Doppler unambiguity for chirp-sequence modulated TDM-MIMO radars", ICMIM 2018). One echo is seldom conclusive; hundreds
in a frame are: all their closing speeds lie within one span, so that one window over speeds is correct for all Doppler
bins. Every frame is decided independently, so that errors do not persist.
"""

import numpy as np
import torch
from jaxtyping import Complex64, Int
from numba import njit

from radarize.radar.array import azimuth_row
from radarize.radar.config import RadarConfig

#: Smallest power of the cells used, relative to the median cell's, and smallest range, beyond the leakage, m.
_THRESHOLD, _LEAKAGE = 20.0, 0.25
#: Smallest excess of another window's likelihood over that of the window about zero, in standard deviations for cells
#: of random phase, and smallest fraction of the cells that must agree with it.
_SIGMAS, _AGREE = 4.0, 0.5
#: Largest number of windows tried; and m/s, the largest speed of a person who walks, up to which they extend.
_MOST, _FASTEST = 129, 3.0


class Aliases:
    """Estimate the unambiguous span of each Doppler bin of a radar.

    Args:
        config: radar configuration; with a single transmitter in the azimuth row nothing can be resolved.

    Attributes:
        fastest: m/s, largest speed at which ambiguity is resolved.
    """

    def __init__(self, config: RadarConfig):
        self._first = int(np.searchsorted(config.ranges, _LEAKAGE))
        row, receivers = azimuth_row(config), len(config.rx)
        owner, slots = row // receivers, np.asarray(config.slot)
        same = owner[1:] == owner[:-1]
        self._steps = np.stack([row[:-1], row[1:]])[:, same]
        self._joints = np.stack([row[:-1], row[1:]])[:, ~same]
        later = (slots[owner[1:]] - slots[owner[:-1]])[~same]
        self._tells = bool(self._joints.size and self._steps.size)
        self.fastest = max(_FASTEST if self._tells else 0.0, config.max_velocity)
        # Windows of one span, the nearest to zero first, and the spans that they assign to bins.
        bins = np.arange(config.loops) - config.loops // 2
        most = max(0, int((_FASTEST - config.max_velocity) / config.velocity_resolution))
        centres = np.unique(np.rint(np.linspace(-most, most, min(2 * most + 1, _MOST))))
        centres = centres[np.argsort(np.abs(centres), kind="stable")]
        self._windows = np.rint((centres[:, None] - bins) / config.loops).astype(int)
        turns = 2 * np.pi * later[:, None, None] * self._windows / config.chirps_per_loop
        self._turns = np.exp(1j * turns).transpose(1, 0, 2).reshape(len(centres), -1)

    def of(self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]) -> Int[np.ndarray, "frame doppler"]:
        """Number of unambiguous spans to add to the speed of each bin, see `Heatmaps.velocities`."""
        if not self._tells:
            return np.zeros((len(spectrum), spectrum.shape[2]), int)
        steps, count = _phase_steps(spectrum.numpy(), self._first, self._steps, self._joints)
        likely = (steps.reshape(len(spectrum), -1) @ self._turns.T).real
        best = likely.max(axis=1)
        sure = best - likely[:, 0] > _SIGMAS * np.sqrt(1.5 * count)
        return self._windows[np.where(sure & (best > _AGREE * count), likely.argmax(axis=1), 0)]


@njit(cache=True)
def _phase_steps(spectrum, first, steps, joints):
    """Sum of unit phasors of the phase steps at the joints, relative to the steps within transmitters, per (frame,
    doppler, joint); and their number in each frame."""
    frames, ranges, bins, _ = spectrum.shape
    found, count = np.zeros((frames, bins, joints.shape[1]), np.complex128), np.zeros(frames)
    power = np.empty((ranges, bins), np.float32)
    for k in range(frames):
        for r in range(first, ranges):
            for d in range(bins):
                power[r, d] = 0.0
                for value in spectrum[k, r, d]:
                    power[r, d] += value.real**2 + value.imag**2
        level = _THRESHOLD * np.median(power[first::4])
        for r in range(first, ranges):
            for d in range(bins):
                if power[r, d] <= level:
                    continue
                cell, step = spectrum[k, r, d], 0.0j
                for i in range(steps.shape[1]):
                    step += cell[steps[1, i]] * np.conj(cell[steps[0, i]])
                for i in range(joints.shape[1]):
                    turn = cell[joints[1, i]] * np.conj(cell[joints[0, i]]) * np.conj(step)
                    found[k, d, i] += turn / max(abs(turn), 1e-30)
                    count[k] += 1
    return found, count
