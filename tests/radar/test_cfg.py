import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarize.io.errors import InputError
from radarize.radar.boards import BOARDS
from radarize.radar.boards.chips import CHIPS
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.config import HIGH_PASS_1, HIGH_PASS_2, RadarConfig
from radarize.radar.presets import PRESETS, load_config

PAPER = """
% the paper's 1843_v1
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg -1 0 1 1 1
profileCfg 0 77 122 7 50 0 0 80 1 96 2285 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 4
chirpCfg 2 2 0 0 0 0 0 2
frameCfg 0 2 32 0 33.333 1 0
lvdsStreamCfg -1 0 1 0
compRangeBiasAndRxChanPhase 0.0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0 1 0
"""


def test_the_papers_file_is_the_preset():
    assert parse_cfg(PAPER) == PRESETS["radarize"]


def test_every_public_file_parses_and_survives_writing(recordings):
    files = sorted(recordings.rglob("*.cfg"))
    assert len(files) == 4
    for path in files:
        config, text = load_config(path)
        assert text == path.read_text()
        assert parse_cfg(write_cfg(config)) == config


def test_values_of_a_public_file(recordings):
    config, _ = load_config(recordings / "configs" / "xwr_raw_ros_1843_range_v0.cfg")
    assert config.start_frequency == 77e9
    assert config.slope == 65e12
    assert (config.idle_time, config.adc_start_time, config.ramp_end_time) == (60e-6, 7e-6, 61.54e-6)
    assert (config.samples, config.sample_rate, config.loops) == (112, 2.091e6, 20)
    assert config.frame_period == 33e-3
    assert config.tx_order == (0, 2, 1) and config.slot == (0, 2, 1)
    assert config.rx == (0, 1, 2, 3)
    assert config.iq_order == "qqii"
    assert config.range_resolution == pytest.approx(0.043, abs=5e-4)  # as in the file's comment
    doppler, _ = load_config(recordings / "configs" / "xwr_raw_ros_1843_doppler_v0.cfg")
    assert doppler.tx == (0, 2)


@pytest.mark.parametrize("name", PRESETS)
def test_presets_by_name(name):
    config, text = load_config(name)
    assert config == PRESETS[name] == parse_cfg(text)


positive = st.floats(1e-6, 1e-3)


@st.composite
def configs(draw) -> RadarConfig:
    adc_start, samples, rate = draw(st.floats(0, 20e-6)), draw(st.integers(1, 1024)), draw(st.floats(2e6, 12.5e6))
    ramp = adc_start + samples / rate + draw(positive)
    idle, loops = draw(positive), draw(st.integers(1, 255))
    pause = draw(st.sampled_from((0.0, 135e-6)))
    board = BOARDS[draw(st.sampled_from(sorted(BOARDS)))]
    tx, rx, unit = len(board.tx), len(board.rx), st.floats(-2, 2)
    order = draw(st.permutations(range(tx)))[: draw(st.integers(1, tx))]
    return RadarConfig(
        board=board.name,
        start_frequency=draw(st.floats(*CHIPS[board.chip].bands[0])),
        slope=draw(st.floats(1e12, 250e12)),
        idle_time=idle,
        adc_start_time=adc_start,
        ramp_end_time=ramp,
        samples=samples,
        sample_rate=rate,
        loops=loops,
        frame_period=((idle + ramp) * len(order) + pause) * loops * draw(st.floats(1, 3)),
        loop_idle_time=pause,
        tx_order=order,
        rx=tuple(sorted(draw(st.sets(st.integers(0, rx - 1), min_size=1)))),
        rx_gain_db=draw(st.integers(0, 63)),
        tx_backoff_db=draw(st.integers(0, 30)),
        high_pass=(draw(st.sampled_from(HIGH_PASS_1)), draw(st.sampled_from(HIGH_PASS_2))),
        iq_order=draw(st.sampled_from(("iiqq", "qqii", "real"))),
        range_bias=draw(st.floats(-1, 1)),
        channel_calibration=tuple((draw(unit), draw(unit)) for _ in range(tx * rx)),
    )


@settings(max_examples=60, deadline=None)
@given(configs())
def test_round_trip(config):
    assert parse_cfg(write_cfg(config)) == config


def test_one_transmitter_in_many_chirps_counts_as_loops():
    text = PAPER.replace("chirpCfg 0 0 0 0 0 0 0 1", "chirpCfg 0 15 0 0 0 0 0 1").replace(
        "frameCfg 0 2", "frameCfg 0 15"
    )
    text = text.replace("chirpCfg 1 1 0 0 0 0 0 4\n", "").replace("chirpCfg 2 2 0 0 0 0 0 2\n", "")
    text = text.replace(" 32 0 33.333", " 2 0 33.333")
    config = parse_cfg(text)
    assert config.tx_order == (0,) and config.loops == 32


def test_calibration_is_by_physical_transmitter():
    pairs = " ".join(f"{i} {-i}" for i in range(12))
    text = PAPER.replace("0.0 " + "1 0 " * 11 + "1 0", "0.25 " + pairs)
    config = parse_cfg(text)
    assert config.range_bias == 0.25
    assert config.calibration[1, 0] == 4 - 4j  # TX2, though it fires last


def test_reversed_feeds_of_people_counting_files():
    text = PAPER.replace(" 77 122", " 60 122") + "antPhaseRot 1 -1 -1 1 1 -1 -1 1 1 -1 -1 1\n"
    config = parse_cfg("% Platform:xWR68xx_ODS\n" + text)
    assert config.board == "iwr6843ods"
    assert config.channel_calibration is None  # as the board has it
    assert np.array_equal(config.calibration.real, np.tile(BOARDS["iwr6843ods"].rx_sign, (3, 1)))


