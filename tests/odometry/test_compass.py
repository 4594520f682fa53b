"""Turns by the strongest echo: of walls and posts whose bearings are known, beside an estimator that errs."""

import numpy as np
import pytest
import torch

from radarize.batch import Signal
from radarize.heatmaps import Heatmaps
from radarize.odometry.compass import Compass, Strongest
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import MapRotation, Rotations
from radarize.radar.presets import PRESETS
from tests.batches import of_spectrum

CONFIG, FIRST = PRESETS["radarize"], 5
DT, COUNT = CONFIG.frame_period, 150
MAPS = Heatmaps(CONFIG)


def slide(kind):
    """True yaws, velocities in the sensor's frame, ranges and bearings of a wall 1.3 m ahead, or of a post there, seen
    on a walk along it at 0.7 m/s, which begins slowly."""
    time = DT * np.arange(COUNT)
    yaw = np.radians(15) * np.sin(time)
    pace = 0.7 * np.clip(time - 0.5, 0, 1)
    along = np.cumsum(pace) * DT
    velocity = pace[:, None] * np.stack([np.sin(yaw), np.cos(yaw)], axis=1)  # of a walk along y
    aside = np.zeros(COUNT) if kind == "wall" else 1.0 - along
    return yaw, velocity, np.hypot(1.3, aside), np.arctan2(aside, 1.3) - yaw


def wrong(yaw, along):
    """Turns of an estimator that is right at first, and takes a third of a slide for turning later on."""
    late = np.clip(DT * np.arange(1, COUNT) - 1.5, 0, 1)
    return np.diff(yaw) + late * np.diff(along) / 1.3 / 3


@pytest.mark.parametrize("kind", ["wall", "post"])
def test_an_echo_remains_what_it_was(kind):
    yaw, velocity, ranges, bearings = slide(kind)
    told = wrong(yaw, np.cumsum(np.hypot(*velocity.T)) * DT)
    compass = Compass(MAPS, FIRST)
    rng, found = np.random.default_rng(1), []
    for k in range(COUNT):
        ahead = np.array([np.cos(bearings[k]), np.sin(bearings[k])])
        echo = Strongest(ranges[k], velocity[k] @ ahead, bearings[k] + rng.normal(0, np.radians(0.1)), True)
        found.append(compass.turn(echo, DT, velocity[k], told[k - 1] if k else 0.0))
    assert found[0] is None and None not in found[1:]
    turns, true = np.array([turn.yaw for turn in found[1:]]), np.diff(yaw)
    part = slice(45, None)
    assert abs(told[part].sum() - true[part].sum()) > np.radians(15)
    assert abs(turns[part].sum() - true[part].sum()) < np.radians(2)
    assert (found[-1].flash > 0.95) == (kind == "wall")
    assert np.sqrt(found[-1].variance) < np.radians(0.5)


def test_what_moves_jumps_or_is_two_echoes_tells_nothing():
    compass, still = Compass(MAPS, FIRST), np.zeros(2)
    wall = Strongest(2.0, 0.0, 0.1, True)
    assert compass.turn(wall, DT, still, 0.0) is None
    assert compass.turn(wall, DT, still, 0.0).yaw == 0
    for other in (
        wall._replace(speed=0.6),
        wall._replace(range=2.3),
        wall._replace(bearing=0.3),
        wall._replace(clear=False),
    ):
        assert compass.turn(other, DT, still, 0.0) is None
        compass.turn(wall, DT, still, 0.0)


def spectra(ranges, speeds, bearings, rng, second=0.0):
    """Of one plane wave in a cell of noise; `second`, of another one 40 deg aside, as a share of its amplitude."""
    shape = (len(ranges), CONFIG.samples, CONFIG.loops, 12)
    found = rng.normal(0, 1, shape) + 1j * rng.normal(0, 1, shape)
    step = MAPS.ranges[1] - MAPS.ranges[0]
    bins = (ranges - MAPS.ranges[0]) / step
    d = np.argmin(np.abs(MAPS.velocities - speeds[:, None]), axis=1)
    for k, sine in enumerate(np.sin(bearings)):
        wave = MAPS.steering(np.arange(12), [sine])[:, 0] + second * MAPS.steering(np.arange(12), [sine - 0.65])[:, 0]
        for r in range(int(bins[k]) - 2, int(bins[k]) + 4):
            found[k, r, d[k]] += 1000 * np.exp(-((r - bins[k]) ** 2)) * wave
    return torch.as_tensor(found).to(torch.complex64)


def test_the_strongest_echo_has_its_place():
    ranges, speeds = np.array([1.31, 2.5, 3.07]), np.array([0.0, 0.46, -0.46])
    bearings = np.radians([-35.0, 0.4, 20.3])
    compass = Compass(MAPS, FIRST)
    for cells, *true in zip(
        spectra(ranges, speeds, bearings, np.random.default_rng(0)).numpy(), ranges, speeds, bearings, strict=True
    ):
        echo = compass.strongest(cells)
        assert echo.clear and echo[:3] == pytest.approx(true, abs=0.06)
        assert echo.bearing == pytest.approx(true[2], abs=np.radians(0.3))
        assert echo.range == pytest.approx(true[0], abs=0.005)
    double = spectra(ranges, speeds, bearings, np.random.default_rng(0), second=0.5).numpy()
    assert not any(compass.strongest(cells).clear for cells in double)
    noise = np.random.default_rng(1).normal(0, 1, (*double.shape[1:], 2)).astype(np.float32).view(np.complex64)[..., 0]
    assert not compass.strongest(noise).clear


class Astray:
    """Rotation estimator of turns at hand, which it claims to know well."""

    def __init__(self, turns):
        self.turns = turns

    def estimate(self, batch, velocities):
        count = len(batch)
        return Rotations(self.turns, np.full(count, np.radians(0.1) ** 2), np.ones(count, bool))


def test_sliding_along_a_bare_wall_is_no_turn():
    """The local map sees nothing but the flash, and what turns the network tells is off by 30 deg."""
    yaw, velocity, ranges, bearings = slide("wall")
    told = np.append(0.0, wrong(yaw, np.cumsum(np.hypot(*velocity.T)) * DT))
    closing = (velocity * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)).sum(axis=1)
    spectrum = spectra(ranges, closing, bearings, np.random.default_rng(2))
    signal = Signal(CONFIG)
    velocities = Velocities(
        velocity, np.tile(1e-4 * np.eye(2), (COUNT, 1, 1)), np.full(COUNT, 20), np.ones(COUNT, bool)
    )
    found = MapRotation(signal.heatmaps, prior=Astray(told)).estimate(
        of_spectrum(signal, spectrum, DT * np.arange(COUNT)), velocities
    )
    error, claimed = found.yaw.sum() - (yaw[-1] - yaw[0]), np.sqrt(found.variance[1:].sum())
    assert abs(told.sum() - (yaw[-1] - yaw[0])) > np.radians(15)
    assert abs(error) < np.radians(4) and abs(error) < 3 * claimed
