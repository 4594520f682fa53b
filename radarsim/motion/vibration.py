"""Vibration of the platform: of wheels on a floor, and the tremor of a hand.

A floor's unevenness has a spectrum of displacement G(n0) (n / n0)^-2 over the spatial frequency n (ISO 8608). Wheels at
speed v turn it into G(n0) n0^2 v / f^2 over the frequency: within a band from f1 to f2 the variance is

    sigma^2 = G(n0) n0^2 v (1 / f1 - 1 / f2).

Cosines of equal amplitude, whose frequencies lie evenly over 1 / f, have this spectrum. Path lengths are parabolas over
a burst (`radarsim.propagation.burst`). What a vibration of frequency f leaves of its displacement is at most
(2 pi f h)^3 / 24 of it, with h half the burst: 5 % at 20 Hz in 16 ms. So bands end at 20 Hz; a cart's then leaves 0.14
degrees RMS of phase in a burst of 16 ms and 3 degrees in one of 50 ms. Little is above 20 Hz: the IMU beside a real
radar that is carried around (recording `ti-pointcloud-imu`) has 0.10 to 0.16 mm RMS per axis in 5 to 20 Hz, and 0.001
to 0.003 mm in 20 to 40 Hz.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from radarsim.motion.platforms import Vibration
from radarsim.motion.trajectory import Motion

_WAVES = 48  # cosines per axis
_FINER = 4  # knots per knot of the path: 200 Hz for a planned one
_BUILDUP = 0.1  # s, time over which the amplitude follows the speed


def vibrating(motion: Motion, vibration: Vibration, rng: np.random.Generator) -> Motion:
    """Add vibration to the position of a body, independently in the three axes.

    Args:
        motion: motion of body and sensor; its attitude stays the same.
        vibration: band and level.
        rng: random generator of frequencies and phases.
    """
    knots = motion.path.x
    count = _FINER * (len(knots) - 1) + 1
    time = np.interp(np.arange(count) / _FINER, np.arange(len(knots)), knots)
    low, high = vibration.band
    share = (np.arange(_WAVES)[:, None] + rng.random((_WAVES, 3))) / _WAVES
    frequency = 1 / (1 / low - share * (1 / low - 1 / high))
    phase = rng.uniform(0, 2 * np.pi, (_WAVES, 3))
    waves = sum(np.cos(2 * np.pi * np.outer(time, f) + p) for f, p in zip(frequency, phase, strict=True))
    speed = np.linalg.norm(motion.path(time, 1)[:, :2], axis=1)
    rms = np.sqrt(vibration.rest**2 + vibration.rolling**2 * speed)
    rms = gaussian_filter1d(rms, _BUILDUP * (count - 1) / (knots[-1] - knots[0]), mode="nearest")
    # Refining the spline's knots reproduces it exactly: only the vibration is added.
    path = CubicSpline(time, motion.path(time) + np.sqrt(2 / _WAVES) * rms[:, None] * waves)
    return replace(motion, path=path)
