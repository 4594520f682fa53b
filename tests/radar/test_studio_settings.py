import json

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.boards import BOARDS
from radarize.radar.presets import load_config
from radarize.radar.studio import parse_studio


@pytest.fixture
def settings(recordings) -> dict:
    return json.loads((recordings / "iwr6843-studio" / "mmwaveDevice.mmwave.json").read_text())


def test_the_public_capture(recordings):
    config, text = load_config(recordings / "iwr6843-studio" / "mmwaveDevice.mmwave.json")
    assert "mmWaveStudio" in text
    assert config.board == "iwr6843isk"
    assert config.start_frequency == pytest.approx(60e9)
    assert config.slope == pytest.approx(29.837e12, rel=1e-6)
    assert (config.idle_time, config.adc_start_time, config.ramp_end_time) == (280e-6, 6e-6, 134e-6)
    assert config.frame_shape == (85, 3, 4, 512, 2)
    assert (config.sample_rate, config.frame_period) == (4e6, 0.15)
    assert config.tx_order == (0, 1, 2)
    assert config.iq_order == "iiqq"
    assert config.rx_gain_db == 30
    assert config.range_resolution == pytest.approx(0.0393, abs=1e-4)


@pytest.mark.parametrize(
    "device, board", [("iwr6843", "isk"), ("iwr6843AOP", "aop"), ("IWR6843-ODS", "ods"), ("", "isk")]
)
def test_board_and_its_reversed_feeds(settings, device, board):
    config = parse_studio(json.dumps(settings), device=device)
    assert config.board == "iwr6843" + board
    assert np.array_equal(config.calibration.real, np.tile(BOARDS[config.board].rx_sign, (3, 1)))


def _at(settings: dict, path: str) -> tuple[dict, str]:
    *parents, last = path.split("/")
    node = settings["mmWaveDevices"][0]
    for key in parents:
        node = node[int(key)] if key.isdigit() else node[key]
    return node, last


@pytest.mark.parametrize(
    "path, value, message",
    [
        ("rfConfig/waveformType", "advancedFrameChirp", "waveformType is advancedFrameChirp"),
        ("rfConfig/rlAdcOutCfg_t/fmt/b2AdcOutFmt", 2, "b2AdcOutFmt is 2, expected 0 or 1"),
        ("rfConfig/rlChanCfg_t/rxChannelEn", "0x0", "rx"),
        ("rfConfig/rlChirps/1/rlChirpCfg_t/txEnable", "0x0", "txEnable is 0, expected a transmitter"),
        ("rfConfig/rlChirps/1/rlChirpCfg_t/idleTimeVar_usec", 0.5, "idleTimeVar_usec is 0.5"),
        ("rfConfig/rlChirps/1/rlChirpCfg_t/profileId", 1, "one defined profile"),
        ("rfConfig/rlFrameCfg_t/chirpEndIdx", 3, "chirp 3 has none"),
        ("rfConfig/rlFrameCfg_t/numLoops", "many", "numLoops is many, expected a whole number"),
        ("rfConfig/rlProfiles/0/rlProfileCfg_t/digOutSampleRate", None, "digOutSampleRate is None, expected a number"),
        ("rfConfig/rlProfiles", [], "rlProfiles is []"),
        ("rfConfig", 7, "rfConfig is '7', expected an object"),
        ("rawDataCaptureConfig/rlDevLaneEnable_t/laneEn", "0xF", "two LVDS lanes"),
        ("rawDataCaptureConfig/rlDevDataFmtCfg_t/chInterleave", 0, "chInterleave is 0"),
    ],
)
def test_refusals_name_the_field(settings, path, value, message):
    node, key = _at(settings, path)
    node[int(key) if key.isdigit() else key] = value
    with pytest.raises(InputError) as error:
        parse_studio(json.dumps(settings), name="a.mmwave.json")
    assert message in str(error.value) and "a.mmwave.json" in str(error.value)


def test_single_entries_may_stand_without_a_list(settings):
    """Some programs write a list of one as its entry."""
    expected = parse_studio(json.dumps(settings))
    rf = settings["mmWaveDevices"][0]["rfConfig"]
    rf["rlProfiles"] = rf["rlProfiles"][0]
    settings["mmWaveDevices"] = settings["mmWaveDevices"][0]
    assert parse_studio(json.dumps(settings)) == expected
    del rf["rlProfiles"]["rlProfileCfg_t"]["rxGain_dB"]
    with pytest.raises(InputError, match=r"has no mmWaveDevices\.rfConfig\.rlProfiles\.rlProfileCfg_t\.rxGain_dB"):
        parse_studio(json.dumps(settings))


def test_transmitters_in_any_order(settings):
    """TX2, TX1, TX3: masks 2, 1, 4."""
    for chirp, mask in zip(settings["mmWaveDevices"][0]["rfConfig"]["rlChirps"], ("0x2", "0x1", 4), strict=False):
        chirp["rlChirpCfg_t"]["txEnable"] = mask
    assert parse_studio(json.dumps(settings)).tx_order == (1, 0, 2)


def test_a_missing_field_is_named(settings):
    node, key = _at(settings, "rfConfig/rlFrameCfg_t/numLoops")
    del node[key]
    with pytest.raises(InputError, match="rlFrameCfg_t.numLoops"):
        parse_studio(json.dumps(settings))


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "3", '{"mmWaveDevices": []}', '{"mmWaveDevices": {}}', "{}", "[" * 100000]
)
def test_garbage(text):
    with pytest.raises(InputError):
        parse_studio(text)
