"""Low-power configurations (MMWAVE-L-SDK) and real samples, from lines of TI's own demos."""

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.cfg import parse_cfg, remarks, write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode, encode
from radarize.radar.limits import check_limits

#: Motion and presence detection on the xWRL6432BOOST.
PRESENCE = """
sensorStop 0
channelCfg 7 3 0
chirpComnCfg 8 0 0 256 1 28 0
chirpTimingCfg 6 63 0 75 60
frameCfg 2 0 200 64 250 0
antGeometryCfg 0 0 1 1 0 2 0 1 1 2 0 3 2.418 2.418
guiMonitor 2 3 0 0 0 1 0 0 1 1 1
sigProcChainCfg 32 2 3 2 8 8 1 0.3
cfarCfg 2 8 4 3 0 12.0 0 0.5 0 1 1 1
compRangeBiasAndRxChanPhase 0.0 1.00000 0.00000 -1.00000 0.00000 1.00000 0.00000 -1.00000 0.00000 1.00000 0.00000 -1.00000 0.00000
factoryCalibCfg 1 0 40 4 0x1ff000
sensorStart 0 0 0 0
"""  # noqa: E501
#: The visualizer's 4 x 4 TDM profile of the xWRL6844EVM.
SQUARE = """
sensorStop 0
channelCfg 153 255 0
chirpComnCfg 8 0 0 256 1 13.1 3
chirpTimingCfg 6 63 0 160 58
adcDataDitherCfg 1
frameCfg 64 0 1358 1 100 0
aoaProcCfg 64 64
factoryCalibCfg 1 0 44 2 0x1ff000
antGeometryBoard xWRL6844EVM
sensorStart 0 0 0 0
"""
#: A profile of the AWR294x's demo: real samples, frameCfg with eight values, sixteen pairs.
AWR2944 = """
% Platform:AWR294X
dfeDataOutputMode 1
channelCfg 15 15 0
adcCfg 2 0
adcbufCfg -1 1 1 1 1
profileCfg 0 77 267 7 57.14 0 0 70 1 512 11396 0 0 158
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 2
chirpCfg 2 2 0 0 0 0 0 4
chirpCfg 3 3 0 0 0 0 0 8
frameCfg 0 3 16 20 512 100 1 0
antGeometryCfg 1 0 1 1 1 2 1 3 0 2 0 3 0 4 0 5 1 4 1 5 1 6 1 7 1 8 1 9 1 10 1 11 0.5 0.8
compRangeBiasAndRxChanPhase 0.0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0
lvdsStreamCfg -1 0 1 0
"""


def test_values_of_a_presence_demo():
    config = parse_cfg(PRESENCE)
    assert config.board == "iwrl6432boost" and config.tx_order == (0, 1) and config.rx == (0, 1, 2)
    assert (config.samples, config.sample_rate, config.iq_order) == (128, 6.25e6, "real")  # of 256 at 12.5 MHz
    assert config.adc_start_time == pytest.approx(63 / 12.5e6)
    assert config.start_frequency == 60e9 and config.slope == 75e12
    assert config.loops == 64 and config.frame_period == 0.25
    assert config.loop_time == pytest.approx(200e-6) and config.chirp_time == pytest.approx(34e-6)
    assert config.max_velocity == pytest.approx(config.wavelength / (4 * 200e-6))
    assert np.diff(config.chirp_times, axis=0) == pytest.approx(200e-6)
    assert np.diff(config.chirp_times, axis=1) == pytest.approx(34e-6)
    assert (config.rx_gain_db, config.tx_backoff_db) == (40, 4)
    assert config.channel_calibration is None  # what the board's reversed feeds are
    assert config.range_resolution == pytest.approx(299792458 / (2 * 75e12 * 256 / 12.5e6))
    check_limits(config)
    assert parse_cfg(write_cfg(config)) == config
    assert RadarConfig.model_validate_json(config.model_dump_json()) == config


