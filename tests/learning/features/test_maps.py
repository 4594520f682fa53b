"""Maps for training: content, agreement of stored and computed ones, and size."""

import numpy as np
import pytest
import torch

from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.learning.features.keeping import keep_maps
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Signal
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.maps import AZIMUTHS, FLOOR, MAPS, STEP, MapMaker, maps_of
from tests.batches import of_spectrum
from tests.learning.training.walks import CONFIG, walk


def test_maps_are_the_heat_maps_in_rounded_decibels(tmp_path):
    with Recording(walk(tmp_path / "a.h5")) as recording:
        adc = recording.adc(0, 4)
    made, heatmaps = MapMaker(CONFIG)(adc), Heatmaps(CONFIG, AZIMUTHS)
    assert list(made) == list(MAPS)
    limited = heatmaps.limited(heatmaps.spectrum(adc))
    for name, power in (
        ("range_azimuth", heatmaps.range_azimuth(adc, method="capon")),
        ("elevation_aware", heatmaps.elevation_aware(adc)),
        ("doppler_azimuth", heatmaps.doppler_azimuth_of(limited, "capon")),
        ("doppler_elevation_aware", heatmaps.doppler_azimuth_of(limited, elevation_aware=True)),
    ):
        assert made[name].shape == power.shape == (4, *MapMaker(CONFIG).shape(name))
        assert made[name].dtype == np.float16
        assert np.abs(made[name] - 10 * np.log10(power.numpy())).max() <= STEP / 2 + 1e-4
    # The echo of 500 counts in bin 20, dead ahead.
    peak = np.unravel_index(made["range_azimuth"][0].argmax(), (96, 80))
    assert peak[0] == 20 and abs(AZIMUTHS[peak[1]]) < np.deg2rad(2)
    # Half a column beside it, Capon's ridge has fallen by some dB.
    assert 20 * np.log10(500) - 8 < made["range_azimuth"][0].max() < 20 * np.log10(500)


def test_columns_mirror_by_flipping():
    assert np.allclose(AZIMUTHS, -AZIMUTHS[::-1]) and len(AZIMUTHS) == 80


def test_no_flash_drowns_the_ridge():
    """An echo 60 dB above another one at its own speed is limited to 20 dB above it, and the weak one is visible."""
    heatmaps = Heatmaps(PRESETS["radarize"], AZIMUTHS)
    rng = np.random.default_rng(0)
    noise = rng.normal(size=(1, 96, 32, 12, 2)) / np.sqrt(2)
    spectrum = torch.view_as_complex(torch.tensor(noise)).to(torch.complex64)
    spectrum[0, 20, 20, :] += 1e5
    spectrum[0, 40, 10, :] += 1e2
    power = heatmaps.limited(spectrum).abs().square().sum(dim=-1)[0]
    floor = spectrum.abs().square().sum(dim=-1).median()
    assert 10 * torch.log10(power[20, 20] / floor) == pytest.approx(10 * np.log10(300), abs=0.1)
    assert 10 * torch.log10(power[20, 20] / power[40, 10]) < 2
    angles = torch.angle(heatmaps.limited(spectrum)) - torch.angle(spectrum)
    assert angles.abs().max() < 1e-5


def test_maps_of_a_batch_are_made_once(tmp_path, monkeypatch):
    """Only requested maps are computed, on first access."""
    with Recording(walk(tmp_path / "a.h5")) as recording:
        adc = recording.adc(0, 4)
    signal, made, of = Signal(CONFIG), [], MapMaker.of
    monkeypatch.setattr(MapMaker, "of", lambda self, spectrum, names: made.append(names) or of(self, spectrum, names))
    spectra = [signal.heatmaps.spectrum(adc[k : k + 2]) for k in (0, 2)]
    one, other = (of_spectrum(signal, spectrum, np.arange(2)) for spectrum in spectra)
    first = one.maps(("range_azimuth",))["range_azimuth"]
    names = ("elevation_aware", "range_azimuth")
    both = one.maps(names)
    assert tuple(both) == names and both["range_azimuth"] is first
    assert made == [("range_azimuth",), ("elevation_aware",)]
    assert np.array_equal(first, of(signal.maker, spectra[0], ("range_azimuth",))["range_azimuth"])
    assert not np.array_equal(other.maps(("range_azimuth",))["range_azimuth"], first)
    assert one.maps(("range_azimuth",))["range_azimuth"] is first and len(made) == 3


def test_lost_frames_read_the_floor():
    made = MapMaker(CONFIG)(np.zeros((1, *CONFIG.frame_shape), np.int16))
    assert all((values == FLOOR).all() for values in made.values())


def test_an_array_without_height_sees_its_row_by_bartlett():
    config = PRESETS["two-tx"]
    adc = np.random.default_rng(0).integers(-500, 500, (1, *config.frame_shape)).astype(np.int16)
    made, heatmaps = MapMaker(config)(adc), Heatmaps(config, AZIMUTHS)
    assert tuple(made) == tuple(MAPS)
    wanted = 10 * np.log10(heatmaps.range_azimuth(adc).numpy())
    assert np.abs(made["elevation_aware"] - wanted).max() <= STEP


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
    """Size relative to compressed samples, for noise and few echoes, which compress worst."""
    config = PRESETS["radarize"]
    rng = np.random.default_rng(0)
    adc = rng.normal(0, 60, (8, *config.frame_shape)).astype(np.int16)
    with RecordingWriter(tmp_path / "a.h5", config) as writer:
        writer.append(adc, np.arange(8) / 30)
    keep_maps(tmp_path / "a.h5", tmp_path / "b.h5")
    with Recording(tmp_path / "a.h5") as a, Recording(tmp_path / "b.h5") as b:
        samples = a.file["radar/adc"].id.get_storage_size()
        maps = sum(b.file[f"maps/{name}"].id.get_storage_size() for name in MAPS)
    assert maps < 0.11 * samples
