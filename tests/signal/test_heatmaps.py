"""Heat maps of point echoes against closed forms."""

import numpy as np
import pytest
import torch

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from tests.echoes import record

CONFIG = PRESETS["radarize"]


def point(range_=2.0, azimuth=0.0, elevation=0.0):
    """Point around the origin, angles in degrees."""
    a, e = np.radians([azimuth, elevation])
    return range_ * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def frame(points, velocity=(0.0, 0.0, 0.0), amplitudes=None, config=CONFIG, noise=0.0):
    """One frame with its burst centre at the origin, looking along x, in uniform motion."""
    points = np.atleast_2d(points)
    amplitudes = np.full(len(points), 1000.0) if amplitudes is None else np.asarray(amplitudes)

    def pose(t):
        return (t - config.burst_center)[..., None] * np.asarray(velocity), np.zeros(t.shape)

    return record(config, pose, points, amplitudes, np.zeros(1), np.random.default_rng(1), noise)


def peak(values, *axes):
    """Coordinates of the largest value."""
    index = np.unravel_index(int(np.argmax(values)), values.shape)
    return [float(axis[i]) for axis, i in zip(axes, index, strict=True)]


def vertex(values, axis):
    """Peak of a curve between its bins, from three points of its logarithm."""
    i = int(np.argmax(values))
    a, b, c = np.log(values[i - 1 : i + 2])
    return axis[i] + 0.5 * (a - c) / (a - 2 * b + c) * (axis[1] - axis[0])


@pytest.mark.parametrize("azimuth", [-50, -20, 0, 20, 50])
@pytest.mark.parametrize("method", ["bartlett", "capon"])
def test_range_azimuth_peak(azimuth, method):
    maps = Heatmaps(CONFIG)
    power = maps.range_azimuth(frame(point(2.0, azimuth)), method=method)[0].numpy()
    found_range, found_azimuth = peak(power, maps.ranges, np.degrees(maps.azimuths))
    assert found_range == pytest.approx(2.0, abs=0.6 * CONFIG.range_resolution)
    assert found_azimuth == pytest.approx(azimuth, abs=1.01)


@pytest.mark.parametrize("azimuth", [-30, 25])
@pytest.mark.parametrize("speed", [-1.2, -0.4, 0.4, 1.2])
def test_doppler_azimuth_peak(azimuth, speed):
    maps = Heatmaps(CONFIG)
    adc = frame(point(2.0, azimuth), velocity=(speed / np.cos(np.radians(azimuth)), 0, 0))
    power = maps.doppler_azimuth(adc)[0].numpy()
    found_speed, found_azimuth = peak(power, maps.velocities, np.degrees(maps.azimuths))
    assert found_azimuth == pytest.approx(azimuth, abs=1.01)  # 51 deg of slot phase at 1.6 m/s would move it by 12 deg
    assert found_speed == pytest.approx(speed, abs=0.6 * CONFIG.velocity_resolution)
    assert vertex(power.max(axis=1), maps.velocities) == pytest.approx(speed, abs=0.015)


@pytest.mark.parametrize("speed", [-1.2, 0.4])
def test_range_doppler_peak(speed):
    maps = Heatmaps(CONFIG)
    power = maps.range_doppler_of(maps.spectrum(frame(point(2.0, 0), velocity=(speed, 0, 0))))[0].numpy()
    found_range, found_speed = peak(power, maps.ranges, maps.velocities)
    assert found_range == pytest.approx(2.0, abs=0.6 * CONFIG.range_resolution)
    assert found_speed == pytest.approx(speed, abs=0.6 * CONFIG.velocity_resolution)


def test_what_aliases_has_its_azimuth_once_unfolded():
    """A phase step of 120 deg per slot looks like another azimuth."""
    maps = Heatmaps(CONFIG)
    spectrum = maps.spectrum(frame(point(2.0, 10), velocity=(2.4, 0, 0)))

    def off(spectrum):
        return abs(peak(maps.range_azimuth_of(spectrum)[0].numpy(), maps.ranges, np.degrees(maps.azimuths))[1] - 10)

    assert off(maps.unfolded(spectrum, np.ones((1, CONFIG.loops), int))) <= 1 < 4 < off(spectrum)
    assert maps.unfolded(spectrum, np.zeros((1, CONFIG.loops), int)) is spectrum


