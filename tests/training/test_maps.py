"""Maps for training: what they show, that stored and fresh ones agree, and their size."""

import numpy as np
import pytest
from walks import CONFIG, walk

from radarize.errors import InputError
from radarize.heatmaps import Heatmaps
from radarize.radar.presets import PRESETS
from radarize.recording import Recording
from radarize.training.maps import AZIMUTHS, FLOOR, MAPS, STEP, MapMaker, keep_maps, maps_of


def test_maps_are_the_heat_maps_in_rounded_decibels(tmp_path):
    with Recording(walk(tmp_path / "a.h5")) as recording:
        adc = recording.adc(0, 4)
    made, heatmaps = MapMaker(CONFIG)(adc), Heatmaps(CONFIG, AZIMUTHS)
    assert list(made) == list(MAPS)
    for name, power in (
        ("range_azimuth", heatmaps.range_azimuth(adc)),
        ("elevation_aware", heatmaps.elevation_aware(adc)),
        ("doppler_azimuth", heatmaps.doppler_azimuth(adc)),
        ("doppler_elevation_aware", heatmaps.doppler_azimuth_of(heatmaps.spectrum(adc), elevation_aware=True)),
    ):
        assert made[name].shape == power.shape == (4, *MapMaker(CONFIG).shape(name))
        assert made[name].dtype == np.float16
        assert np.abs(made[name] - 10 * np.log10(power.numpy())).max() <= STEP / 2 + 1e-4
    # The echo of 500 counts in bin 20, dead ahead.
    peak = np.unravel_index(made["range_azimuth"][0].argmax(), (96, 40))
    assert peak[0] == 20 and abs(AZIMUTHS[peak[1]]) < np.deg2rad(2)
    assert made["range_azimuth"][0].max() == pytest.approx(20 * np.log10(500), abs=0.5)


def test_columns_mirror_by_flipping_and_hold_the_whole_map():
    """A Bartlett map of 8 elements is a polynomial of degree 7 in exp(i pi sin azimuth): the columns determine it."""
    assert np.allclose(AZIMUTHS, -AZIMUTHS[::-1]) and len(AZIMUTHS) == 40
    rng = np.random.default_rng(1)
    x = rng.normal(size=(30, 8)) + 1j * rng.normal(size=(30, 8))

    def power(azimuth):
        return np.mean(np.abs(x @ np.exp(1j * np.pi * np.arange(8)[:, None] * np.sin(azimuth))) ** 2, axis=0)

    def basis(azimuth):
        return np.exp(1j * np.pi * np.arange(-7, 8) * np.sin(azimuth)[:, None])

    between = np.radians(np.arange(-58.0, 58.5, 0.5))
    weights, *_ = np.linalg.lstsq(basis(AZIMUTHS), power(AZIMUTHS), rcond=1e-9)
    assert (basis(between) @ weights).real == pytest.approx(power(between), rel=1e-6)


def test_lost_frames_read_the_floor():
    made = MapMaker(CONFIG)(np.zeros((1, *CONFIG.frame_shape), np.int16))
    assert all((values == FLOOR).all() for values in made.values())


def test_an_array_without_height_has_two_maps():
    assert MapMaker(PRESETS["two-tx"]).names == ("range_azimuth", "doppler_azimuth")


def test_stored_maps_equal_fresh_ones_and_truth_stays(tmp_path):
    raw, kept = walk(tmp_path / "a.h5"), tmp_path / "b.h5"
    assert keep_maps(raw, kept) == kept
    with Recording(raw) as a, Recording(kept) as b:
        assert len(a) == len(b) == 12 and np.array_equal(a.times, b.times) and a.config == b.config
        assert b.attributes["seed"] == 0 and not b.has("radar/adc")
        for name in ("truth/pose", "truth/scan", "truth/floor_plan", "imu/time"):
            assert np.array_equal(a.read(name), b.read(name))
            assert a.describe(name) == b.describe(name)
        maker = MapMaker(a.config)
        fresh, stored = (maps_of(r, 3, 7, tuple(MAPS), maker) for r in (a, b))
        for name in MAPS:
            assert np.abs(fresh[name] - stored[name]).max() <= STEP  # a value on the edge may round either way
            assert np.mean(fresh[name] != stored[name]) < 1e-3
        with pytest.raises(InputError, match="has no map capon; its array makes range_azimuth"):
            maps_of(b, 0, 1, ("capon",), maker)


def test_stored_maps_take_a_tenth(tmp_path):
    """Of compressed samples, on noise and few echoes, which compress worst."""
    config = PRESETS["radarize"]
    rng = np.random.default_rng(0)
    adc = rng.normal(0, 60, (8, *config.frame_shape)).astype(np.int16)
    from radarize.recording import RecordingWriter

    with RecordingWriter(tmp_path / "a.h5", config) as writer:
        writer.append(adc, np.arange(8) / 30)
    keep_maps(tmp_path / "a.h5", tmp_path / "b.h5")
    with Recording(tmp_path / "a.h5") as a, Recording(tmp_path / "b.h5") as b:
        samples = a.file["radar/adc"].id.get_storage_size()
        maps = sum(b.file[f"maps/{name}"].id.get_storage_size() for name in MAPS)
    assert maps < 0.11 * samples
