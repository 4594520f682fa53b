"""Captures of other boards: assumed boards, and real samples."""

import numpy as np
import pytest

from radarize.io.importers import import_recording
from radarize.io.importers.parameters import Given
from radarize.io.load import load
from radarize.io.recording import Recording
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.dca1000 import decode, encode
from radarize.radar.presets import PRESETS
from tests.echoes import record
from tests.radar.test_firing import text
from tests.radar.test_lowpower import AWR2944, PRESENCE

SIXTY = text(1, 4).replace("profileCfg 0 77 ", "profileCfg 0 60 ")


def capture(folder, commands: str):
    """A .bin of three frames of a point 20 deg to the left, beside its .cfg."""
    config = parse_cfg(commands)

    def pose(times):
        zero = np.zeros(times.shape)
        return np.stack([zero, zero, zero], axis=-1), zero

    point = 1.5 * np.array([[np.cos(0.35), np.sin(0.35), 0.0]])
    frames = record(config, pose, point, np.array([3000.0]), np.arange(3) * config.frame_period,
                    np.random.default_rng(0), 3.0)  # fmt: skip
    (folder / "a.cfg").write_text(commands)
    (folder / "a.bin").write_bytes(encode(frames, config).tobytes())
    return folder / "a.bin", config, frames


def warnings(recording: Recording) -> str:
    return str(recording.attributes["warnings"])


def test_an_assumed_board_is_said(tmp_path):
    source, _, _ = capture(tmp_path, SIXTY)
    with Recording(import_recording(source, tmp_path / "a.h5")) as recording:
        assert recording.config.board == "iwr6843isk"
        assert warnings(recording).count("iwr6843isk is assumed; --board") == 1
    for given in ({"board": "iwr6843aop"}, {"board": "iwr6843isk"}):
        with load(source, **given) as recording:
            assert recording.config.board == given["board"] and warnings(recording) == ""
    (tmp_path / "a.cfg").write_text("% Platform:xWR68xx_AOP\n" + SIXTY)
    with load(source) as recording:
        assert recording.config.board == "iwr6843aop" and warnings(recording) == ""


def test_a_board_of_another_band_is_remarked(tmp_path):
    source, _, _ = capture(tmp_path, SIXTY)
    for given in ({"board": "iwr1843boost"}, {"config": parse_cfg("% Platform:xWR18xx\n" + SIXTY)}):
        with load(source, **given) as recording:
            assert "chirps start at 60 GHz, but the iwr1843boost has 76-78 GHz or 77-81 GHz" in warnings(recording)
            assert "--board sets another one" in warnings(recording)


def test_without_any_configuration(tmp_path):
    source, config, _ = capture(tmp_path, SIXTY)
    (tmp_path / "a.cfg").unlink()
    with load(source, samples=96, loops=8, rx=4, tx=2, start_frequency=60e9) as recording:
        assert recording.config.board == "iwr6843isk"
        assert "iwr6843isk is assumed" in warnings(recording)
    with load(source, config=PRESETS["two-tx"], loops=8) as recording:  # which names its board
        assert "is assumed" not in warnings(recording)


def test_what_is_lost_is_in_the_recording(tmp_path):
    source, _, _ = capture(tmp_path, "% Board:iwr1843boost\n" + text(1, 1, 4, 4))
    with load(source) as recording:
        assert warnings(recording).startswith("transmitters fire 4 chirps a loop")
        assert recording.adc(0, 1).shape == (1, 8, 4, 4, 96, 2)


@pytest.mark.parametrize("commands", [AWR2944, PRESENCE, PRESENCE.replace("256 1 28", "256 4 28")])
def test_captures_of_real_samples(tmp_path, commands):
    """The configuration determines it: no option is needed."""
    source, config, frames = capture(tmp_path, commands)
    with load(source) as recording:
        assert recording.config == config and "layout" not in warnings(recording)
        error = recording.adc(0, 3).astype(float) - frames
        error[..., 1] -= error[..., 1].mean(axis=-1, keepdims=True)  # a real converter has no offset of Q
        assert np.abs(error).max() <= 3
        # What is exported is read again.
        words = encode(recording.adc(0, 3), config)
        assert np.abs(decode(words, parse_cfg(write_cfg(config))).astype(int) - recording.adc(0, 3)).max() <= 3


def test_given_radars_are_not_doubted(tmp_path):
    source, config, _ = capture(tmp_path, SIXTY)
    (tmp_path / "a.cfg").unlink()
    with Recording(import_recording(source, tmp_path / "b.h5", Given(config))) as recording:
        assert warnings(recording) == ""
