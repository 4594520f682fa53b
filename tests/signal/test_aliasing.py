"""Resolution of Doppler ambiguity from phase steps between transmitters, for single points of known speed."""

import numpy as np
import pytest

from radarize.radar.boards import BOARDS
from radarize.radar.presets import PRESETS
from radarize.signal.aliasing import Aliases
from radarize.signal.heatmaps import Heatmaps
from tests.echoes import record
from tests.radars import radar

CONFIG = PRESETS["radarize"]
SPAN = 2 * CONFIG.max_velocity


def frame(velocity, config=CONFIG, noise=5.0):
    """Points ahead of a radar in uniform motion."""
    azimuths, ranges = np.radians(np.linspace(-55, 55, 60)), np.random.default_rng(4).uniform(0.8, 4.0, 60)
    points = np.stack([ranges * np.cos(azimuths), ranges * np.sin(azimuths), np.zeros(60)], axis=1)

    def pose(t):
        return (t - config.burst_center)[..., None] * np.array([*velocity, 0.0]), np.zeros(t.shape)

    amplitudes = 300 * np.exp(2j * np.pi * np.random.default_rng(3).random(60))
    adc = record(config, pose, points, amplitudes, np.zeros(1), np.random.default_rng(1), noise, block=8)
    return adc, points @ np.array([*velocity, 0.0]) / ranges


@pytest.mark.parametrize("velocity", [(2.2, 0), (-2.6, 0), (2.0, 1.2), (2.9, 0), (1.2, 0.2), (0, 0)])
def test_every_echo_is_in_the_window(velocity):
    adc, closing = frame(velocity)
    maps = Heatmaps(CONFIG)
    (spans,) = Aliases(CONFIG).of(maps.spectrum(adc))
    for speed in closing:
        bins = np.rint((speed - maps.velocities) / SPAN)
        nearest = np.argmin(np.abs(speed - maps.velocities - bins * SPAN))
        assert spans[nearest] == bins[nearest]
    assert spans.any() == (np.abs(closing).max() > CONFIG.max_velocity)


def test_noise_and_a_single_transmitter_resolve_nothing():
    noise = np.random.default_rng(2).normal(0, 20, (3, *CONFIG.frame_shape)).astype(np.int16)
    assert not Aliases(CONFIG).of(Heatmaps(CONFIG).spectrum(noise)).any()
    single = CONFIG.model_copy(update={"tx_order": (0,)})
    adc, _ = frame((2.2, 0.0), single)
    assert Aliases(single).of(Heatmaps(single).spectrum(adc)).shape == (1, CONFIG.loops)


@pytest.mark.parametrize("board", BOARDS)
def test_of_any_board(board):
    config = radar(board)
    adc, _ = frame((0.5, 0.2), config)
    assert not Aliases(config).of(Heatmaps(config).spectrum(adc)).any()


@pytest.mark.parametrize("name", PRESETS)
def test_leakage_is_as_far_as_it_is_whatever_the_bins(name):
    aliases, ranges = Aliases(PRESETS[name]), PRESETS[name].ranges
    assert ranges[aliases._first - 1] < 0.25 <= ranges[aliases._first]