def test_values_of_the_square():
    config = parse_cfg(SQUARE)
    assert config.board == "awrl6844evm" and config.tx_order == config.rx == (0, 1, 2, 3)
    assert (config.samples, config.sample_rate) == (128, 12.5e6)  # of 256 at 25 MHz
    assert (config.loops, config.loop_idle_time) == (16, 0)  # 64 chirps in one burst
    check_limits(config)
    assert remarks(SQUARE, config) == []  # the board is named
    assert "iwrl6432boost is assumed" in remarks(PRESENCE, parse_cfg(PRESENCE))[0]


def test_one_transmitter_or_receiver_less():
    config = parse_cfg(
        SQUARE.replace("153 255", "17 207").replace("frameCfg 64", "frameCfg 48")
    )  # RX1 and RX3; TX3 off
    assert config.rx == (0, 2) and config.tx_order == (0, 1, 3)


def test_binary_phase_modulation():
    config = parse_cfg(PRESENCE.replace("256 1 28", "256 4 28"))
    assert config.tx_order == (0, 1) and config.bpm == (0, 1)
    assert parse_cfg(PRESENCE.replace("256 1 28", "256 0 28").replace("frameCfg 2", "frameCfg 1")).tx == ((0, 1),)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("chirpTimingCfg 6", "% chirpTimingCfg 6", "has no chirpTimingCfg line"),
        ("frameCfg 2 0 200", "frameCfg 2 8 200", "numOfChirpsAccum is 8, expected 0 or 1 .no chirps summed"),
        ("frameCfg 2 0 200", "frameCfg 3 0 200", "numOfChirpsInBurst is 3, expected a multiple of the 2 chirps"),
        ("frameCfg 2 0 200", "frameCfg 8 0 600", "numOfChirpsInBurst is 8, expected 2, one loop a burst"),
        ("frameCfg 2 0 200", "frameCfg 2 0 60", "burstPeriodicity is 60, expected at least the 68 us"),
        ("frameCfg 2 0 200 64 250 0", "frameCfg 0 2 32 0 33.333 1 0", "frameCfg has 7 values, expected 6"),
        ("256 1 28", "256 3 28", "chirpTxMimoPatSel is 3, expected 0 or 1 or 4"),
        ("sensorStop 0", "% Board:iwr6843isk", "is a low-power configuration, but its board iwr6843isk has an iwr6843"),
        ("antGeometryCfg", "chirpTimmingCfg", "unknown command chirpTimmingCfg, expected chirpTimingCfg"),
    ],
)
def test_what_is_not_covered_is_named(old, new, words):
    assert old in PRESENCE
    with pytest.raises(InputError, match=words):
        parse_cfg(PRESENCE.replace(old, new, 1), "a.cfg")


def test_bursts_back_to_back_are_one():
    assert parse_cfg(PRESENCE.replace("frameCfg 2 0 200 64", "frameCfg 8 0 272 16")).loops == 64


def test_the_awr2944():
    config = parse_cfg(AWR2944)
    assert config.board == "awr2944evm" and config.tx_order == (0, 1, 2, 3) and config.iq_order == "real"
    assert (config.samples, config.sample_rate, config.loops, config.frame_period) == (256, 5.698e6, 16, 0.1)
    check_limits(config, demo=True)
    assert parse_cfg(write_cfg(config)) == config and remarks(AWR2944, config) == []


def test_real_samples_are_made_complex():
    """A tone of known beat frequency: its complex samples have the same beat at half the rate."""
    config = parse_cfg(AWR2944).model_copy(update={"loops": 1})
    n, beat = np.arange(512), 37 / 512
    real = 1000 * np.cos(2 * np.pi * beat * n + 0.7)
    words = np.broadcast_to(real.round(), (1, 4, 4, 512)).astype(np.int16).ravel()
    found = decode(words, config)
    tone = 1000 * np.exp(1j * (2 * np.pi * beat * n[::2] + 0.7))
    assert found.shape == (1, *config.frame_shape)
    assert np.abs(found[..., 0] + 1j * found[..., 1] - tone).max() < 2
    assert np.abs(encode(found, config).astype(int) - words).max() <= 2