def test_rf_gain_target_bits_are_not_gain():
    assert parse_cfg(PAPER.replace(" 0 0 30\n", " 0 0 158\n")).rx_gain_db == 30


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("adcCfg 2 1", "adcCfg 2 3", "line 5: adcCfg adcOutputFmt is 3, expected 0 or 1"),
        ("adcCfg 2 1", "adcCfg 2 0", "line 6: adcbufCfg adcOutputFmt is 0, expected 1 (real samples"),
        ("adcCfg 2 1", "adcCfg 1 1", "numADCBits is 1"),
        ("adcbufCfg -1 0 1 1 1", "adcbufCfg -1 1 1 1 1", "adcbufCfg adcOutputFmt is 1, expected 0"),
        ("adcbufCfg -1 0 1 1 1", "adcbufCfg -1 0 1 0 1", "ChanInterleave is 0"),
        ("0 0 0 0 0 4", "0 0 0 0 0 0", "line 9: chirpCfg txEnable is 0, expected a transmitter at least"),
        ("0 0 0 0 0 4", "0 0 0 0 0 9", "line 9: chirpCfg txEnable is 9, expected transmitters that channelCfg"),
        ("channelCfg 15 7 0", "channelCfg 15 5 0", "chirpCfg txEnable is 2"),
        ("channelCfg 15 7 0", "channelCfg 0 7 0", "rxChannelEn is 0"),
        ("channelCfg 15 7 0", "channelCfg 15 7", "line 4: channelCfg has 2 values, expected 3"),
        ("chirpCfg 1 1 0", "chirpCfg 1 1 1", "profileId is 1, expected 0"),
        ("chirpCfg 1 1 0 0 0", "chirpCfg 1 1 0 0 0.1", "freqSlopeVar is 0.1, expected 0"),
        ("chirpCfg 1 1", "chirpCfg 3 3", "chirp 1 has none"),
        ("profileCfg 0", "profileCfg 1", "expected the number of a profileCfg line"),
        ("dfeDataOutputMode 1", "dfeDataOutputMode 3", "dfeDataOutputMode mode is 3"),
        ("frameCfg 0 2 32", "frameCfg 0 2 zwei", "line 11: frameCfg numLoops is zwei, expected a number"),
        ("frameCfg 0 2 32", "frameCfg 0 2 nan", "expected a finite number"),
        ("frameCfg 0 2 32", "frameCfg 0 2 3.5", "expected a whole number"),
        ("33.333", "3.3", "frame_period is 3.300 ms"),
        ("96 2285", "960 2285", "the ADC window ends"),
        ("7 50 0 0 80 1", "7 50 0 0 -80 1", "slope is -80"),
        ("7 50 0 0", "7 50 0 4", "txPhaseShifter is 4"),
        ("7 50 0 0", "7 50 1 0", "txOutPower is 1, expected the same"),
        ("lvdsStreamCfg -1 0 1 0", "lvdsStreamCfg -1 1 1 0", "enableHeader is 1"),
        ("lvdsStreamCfg -1 0 1 0", "bpmCfg -1 1 0 1", "bpmCfg isEnabled is 1, expected 0, or two chirps"),
        ("lvdsStreamCfg -1 0 1 0", "advFrameCfg 2 0 0 1 0", "advanced frames"),
        ("frameCfg 0 2 32 0 33.333 1 0", "frameCfg 2 0 403 64 250 0", "has the 6 values of a low-power chip"),
        ("lvdsStreamCfg -1 0 1 0", "frameCgf 0 2 32 0 33 1 0", "unknown command frameCgf, expected frameCfg"),
        ("lvdsStreamCfg -1 0 1 0", "{}", "line 12: starts with '{}'"),
        ("profileCfg 0 77", "% profileCfg 0 77", "has no profileCfg line"),
    ],
)
def test_refusals_name_line_field_and_value(old, new, message):
    assert old in PAPER
    with pytest.raises(InputError) as error:
        parse_cfg(PAPER.replace(old, new, 1), name="radar.cfg")
    assert message in str(error.value)
    assert str(error.value).startswith("radar.cfg")
    assert "\n" not in str(error.value)


@settings(max_examples=100, deadline=None)
@given(st.text(max_size=200))
def test_garbage_is_refused_in_one_sentence(text):
    with pytest.raises(InputError):
        parse_cfg(text)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_any_damaged_word_is_refused_or_gives_a_valid_configuration(data):
    words = PAPER.split(" ")
    at = data.draw(st.integers(0, len(words) - 1))
    words[at] = data.draw(
        st.sampled_from(["", "-1", "1e999", "nan", "0x10", "999999999999", "1.5", "-0", "1_0", "\x00"])
    )
    try:
        config = parse_cfg(" ".join(words))
    except InputError:
        return
    assert config.frame_bytes > 0


def test_files_that_are_no_configuration(tmp_path):
    binary = tmp_path / "radar.cfg"
    binary.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(InputError, match="binary data"):
        load_config(binary)
    with pytest.raises(InputError, match="no such radar configuration.*radarize"):
        load_config(tmp_path / "missing.cfg")


@pytest.mark.parametrize("field, value", [("rx_gain_db", 30.5), ("tx_backoff_db", -1.0), ("high_pass", (1e3, 350e3))])
def test_what_has_no_code_is_not_written(field, value):
    with pytest.raises(InputError, match=field):
        write_cfg(PRESETS["radarize"].model_copy(update={field: value}))