def test_static_world_draws_the_cosine_ridge():
    azimuths = np.array([-50, -25, 0, 25, 50])
    maps = Heatmaps(CONFIG)
    velocity = np.array([0.9, 0.5, 0.0])
    adc = frame([point(1 + 0.5 * i, a) for i, a in enumerate(azimuths)], velocity)
    power = maps.doppler_azimuth(adc)[0].numpy()
    for azimuth in np.radians(azimuths):
        column = power[:, np.argmin(np.abs(maps.azimuths - azimuth))]
        expected = velocity[0] * np.cos(azimuth) + velocity[1] * np.sin(azimuth)
        assert vertex(column, maps.velocities) == pytest.approx(expected, abs=0.04)


def test_axes():
    maps = Heatmaps(CONFIG.model_copy(update={"range_bias": 0.07}))
    assert maps.velocities[CONFIG.loops // 2] == 0
    assert (np.diff(maps.velocities) > 0).all() and (np.diff(maps.azimuths) > 0).all()
    assert maps.ranges[10] == pytest.approx(10 * CONFIG.range_resolution - 0.07)


def test_beam_width():
    maps = Heatmaps(CONFIG, azimuths=np.radians(np.arange(-40, 40, 0.1)))
    power = maps.range_azimuth(frame(point(2.0)))[0].numpy()
    row = power[np.argmax(power.max(axis=1))]
    width = 0.1 * (row > row.max() / 2).sum()
    # Uniform: 0.886 wavelength / aperture of 8 half wavelengths (at 77 GHz) = 12.4 deg; the taper adds a sixth.
    assert 12.4 < width < 15.5
    outside = row[np.abs(maps.azimuths) > np.radians(20)]
    assert 10 * np.log10(outside.max() / row.max()) < -23


def test_capon_resolves_what_the_beam_does_not():
    maps = Heatmaps(CONFIG)
    # Motion separates the two in Doppler, so that they are not coherent.
    adc = frame([point(2.0, -5), point(2.0, 6)], velocity=(0, 1.2, 0), noise=3.0)

    def dip(power):
        row = power[0].numpy().max(axis=0)
        at = {a: row[np.argmin(np.abs(np.degrees(maps.azimuths) - a))] for a in (-5, 0, 6)}
        return 10 * np.log10(min(at[-5], at[6]) / at[0])

    assert dip(maps.range_azimuth(adc, method="capon")) > 6 > 1 > dip(maps.range_azimuth(adc))


def test_scaling():
    maps = Heatmaps(CONFIG)
    on_bin = point(45 * CONFIG.range_resolution)
    adc = frame(on_bin)
    expected = pytest.approx(1000.0**2, rel=0.02)
    assert maps.range_azimuth(adc).max().item() == expected
    # Capon suppresses an echo that lies a fraction of a degree off its columns.
    assert maps.range_azimuth(adc, method="capon").max().item() == pytest.approx(1000.0**2, rel=0.15)
    assert maps.elevation_aware(adc).max().item() == expected
    assert maps.doppler_azimuth(adc).max().item() == expected
    assert maps.beamformed(maps.spectrum(adc), maps.row, maps._steering).max().item() == expected
    assert maps.range_profile(adc).max().item() == expected
    assert maps.range_doppler_of(maps.spectrum(adc)).max().item() == expected
    # Off the bins nothing is lost where an axis is summed over.
    moving = frame(on_bin, velocity=(0.437, 0, 0))
    assert maps.range_azimuth(moving).max().item() == pytest.approx(1000.0**2, rel=0.1)


def test_elevation_aware_fades_the_ceiling():
    maps = Heatmaps(CONFIG)
    plain, aware = [], []
    for elevation in (0, 50):
        adc = frame(point(2.0, 0, elevation))
        plain.append(maps.range_azimuth(adc).max().item())
        aware.append(maps.elevation_aware(adc).max().item())
    half = 0.5 * CONFIG.center_frequency / 77e9
    law = 20 * np.log10(abs(np.cos(np.pi * half * np.sin(np.radians(50)))))
    assert 10 * np.log10(plain[1] / plain[0]) == pytest.approx(0, abs=0.5)
    assert 10 * np.log10(aware[1] / aware[0]) == pytest.approx(law, abs=0.7)


def test_calibration_is_by_physical_transmitter():
    factors = np.exp(2j * np.pi * np.random.default_rng(3).random(12))
    config = CONFIG.model_copy(update={"channel_calibration": tuple((1 / f.real.item(), 0.0) for f in np.ones(12))})
    calibrated = config.model_copy(update={"channel_calibration": tuple((f.real, f.imag) for f in 1 / factors)})
    adc = frame(point(2.0, 20)).astype(np.float64)
    samples = (adc[..., 0] + 1j * adc[..., 1]) * factors.reshape(3, 4)[None, None, :, :, None]
    spoiled = np.rint(np.stack([samples.real, samples.imag], axis=-1)).astype(np.int16)
    reference = Heatmaps(CONFIG).range_azimuth(adc.astype(np.int16))
    torch.testing.assert_close(
        Heatmaps(calibrated).range_azimuth(spoiled), reference, rtol=0.01, atol=1e-3 * reference.max().item()
    )
    assert Heatmaps(config).range_azimuth(spoiled).max() < 0.6 * reference.max()


def test_lost_chirps_leave_the_map_in_place():
    maps = Heatmaps(CONFIG)
    adc = frame(point(2.0, 20), velocity=(0.8, 0, 0))
    whole = maps.range_azimuth(adc)[0].numpy()
    valid = np.ones(adc.shape[:3], bool)
    valid[0, 5:8] = False
    valid[0, 20, 1] = False
    adc[~valid] = 0
    holed = maps.range_azimuth(adc, valid)[0].numpy()
    assert peak(holed, maps.ranges, maps.azimuths) == peak(whole, maps.ranges, maps.azimuths)
    assert holed.max() == pytest.approx(whole.max(), rel=0.3)


@pytest.mark.parametrize("method", ["bartlett", "capon"])
def test_lost_frame_is_zero(method):
    maps = Heatmaps(CONFIG)
    adc = np.zeros((2, *CONFIG.frame_shape), np.int16)
    valid = np.zeros(adc.shape[:3], bool)
    assert (maps.range_azimuth(adc, valid, method).numpy() == 0).all()
    assert (maps.doppler_azimuth(adc, valid).numpy() == 0).all()


@pytest.mark.parametrize(
    "change", [{"rx": (0,)}, {"rx": (1, 2)}, {"tx_order": (0, 2)}, {"tx_order": (0,)}, {"tx_order": (0,), "rx": (2,)}]
)
def test_other_arrays(change):
    config = RadarConfig(**{**CONFIG.model_dump(), **change})
    maps = Heatmaps(config)
    adc = frame(point(2.0, 0), config=config)
    power = maps.range_azimuth(adc)[0]
    assert power.shape == (96, 121) and torch.isfinite(power).all()
    assert maps.ranges[int(power.max(dim=1).values.argmax())] == pytest.approx(2.0, abs=0.03)
    if maps.pairs is None:
        with pytest.raises(InputError, match="pairs"):
            maps.elevation_aware(adc)
    else:
        assert torch.isfinite(maps.elevation_aware(adc)).all()


def test_batches_equal_single_frames_and_wrong_shapes_are_named():
    maps = Heatmaps(CONFIG)
    adc = np.concatenate([frame(point(2.0, a)) for a in (-20, 0, 20)])
    together = maps.range_azimuth(adc)
    # How sums are ordered differs with the size of a batch on some processors: equal to single precision of the peak.
    peak = float(together.max())
    torch.testing.assert_close(together[1:2], maps.range_azimuth(adc[1:2]), rtol=1e-5, atol=1e-6 * peak)
    with pytest.raises(InputError, match="expected"):
        maps.range_azimuth(adc[:, :, :2])
