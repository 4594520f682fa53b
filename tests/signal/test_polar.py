"""Polar images against a plain transcription of the published program, and the measures of points."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarize.signal import polar

RADAR = PRESETS["radarhd"].model_copy(update={"loops": 1})


def samples(echoes: list[tuple[float, float, float]], noise: float = 3.0, frames: int = 2) -> np.ndarray:
    """Point echoes of (range m, azimuth rad to the left, amplitude): of a beat and of steps from antenna to antenna."""
    rng = np.random.default_rng(1)
    time = np.arange(RADAR.samples) / RADAR.sample_rate
    signal = rng.normal(0, noise, (frames, 1, 3, 4, RADAR.samples, 2)) @ [1, 1j]
    antenna = 4.0 * np.array([0, np.nan, 1])[:, None] + np.arange(4)
    for distance, azimuth, amplitude in echoes:
        beat = np.exp(2j * np.pi * RADAR.slope * 2 * distance / 299_792_458 * time)
        steps = np.nan_to_num(np.exp(-1j * np.pi * antenna * np.sin(azimuth)))
        signal += amplitude * steps[:, :, None] * beat
    return np.rint(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)


def transcribed(frame: np.ndarray) -> np.ndarray:
    """Image of a frame, cell by cell."""
    loop = frame[0, [0, 2]].astype(float) @ [1, 1j]
    spectrum = np.fft.fftshift(np.fft.fft(np.fft.fft(loop.reshape(8, 512), axis=1), 64, axis=0), axes=0)
    magnitude = np.abs(spectrum)
    largest = magnitude[:, 6:].max()
    cells = []
    for j, sine in enumerate(np.linspace(1, -1, 64)):
        for k, distance in enumerate(np.linspace(0, 21.59, 512)):
            x, y = distance * np.sqrt(1 - sine**2), distance * sine
            if k < 6 or magnitude[j, k] < 0.05 * largest or not (0 < x <= 10 and -10 <= y <= 10):
                continue
            r, azimuth = np.sqrt(x**2 + y**2), np.rad2deg(np.arctan2(y, x))
            if r <= 10.8 and -70 <= azimuth <= 70:
                cells.append((r, azimuth, 10 * np.log10(magnitude[j, k])))
    levels = [level for *_, level in cells]
    picture = np.zeros((256, 64))
    for r, azimuth, level in cells:
        row = next(i for i, edge in enumerate(np.linspace(0, 10.8, 256)) if edge >= r)
        column = next(i for i, edge in enumerate(np.linspace(-90, 90, 64)) if edge >= azimuth)
        share = (level - min(levels)) / (max(levels) - min(levels))
        picture[row, column] = max(picture[row, column], share)
    return (picture * 255).astype(np.uint8)


def test_pictures_are_those_that_are_published():
    adc = samples([(2.5, 0.4, 400), (6.1, -0.8, 150), (8.0, 0.0, 60), (12.0, 0.2, 300), (3.0, 1.3, 200)])
    found = polar.pictures(adc, RADAR)
    for frame, picture in zip(adc, found, strict=True):
        assert np.array_equal(picture, transcribed(frame))
    assert 0.005 < (found > 0).mean() < 0.5 and found.max() == 255


@pytest.mark.parametrize("azimuth", [-0.9, -0.3, 0.0, 0.5])
def test_an_echo_is_where_it_is(azimuth):
    picture = polar.pictures(samples([(4.0, azimuth, 500)]), RADAR)[0]
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    assert polar.RANGES[row] == pytest.approx(4.0, abs=0.06)
    assert np.sin(polar.AZIMUTHS[column]) == pytest.approx(np.sin(azimuth), abs=0.06)  # left is positive


def test_silence_has_no_cells():
    assert not polar.pictures(np.zeros((1, *RADAR.frame_shape), np.int16), RADAR).any()


@pytest.mark.parametrize(("transmitters", "width"), [(polar.PUBLISHED, 8), (polar.MEASURED, 4)])
def test_beams_are_as_wide_as_the_row_of_antennas(transmitters, width):
    """A lone echo ahead: sin(n x) / (n sin x) over the sine of azimuth, 26 dB deep."""
    row = polar.pictures(samples([(4.0, 0.0, 500)], noise=0.0), RADAR, transmitters)[0]
    row = row[row.max(axis=1).argmax()].astype(float)
    sine = np.sin(polar.AZIMUTHS)
    beam = np.abs(np.sinc(width * sine / 2) / np.sinc(sine / 2))
    shown = row > 0
    level = 20 * np.log10(np.maximum(beam, 1e-3))
    inside = shown & (beam > 0.5)  # cells go to the next column: where the beam is steep they differ
    assert np.median(np.abs(row[inside] / 255 * 26 - 26 - level[inside])) < 1.0
    assert inside.sum() == pytest.approx(1.2 / width * 2 * 32 / 1.57, rel=0.35)


def test_a_wall_in_the_lidars_picture():
    y = np.linspace(-3, 3, 400)
    wall = np.stack([np.full(400, 2.0), y, np.zeros(400)], axis=1)
    picture = np.zeros((polar.ROWS, polar.BEAMS), bool)
    picture[tuple(polar.lidar_pixels(np.concatenate([wall, wall + [0, 0, 0.4], -wall])).T)] = True
    points = polar.cartesian(picture)
    assert np.abs(points[:, 0] - 2.0).max() < 0.11 and np.ptp(points[:, 1]) == pytest.approx(6.0, abs=0.15)
