"""The artefact's maps against float64 brute force, and its quirks by what they do to point targets."""

import numpy as np
import pytest

from radarize.baselines.published.maps import BEAMS, BEARINGS, PublishedMaps, area_weights
from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from tests.echoes import record

pytestmark = pytest.mark.usefixtures("one_thread")

CONFIG = PRESETS["radarize"]
DOPPLER, DOPPLER_LEVEL = "published_doppler_azimuth", "published_doppler_elevation_aware"


def point(range_, azimuth, elevation=0.0):
    a, e = np.radians([azimuth, elevation])
    return range_ * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def frames(points, velocity=(0.0, 0.0, 0.0), count=1, config=CONFIG, noise=0.0, amplitude=1000.0):
    """Consecutive frames of a sensor that moves evenly, at the origin in the middle of the last burst."""
    points = np.atleast_2d(points)
    stamps = (np.arange(count) - count + 1) * config.frame_period

    def pose(t):
        return (t - config.burst_center)[..., None] * np.asarray(velocity), np.zeros(t.shape)

    rng = np.random.default_rng(1)
    return record(config, pose, points, np.full(len(points), amplitude), stamps, rng, noise, block=32)


@pytest.fixture(scope="module")
def noisy():
    rng = np.random.default_rng(0)
    return rng.normal(0, 60, (6, *CONFIG.frame_shape)).astype(np.int16)


def chirps(adc, calibration=None):
    """Samples by chirp in firing order (frame, chirp, rx, sample), float64."""
    x = adc[..., 0].astype(float) + 1j * adc[..., 1]
    x = x[:, :, [0, 2, 1]]  # TX1, TX3, TX2
    if calibration is not None:
        x = x * np.asarray(calibration).reshape(3, 4)[:, :, None]
    return x.reshape(len(x), 96, 4, 96)


def brute_doppler(adc, level):
    """The last frame's Doppler-azimuth map, sum by sum."""
    channels = chirps(adc)[-3:].reshape(3 * 32, 12, 96)  # a loop's three chirps are twelve channels
    channels = channels - channels.mean(axis=0)
    if level:
        channels = (channels[:, 2:6] + channels[:, 8:12]) / 2
    n = np.arange(96)
    bins = np.arange(-48, 48)
    spectrum = np.einsum("ds,scf->dcf", np.exp(-2j * np.pi * np.outer(bins, n) / 96), channels)
    steering = np.exp(1j * np.pi * np.outer(np.arange(channels.shape[1]), np.sin(BEAMS)))
    beams = np.einsum("dcf,ca->daf", spectrum, steering)
    beams = beams - beams.mean(axis=2, keepdims=True)
    power = np.log(np.mean(np.abs(beams) ** 2, axis=2))
    level = np.clip((power - 10) / 15, 0, 1)
    # By areas: every cell is split into as many parts as it takes for both sizes to be whole.
    rows = np.repeat(level, 5, axis=0).reshape(60, 8, 182).mean(axis=1)
    return np.repeat(rows, 181, axis=1).reshape(60, 181, 182).mean(axis=2)[:, ::-1]


def brute_capon(adc, count, level):
    """The last frame's range-azimuth map over `count` frames."""
    used = chirps(adc)[-count:].reshape(-1, 4, 96)
    profile = np.fft.fft(used, axis=2)
    snapshots = []  # (channel, sample)
    for k, chirp in enumerate(profile):
        full = np.zeros((12, 96), complex)
        full[4 * (k % 3) : 4 * (k % 3) + 4] = chirp
        snapshots.append(full[:8])
    if level:
        loops = profile.reshape(-1, 12, 96)
        snapshots = (loops[:, 2:6] + loops[:, 8:12]) / 2
    x = np.asarray(snapshots)
    steering = np.exp(-1j * np.pi * np.outer(np.arange(x.shape[1]), np.sin(BEARINGS)))
    power = np.empty((96, 88))
    for r in range(96):
        # Chirps are those of two transmitters; of the elevation-aware array, as many, every second one all zeros.
        covariance = x[:, :, r].T @ x[:, :, r].conj() / (64 * count)
        inverse = np.linalg.inv(covariance)
        power[r] = 1 / np.einsum("ca,cd,da->a", steering.conj(), inverse, steering).real
    return np.clip(np.log(power) / 18, 0, 1)


def test_maps_are_the_sums_they_are_said_to_be(noisy):
    made = PublishedMaps(CONFIG)(noisy)
    assert list(made) == list(PublishedMaps.maps)
    for name, level in ((DOPPLER, False), (DOPPLER_LEVEL, True)):
        assert made[name][-1] == pytest.approx(brute_doppler(noisy, level), abs=1e-4)
    for kind, level in (("range_azimuth", False), ("elevation_aware", True)):
        for count in (1, 3, 5):
            found = made[f"published_{kind}_{count}"][-1]
            assert found == pytest.approx(brute_capon(noisy, count, level), abs=1e-4)


