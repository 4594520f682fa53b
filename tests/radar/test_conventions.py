"""Signs of a real capture of moving people that somebody else recorded and labelled.

Its labels (a person at +0.58 m/s, 7 deg, one at -0.5...-0.8 m/s, -12...-16 deg, a static target at 2 deg) count
*receding* speed and azimuth to the *right* as positive, TI's convention. Ours are the opposite, closing and left, so
both signs turn together; range migration shows independently which person recedes.
"""

import numpy as np
import pytest

from radarize.radar.array import virtual_positions
from radarize.radar.config import RadarConfig

CONFIG = RadarConfig(
    start_frequency=77e9,
    slope=60.012e12,
    idle_time=30e-6,
    adc_start_time=6e-6,
    ramp_end_time=62e-6,
    samples=128,
    sample_rate=2.5e6,
    loops=128,
    frame_period=0.1,
    tx_order=(0, 2),
)
PAD = 4


@pytest.fixture(scope="module")
def echoes(recordings) -> np.ndarray:
    """Complex samples, (loop, virtual antenna, sample)."""
    stored = np.load(recordings / "xwr-moving-people" / "doppler_example_1.npy", allow_pickle=False)
    real, imag = (part.astype(np.uint16).view(np.int16) for part in (stored.real, stored.imag))
    return real + 1j * imag


def _velocities(count: int) -> np.ndarray:
    """Closing speed of the rows of a transform over `count` loops."""
    return -np.fft.fftfreq(count, CONFIG.loop_time) * CONFIG.wavelength / 2


def _find(echoes: np.ndarray, at_range: float, slowest: float, fastest: float) -> tuple[float, float]:
    """Closing speed and azimuth (deg) of the strongest echo near a range, within a span of closing speeds."""
    window = np.hanning(128)
    spectrum = np.fft.fft(echoes * window, axis=-1)[..., round(at_range / CONFIG.range_resolution)]
    spectrum = np.fft.fft(spectrum * window[:, None], PAD * 128, axis=0)
    speeds = _velocities(PAD * 128)
    power = (np.abs(spectrum) ** 2).sum(axis=1) * ((speeds >= slowest) & (speeds <= fastest))
    best = int(power.argmax())
    # TX3 fires a chirp later than TX1: undo the phase that the target's motion put there.
    delay = np.repeat([0.0, CONFIG.chirp_time], 4)
    antennas = spectrum[best] * np.exp(4j * np.pi / CONFIG.wavelength * speeds[best] * delay)
    azimuths = np.deg2rad(np.arange(-60, 60.1, 0.25))
    y = virtual_positions(CONFIG).reshape(-1, 3)[:, 1]
    steering = np.exp(2j * np.pi / CONFIG.wavelength * np.sin(azimuths)[:, None] * y)
    return speeds[best], float(np.rad2deg(azimuths[np.abs(steering @ antennas).argmax()]))


def test_range_is_a_positive_beat_frequency(echoes):
    spectrum = np.fft.fft(np.fft.fft(echoes * np.hanning(128), axis=-1) * np.hanning(128)[:, None, None], axis=0)
    power = (np.abs(spectrum) ** 2).mean(axis=1)
    assert power[0, 20:].argmax() + 20 == 107  # 5.22 m
    # The anti-aliasing filter dampens the noise at the upper end of the band, so the spectrum is not mirrored.
    noise = power[np.abs(_velocities(128)) > 3].mean(axis=0)
    assert noise[121:125].mean() < 0.5 * noise[4:120].mean()


def test_static_target(echoes):
    speed, azimuth = _find(echoes, 5.22, -0.3, 0.3)
    assert speed == pytest.approx(0, abs=0.03)
    assert azimuth == pytest.approx(-2, abs=1)


def test_people(echoes):
    speed, azimuth = _find(echoes, 2.93, -1.0, -0.2)
    assert speed == pytest.approx(-0.58, abs=0.05)
    assert azimuth == pytest.approx(-7, abs=1)
    speed, azimuth = _find(echoes, 2.93, 0.2, 1.0)
    assert 0.5 <= speed <= 0.85
    assert 11 <= azimuth <= 16


@pytest.mark.parametrize("sign", [-1, 1])
def test_range_migration_agrees_with_the_sign_of_speed(echoes, sign):
    """Within the burst, what closes gets nearer by some millimetres."""
    centres = []
    for part in (echoes[:64], echoes[64:]):
        spectrum = np.fft.fft(np.fft.fft(part * np.hanning(128), 4096, axis=-1) * np.hanning(64)[:, None, None], axis=0)
        moving = (sign * _velocities(64) > 0.3) & (sign * _velocities(64) < 0.95)
        ranges = np.arange(4096) / 4096 * CONFIG.max_range
        near = (ranges > 2.6) & (ranges < 3.25)
        profile = (np.abs(spectrum[moving][..., near]) ** 2).sum(axis=(0, 1))
        centres.append((profile * ranges[near]).sum() / profile.sum())
    assert sign * (centres[1] - centres[0]) < -5e-3
