"""Broken receivers: their interpolated values equal the true ones for single echoes."""

import numpy as np
import pytest
import torch

from radarize.odometry.doppler import DopplerVelocity
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor, Signal
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.receivers import Receivers
from tests.batches import stream
from tests.echoes import record
from tests.rooms import antenna_gain, furnished_room, walk

CONFIG = PRESETS["radarize"]
pytestmark = pytest.mark.usefixtures("one_thread")


def pure(config, azimuth):
    """Spectrum of one echo in every cell: exact phases of virtual antennas, flat (tx, rx)."""
    maps = Heatmaps(config)
    count = len(config.tx) * len(config.rx)
    phases = maps.steering(np.arange(count), np.sin([np.radians(azimuth)]))[:, 0]
    return torch.as_tensor(np.tile(3 * phases, (2, 5, 4, 1))).to(torch.complex64)


@pytest.mark.parametrize("places", [(0,), (1,), (3,), (1, 2), (0, 3)])
@pytest.mark.parametrize("azimuth", [-40.0, 0.0, 25.0])
def test_a_single_echo_is_as_if_nothing_were_broken(places, azimuth):
    whole = pure(CONFIG, azimuth)
    hurt, broken = whole.clone(), np.zeros((2, 4), bool)
    broken[1, list(places)] = True
    hurt.unflatten(-1, (3, 4))[1][..., list(places)] = 777.0
    found = Receivers(CONFIG).filled(hurt, broken)
    missing = (0, 3) if places == (1, 2) else ()  # no two neighbours are left to estimate the step
    expected = whole.clone()
    if missing:
        expected.unflatten(-1, (3, 4))[1][..., list(places)] = 0
    assert torch.allclose(found, expected, atol=2e-2)
    assert torch.equal(Receivers(CONFIG).filled(whole, np.zeros((2, 4), bool)), whole)


@pytest.mark.parametrize("board", ["iwr6843aop", "iwr6843ods"])
def test_square_arrays_are_filled_along_their_rows(board):
    config = CONFIG.model_copy(update={"board": board, "start_frequency": 60e9})
    whole, broken = pure(config, 20.0), np.zeros((2, 4), bool)
    broken[:, 1] = True
    assert torch.allclose(Receivers(config).filled(whole, broken), whole, atol=5e-2)


@pytest.fixture(scope="module")
def tour():
    """Furnished room: samples, time stamps and true velocities."""
    rng = np.random.default_rng(0)
    pose, stamps = walk(rng, 2.0), np.arange(12) * CONFIG.frame_period
    adc = record(
        CONFIG, pose, *furnished_room(rng, density=8.0, boxes=6), stamps, rng, 20.0, block=32, gain=antenna_gain
    )
    centers = stamps + CONFIG.burst_center
    (ahead, _), (back, _), (_, yaw) = pose(centers + 1e-3), pose(centers - 1e-3), pose(centers)
    east, north = ((ahead - back) / 2e-3)[:, :2].T
    return (
        adc,
        stamps,
        np.stack([np.cos(yaw) * east + np.sin(yaw) * north, np.cos(yaw) * north - np.sin(yaw) * east], 1),
    )


def error(adc, stamps, truth):
    preprocessor = Preprocessor(Signal(CONFIG))
    method = DopplerVelocity(preprocessor.signal.heatmaps)
    found = np.concatenate([method.estimate(batch).velocity for batch in stream(preprocessor, adc, stamps)])
    return float(np.sqrt(((found - truth) ** 2).mean()))


@pytest.mark.parametrize("kind", ["dead", "saturated"])
def test_velocity_hardly_suffers(tour, kind):
    adc, stamps, truth = tour
    hurt = adc.copy()
    if kind == "dead":
        hurt[:, :, :, 1] = np.random.default_rng(3).normal(0, 5, hurt[:, :, :, 1].shape)
    else:
        hurt[:, :, :, 2] = np.clip(800 * hurt[:, :, :, 2].astype(int), -32768, 32767)
    assert error(hurt, stamps, truth) < 1.5 * error(adc, stamps, truth) + 0.005


def test_a_broken_receiver_left_as_it_is_costs_much(tour, monkeypatch):
    """Without interpolation the error is large, so the test above is meaningful."""
    adc, stamps, truth = tour
    hurt = adc.copy()
    hurt[:, :, :, 2] = np.clip(800 * hurt[:, :, :, 2].astype(int), -32768, 32767)
    monkeypatch.setattr(Receivers, "filled", lambda self, spectrum, broken: spectrum)
    assert error(hurt, stamps, truth) > 2 * error(adc, stamps, truth)