def test_batches_see_their_buffer_and_frames_can_be_picked(noisy):
    maker = PublishedMaps(CONFIG)
    whole, half = maker(noisy), maker(noisy, frames=slice(1, None, 2))
    assert maker.stride(CONFIG) == 2
    later = maker(noisy[1:], frames=slice(4, None))
    for name in maker.names:
        assert np.array_equal(half[name], whole[name][1::2])
        assert later[name][-1] == pytest.approx(whole[name][-1], abs=1e-4)
        assert np.shape(whole[name])[1:] == (maker.axes(CONFIG, name).rows, len(maker.axes(CONFIG, name).azimuths))


def test_silence_is_dark_and_other_arrays_are_refused():
    made = PublishedMaps(CONFIG)(np.zeros((1, *CONFIG.frame_shape), np.int16))
    assert all((values == 0).all() for values in made.values())
    with pytest.raises(InputError, match="expected 12 channels"):
        PublishedMaps(PRESETS["two-tx"])


def test_calibration_in_chirp_order_gives_tx2_and_tx3_each_others():
    factors = np.arange(1, 13)
    pairs = tuple((float(f), 0.0) for f in factors)
    config = CONFIG.model_copy(update={"channel_calibration": pairs})
    adc = np.zeros((1, *CONFIG.frame_shape), np.int16)
    adc[..., 0] = 1
    found = PublishedMaps(config).channels(adc)[0, 0, :, 0].real.numpy()
    # In firing order TX1, TX3, TX2; the vector is TX1, TX2, TX3.
    assert np.array_equal(found, factors)
    physical = config.calibration.real  # what TX3's samples ought to be multiplied with is its third row
    assert not np.array_equal(found[4:8], physical[2]) and np.array_equal(found[4:8], physical[1])


@pytest.mark.parametrize("azimuth", [-30, 0, 20])
def test_azimuth_is_where_the_axes_say(azimuth):
    """Of a target that moves just enough not to be taken for clutter."""
    adc = frames(point(2.0, azimuth), velocity=(0.08, 0, 0), count=5, noise=20)
    maker = PublishedMaps(CONFIG)
    made = maker(adc, frames=slice(4, None))
    for name, allowed in ((DOPPLER_LEVEL, 4), ("published_range_azimuth_5", 2.5), ("published_elevation_aware_5", 4)):
        columns = np.degrees(maker.axes(CONFIG, name).azimuths)
        row = made[name][0].max(axis=1).argmax()
        assert columns[0] * (-1 if name == DOPPLER_LEVEL else 1) < 0  # mirrored or ascending to the left
        assert columns[made[name][0][row].astype(float).argmax()] == pytest.approx(azimuth, abs=allowed)
    assert abs(made["published_range_azimuth_5"][0].max(axis=1).argmax() - 2.0 / CONFIG.range_resolution) < 1


@pytest.mark.parametrize("speed", [-0.9, 0.9])
def test_closing_is_down(speed):
    made = PublishedMaps(CONFIG)(frames(point(2.0, 0.0), (speed, 0, 0), 3, noise=20), frames=slice(2, None))
    axes = PublishedMaps.axes(CONFIG, DOPPLER_LEVEL)
    row = made[DOPPLER_LEVEL][0].max(axis=1).argmax()
    assert (row - axes.rows / 2 + 0.5) * axes.step == pytest.approx(-speed, abs=0.12)


def test_pauses_between_bursts_split_peaks():
    """At some speeds the three bursts come out of step, and one target reads as two beside where it should be."""
    maker, gap = PublishedMaps(CONFIG), CONFIG.frame_period - CONFIG.burst_time
    half = CONFIG.wavelength / 4  # out of step by half a turn after this way: opposite bursts
    shapes = []
    for speed in (2 * half / gap * 7, (2 * 7 + 1) * half / gap):
        # In the middle of the sweep, where the wavelength is the configuration's.
        slow = maker.channels(frames(point(2.5, 0.0), (speed, 0, 0), 3, noise=5))[:, :, 0, 48].reshape(96)
        power = np.abs(np.fft.fftshift(np.fft.ifft(slow.numpy(), 4096))) ** 2
        v = (np.arange(4096) - 2048) * 2 * CONFIG.max_velocity / 4096
        near = np.abs(v - speed) < 0.09
        peaks = (power[1:-1] > power[:-2]) & (power[1:-1] > power[2:]) & (power[1:-1] > 0.5 * power[near].max())
        shapes.append((v[1:-1][peaks & near[1:-1]] - speed).round(3))
    assert len(shapes[0]) == 1 and abs(shapes[0][0]) < 0.015
    assert len(shapes[1]) == 2 and np.abs(np.abs(shapes[1]) - 0.05).max() < 0.025


def test_area_weights_keep_means():
    weights = area_weights(182, 181)
    assert weights.shape == (181, 182) and np.allclose(weights.sum(axis=1), 1)
    assert np.allclose(weights.sum(axis=0), 181 / 182)
