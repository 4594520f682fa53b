"""A walk past points with known positions, with a board of known errors, summed by brute force (`tests.echoes`)."""

from typing import NamedTuple

import numpy as np
import pytest

from radarize.io.recording import Recording, RecordingWriter
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarize.radar.presets import PRESETS
from tests.echoes import record

CONFIG = PRESETS["radarize"]
LEVER, YAW, HEIGHT = 0.25, np.radians(4.0), 1.0


class Spoiled(NamedTuple):
    """A recording, and the errors of its board."""

    recording: Recording
    factors: np.ndarray
    bias: float


def errors(seed: int) -> tuple[np.ndarray, float]:
    """Channel factors (3, 4) within 30 deg and 2 dB, and a range bias within 0.2 m."""
    rng = np.random.default_rng(seed)
    gain, phase = rng.uniform(-2, 2, (3, 4)), np.radians(rng.uniform(-30, 30, (3, 4)))
    return 10 ** (gain / 20) * np.exp(1j * phase), float(rng.uniform(-0.2, 0.2))


def spoil(adc: np.ndarray, config: RadarConfig, factors: np.ndarray, bias: float) -> np.ndarray:
    """Samples of a board with channel errors and a range bias."""
    times = (np.arange(config.samples) - (config.samples - 1) / 2) / config.sample_rate
    shift = np.exp(4j * np.pi * config.slope * bias / SPEED_OF_LIGHT * times)
    signal = (adc[..., 0] + 1j * adc[..., 1]) * factors[..., None] * shift
    return np.rint(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)


def ride(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places of the sensor and its yaw on a carrier that rolls to and fro in curves, about 1 m/s."""
    times = np.asarray(times)
    heading = 0.9 * np.sin(0.7 * times)
    fine = np.linspace(-0.1, 12.0, 12_101)
    speed = 0.9 + 0.2 * np.sin(1.3 * fine)
    way = np.cumsum(
        speed[:, None] * np.stack([np.cos(0.9 * np.sin(0.7 * fine)), np.sin(0.9 * np.sin(0.7 * fine))], 1), 0
    )
    way *= fine[1] - fine[0]
    axle = [np.interp(times, fine, way[:, axis]) for axis in (0, 1)]
    place = np.stack([axle[0] + LEVER * np.cos(heading), axle[1] + LEVER * np.sin(heading), 0 * heading + HEIGHT], -1)
    return place, heading + YAW


@pytest.fixture(scope="session")
def spoiled(tmp_path_factory) -> Spoiled:
    """10 s past 260 points of a lane 7 m wide, some on the floor."""
    rng = np.random.default_rng(3)
    stamps = np.arange(300) * CONFIG.frame_period
    points = np.stack([rng.uniform(0, 14, 260), rng.uniform(-3.5, 5.5, 260), rng.choice([0.0, 1.0], 260)], axis=1)
    points[:, 2] *= rng.normal(1.0, 0.15, 260)
    apart = np.linalg.norm(points[:, None, :2] - ride(np.linspace(0, 10, 200))[0][None, :, :2], axis=2).min(axis=1)
    points = points[apart > 0.7]
    amplitudes = 60 * np.exp(2j * np.pi * rng.random(len(points)))
    adc = record(CONFIG, ride, points, amplitudes, stamps, rng, noise=6.0, block=8)
    factors, bias = errors(5)
    path = tmp_path_factory.mktemp("calibration") / "ride.h5"
    with RecordingWriter(path, CONFIG) as writer:
        writer.append(spoil(adc, CONFIG, factors, bias), stamps)
    return Spoiled(Recording(path), factors, bias)
