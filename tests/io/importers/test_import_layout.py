"""Words in another order than that of a DCA1000's two lanes: decoded correctly, and detected if the option is wrong."""

import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.importers.layout import LAYOUTS
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import encode
from tests.io.importers.test_import_bin import CONFIG, room

#: Real samples of the same chirps: twice as many, twice as often.
REAL = CONFIG.model_copy(update={"samples": 2 * CONFIG.samples, "sample_rate": 2 * CONFIG.sample_rate})


def interleaved(frames: np.ndarray, config: RadarConfig) -> bytes:
    """Write words as in the figure of SWRA581: for each sample I of all receivers, then Q of all."""
    words = []
    for frame in frames:
        for loop in frame:
            for chirp in loop[list(config.tx_order)]:
                for sample in range(chirp.shape[1]):
                    first, second = (1, 0) if config.iq_order == "qqii" else (0, 1)
                    words += [*chirp[:, sample, first], *chirp[:, sample, second]]
    return np.array(words, "<i2").tobytes()


def real(count: int, noise: float = 30.0) -> tuple[bytes, np.ndarray]:
    """Cosines of echoes, and complex exponentials of half their amplitude."""
    rng = np.random.default_rng(0)
    loops, tx, rx, samples, _ = CONFIG.frame_shape
    bins, gains = rng.integers(1, samples // 2, 6), 1000 * np.exp(2j * np.pi * rng.random((tx, rx, 6)))
    at = np.outer(bins, np.arange(2 * samples)) / (2 * samples)
    echoes = np.broadcast_to(gains @ np.exp(2j * np.pi * at), (count, loops, tx, rx, 2 * samples))
    heard = (echoes.real + noise * rng.normal(size=echoes.shape)).round().astype("<i2")
    return heard[:, :, list(CONFIG.tx_order)].tobytes(), echoes[..., ::2]


def imported(path, data: bytes, given: Given) -> tuple[np.ndarray, RadarConfig, str]:
    path.write_bytes(data)
    with Recording(import_recording(path, path.with_suffix(".h5"), given)) as recording:
        return recording.adc(0, len(recording)), recording.config, recording.attributes["warnings"]


@pytest.mark.parametrize("order", ["iiqq", "qqii"])
def test_interleaved_receivers(tmp_path, order):
    config = CONFIG.model_copy(update={"iq_order": order})
    frames = room(config, 2)
    given = Given(config, layout="interleaved")
    found, stored, warnings = imported(tmp_path / "a.bin", interleaved(frames, config), given)
    assert np.array_equal(found, frames) and stored == config and not warnings


def test_real_samples_become_the_exponentials_of_their_cosines(tmp_path):
    data, expected = real(2, noise=0.0)
    found, stored, warnings = imported(tmp_path / "a.bin", data, Given(REAL, layout="real"))
    assert stored == CONFIG.model_copy(update={"iq_order": "real"}) and not warnings
    assert np.abs(found @ [1, 1j] - expected).max() < 3  # of some thousand: rounding


def test_what_lies_otherwise_is_noticed(tmp_path):
    """Each layout decoded as each: a warning names the correct one, and only if another was used."""
    frames = room(CONFIG, 4)
    written = {"interleaved": interleaved(frames, CONFIG), "real": real(4)[0]}
    written["pairs"] = encode(frames, CONFIG).tobytes()
    for layout, data in written.items():
        for given in LAYOUTS:
            config = REAL if layout == "real" else CONFIG
            _, _, warnings = imported(tmp_path / "a.bin", data, Given(config, layout=given))
            assert (f"use --layout {layout}" in warnings) == (layout != given), (layout, given, warnings)
            assert "--layout" not in warnings or layout != given


def test_a_real_capture_is_told_from_itself_interleaved(recordings, tmp_path):
    with Recording(import_recording(recordings / "iwr6843-studio", tmp_path / "real.h5")) as recording:
        frames, config = recording.adc(0, 1), recording.config
        assert "--layout" not in recording.attributes["warnings"]
    _, _, warnings = imported(tmp_path / "a.bin", interleaved(frames, config), Given(config))
    assert "use --layout interleaved" in warnings


def test_only_raw_words_lie_somehow(tmp_path):
    np.save(tmp_path / "a.npy", room(CONFIG, 2))
    with pytest.raises(InputError, match="is no .bin, but layout is real, expected none"):
        import_recording(tmp_path / "a.npy", tmp_path / "a.h5", Given(CONFIG, layout="real"))
    odd = CONFIG.model_copy(update={"samples": 30})
    (tmp_path / "a.bin").write_bytes(bytes(10_000))
    with pytest.raises(InputError, match="samples is 30, expected a multiple of four real samples"):
        import_recording(tmp_path / "a.bin", tmp_path / "b.h5", Given(odd, layout="real"))
    refused = CliRunner().invoke(app, ["import", str(tmp_path / "a.bin"), "-o", "b.h5", "--layout", "x"])
    assert refused.exit_code == 2
