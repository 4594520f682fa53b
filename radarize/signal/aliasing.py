"""Which speeds are meant: echoes that close faster than the unambiguous speed, told by the transmitters' turns.

Transmitters fire one after the other, so an echo turns by 4 pi v T / wavelength between the slots, T apart. Where its
speed v is taken one unambiguous span too low, 2 pi slot / slots of that are left, as a step between the parts of the
azimuth row that two transmitters make (after Roos, Bechter, Appenrodt, Dickmann and Waldschmidt, "Enhancement of
Doppler unambiguity for chirp-sequence modulated TDM-MIMO radars", ICMIM 2018). One echo seldom tells; hundreds in a
frame do: all that is seen closes at speeds within one span, so that one window over speeds is right for all Doppler
bins. Which one is asked anew in every frame, so that no mistake lasts.
"""

import numpy as np
import torch
from jaxtyping import Complex64, Int
from numba import njit

from radarize.radar.array import azimuth_row
from radarize.radar.config import RadarConfig

#: A cell counts whose power is so many times the median cell's, beyond the transmitter's leakage, m.
_THRESHOLD, _LEAKAGE = 20.0, 0.25
#: Another window must be likelier than that about zero by so many standard deviations, if all cells had any phase, and
#: so large a share of the cells must agree with it.
_SIGMAS, _AGREE = 4.0, 0.5
#: Windows that are tried, at most; and m/s, which nobody who walks exceeds: as far as they reach.
_MOST, _FASTEST = 129, 3.0


class Aliases:
    """Of one radar's Doppler bins.

    Args:
        config: of the radar; with a single transmitter in the azimuth row nothing tells.

    Attributes:
        fastest: m/s, largest speed at which aliased speeds are resolved.
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
        # Windows of one span, the nearest to zero first, and what they make of bins.
        bins = np.arange(config.loops) - config.loops // 2
        most = max(0, int((_FASTEST - config.max_velocity) / config.velocity_resolution))
        centres = np.unique(np.rint(np.linspace(-most, most, min(2 * most + 1, _MOST))))
        centres = centres[np.argsort(np.abs(centres), kind="stable")]
        self._windows = np.rint((centres[:, None] - bins) / config.loops).astype(int)
        turns = 2 * np.pi * later[:, None, None] * self._windows / config.chirps_per_loop
        self._turns = np.exp(1j * turns).transpose(1, 0, 2).reshape(len(centres), -1)

    def of(self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]) -> Int[np.ndarray, "frame doppler"]:
        """By how many unambiguous spans the speed of each bin is too low, as `Heatmaps.velocities` has it."""
        if not self._tells:
            return np.zeros((len(spectrum), spectrum.shape[2]), int)
        told, count = _told(spectrum.numpy(), self._first, self._steps, self._joints)
        likely = (told.reshape(len(spectrum), -1) @ self._turns.T).real
        best = likely.max(axis=1)
        sure = best - likely[:, 0] > _SIGMAS * np.sqrt(1.5 * count)
        return self._windows[np.where(sure & (best > _AGREE * count), likely.argmax(axis=1), 0)]


@njit(cache=True)
def _told(spectrum, first, steps, joints):
    """Sum of unit phasors that the joints turn by beyond what the steps within transmitters do, per (frame, doppler,
    joint); how many they are in each frame."""
    frames, ranges, bins, _ = spectrum.shape
    told, count = np.zeros((frames, bins, joints.shape[1]), np.complex128), np.zeros(frames)
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
                    told[k, d, i] += turn / max(abs(turn), 1e-30)
                    count[k] += 1
    return told, count
