"""Channels and shifts of directions against closed forms: snapshots of plane waves, speeds of a static world."""

from dataclasses import replace

import numpy as np
import pytest

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.channels import Array, fit_channels
from radarize.pipeline.calibration.egomotion import LEAN, SCALE, SHIFT_LEFT, SHIFT_UP, TILT, solve
from radarize.radar.presets import PRESETS
from tests.pipeline.calibration.conftest import errors

CONFIG = PRESETS["radarize"]
ARRAY = Array(CONFIG)
FRAMES, EACH = 150, 40


def world(seed: int, tilt: float = 0.0, scale: float = 0.0) -> tuple[Cells, np.ndarray]:
    """Cells of a walk, and their directions: walls at the horizon, and objects anywhere; some move."""
    rng = np.random.default_rng(seed)
    count = FRAMES * EACH
    frame = np.repeat(np.arange(FRAMES), EACH)
    left = np.sin(np.radians(rng.uniform(-65, 65, count)))
    wall = rng.random(count) < 0.5
    level = np.where(wall, 0.0, rng.normal(0, 0.25, count))
    ahead = np.sqrt(np.maximum(1 - left**2 - level**2, 0.05))
    up = level - tilt * ahead
    left = left * np.sqrt(np.maximum(1 - up**2, 0.1))
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 1e-3))
    velocity = np.stack([1.0 + 0.3 * np.sin(frame / 15), 0.25 * np.cos(frame / 11), 0.05 * np.sin(frame / 4)], axis=1)
    velocity[:, 2] -= tilt * velocity[:, 0]
    speed = (velocity * np.stack([ahead, left, up], axis=1)).sum(axis=1) + rng.normal(0, 0.004, count)
    speed[rng.random(count) < 0.1] += rng.uniform(-0.8, 0.8)
    span = 2 * CONFIG.max_velocity
    speed -= span * np.rint(speed / span)
    directions = np.stack([left, up], axis=1)
    amplitude = rng.exponential(1, count) * np.exp(2j * np.pi * rng.random(count))
    second = 0.15 * (rng.random(count) < 0.5) * np.exp(2j * np.pi * rng.random(count))
    other = np.stack([rng.uniform(-0.9, 0.9, count), 0 * left], axis=1)
    snapshot = ARRAY.wave(directions / [1 + scale, 1]) + second[:, None] * ARRAY.wave(other)
    noise = rng.normal(0, 0.02, (count, 12, 2)).view(complex)[..., 0]
    power = np.where(wall, 1e5, 1e3)
    return Cells(
        frame, frame / 30.0, rng.uniform(1, 4, count), speed, power, amplitude[:, None] * (snapshot + noise)
    ), directions  # fmt: skip


def test_plane_waves_show_all_but_an_even_slope():
    factors = errors(1)[0].ravel()
    cells, _ = world(0)
    found = fit_channels(replace(cells, snapshot=cells.snapshot * factors), ARRAY)
    off = found.factors / ARRAY.level(factors)
    assert np.degrees(np.abs(np.angle(off)).max()) < 0.3
    assert np.abs(20 * np.log10(np.abs(off))).max() < 0.05
    # Standard errors are of the errors' size.
    assert 0.3 < np.sqrt(np.mean(np.angle(off) ** 2) / np.mean(found.error[:, 1] ** 2)) < 3


def test_a_slope_is_a_shift_of_directions():
    shift = np.array([0.03, -0.05])
    factors = ARRAY.wave(shift[None])[0]
    np.testing.assert_allclose(ARRAY.slope(factors), shift, atol=1e-12)
    np.testing.assert_allclose(ARRAY.level(factors), 1, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_motion_tells_shifts_tilt_and_scale(seed):
    """All values are found with both signs."""
    sign = (-1) ** seed
    shift, tilt, scale = sign * np.array([0.02, -0.04]), sign * np.radians(3.0), sign * 0.02
    cells, directions = world(seed, tilt, scale)
    slope = ARRAY.wave(shift[None])[0]
    channels = fit_channels(replace(cells, snapshot=cells.snapshot * slope), ARRAY)
    motion = solve(cells, channels.waves, ARRAY, CONFIG, FRAMES)
    assert motion.seen.mean() > 0.95
    assert motion.values[SHIFT_LEFT] == pytest.approx(shift[0], abs=0.003)
    assert motion.values[SHIFT_UP] == pytest.approx(shift[1], abs=0.012)
    assert motion.values[TILT] == pytest.approx(tilt, abs=0.012)
    assert motion.values[LEAN] == pytest.approx(0, abs=0.012)
    assert motion.values[SCALE] == pytest.approx(scale, abs=0.004)
    assert np.median(np.abs(motion.directions - directions)[:, 0]) < 0.008


def test_an_array_without_elevation():
    """Two transmitters: a row of eight, which does not determine elevations."""
    flat = PRESETS["two-tx"]
    array = Array(flat)
    assert array.axes == [0]
    factors = np.exp(1j * np.linspace(0, 0.7, 8))
    np.testing.assert_allclose(array.level(factors), 1, atol=1e-9)
    assert array.slope(factors)[1] == 0
