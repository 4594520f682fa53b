"""Firing orders: several transmitters simultaneously, several times per loop, in binary phase modulation, in a
subframe."""

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.array import azimuth_row, losses, tx_positions, virtual_positions
from radarize.radar.cfg import assumed_board, parse_cfg, remarks, write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import decode, encode
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from tests.echoes import record

PRESET = PRESETS["radarize"]
CHIRPS = "chirpCfg {0} {0} 0 0 0 0 0 {1}"


def text(*masks: int, loops: int = 8, extra: str = "") -> str:
    """A configuration whose chirps fire transmitters by these masks."""
    lines = [
        line
        for line in write_cfg(PRESET).splitlines()
        if not line.startswith(("chirpCfg", "frameCfg", "% Board", "% Platform"))
    ]
    at = next(k for k, line in enumerate(lines) if line.startswith("profileCfg")) + 1
    chirps = [CHIRPS.format(k, mask) for k, mask in enumerate(masks)]
    lines[at:at] = [*chirps, f"frameCfg 0 {len(masks) - 1} {loops} 0 33.333 1 0", *([extra] if extra else [])]
    return "\n".join(lines)


# --- several at once -------------------------------------------------------------------------------------------------
def test_transmitters_at_once_are_one_midway():
    config = parse_cfg(text(5))
    assert config.tx_order == config.tx == ((0, 2),) and config.frame_shape[:3] == (8, 1, 4)
    alone = tx_positions(PRESET)
    assert tx_positions(config) == pytest.approx(((alone[0] + alone[2]) / 2)[None])
    assert parse_cfg(write_cfg(config)) == config
    assert RadarConfig.model_validate_json(config.model_dump_json()) == config


def test_an_echo_of_two_at_once_has_the_phase_of_the_middle():
    """The sum of two plane waves has the phase of the midpoint, and an amplitude common to all receivers."""
    config, u = parse_cfg(text(3)), np.array([0.95, 0.2, 0.05])
    k = 2 * np.pi / config.wavelength
    both = np.exp(-1j * k * (virtual_positions(PRESET)[:2] @ u)).sum(axis=0)  # TX1 and TX2, per receiver
    one = np.exp(-1j * k * (virtual_positions(config)[0] @ u))
    ratio = both / one
    assert ratio == pytest.approx(np.full(4, ratio[0])) and abs(ratio[0].imag) < 1e-9


def test_losses_are_reported():
    assert losses(PRESET) == []
    assert "TX1 and TX2 fire at once" in losses(parse_cfg(text(3)))[0]
    assert "of 8 virtual antennas 4 are left" in losses(parse_cfg(text(3)))[0]
    assert "fire 4 chirps a loop" in losses(parse_cfg(text(1, 1, 4, 4)))[0]


# --- several times a loop --------------------------------------------------------------------------------------------
def test_several_chirps_of_a_transmitter_have_places_of_their_own():
    config = parse_cfg(text(4, 4, 1, 1))
    assert config.tx == (0, 0, 2, 2) and config.slot == (2, 3, 0, 1) and config.turn == (2, 3, 0, 1)
    assert len(azimuth_row(config)) == 8  # each place once
    assert config.max_velocity == pytest.approx(config.wavelength / (16 * config.chirp_time))
    assert parse_cfg(write_cfg(config)) == config
    words = np.arange(config.frame_bytes // 2, dtype=np.int16)
    assert np.array_equal(encode(decode(words, config), config), words)
    chirps = words.reshape(8, 4, 4, 48, 2, 2)  # TX3, TX3, TX1, TX1
    assert decode(words, config)[0, 0, 1, 0, 0, 1] == chirps[0, 3, 0, 0, 0, 0]


def test_orders_that_repeat_are_loops():
    assert parse_cfg(text(1, 4, 1, 4)).loops == 16
    assert parse_cfg(text(*[1] * 64, loops=2)).loops == 128
    with pytest.raises(InputError, match="has 66 chirps until its transmitters repeat, expected at most 64"):
        parse_cfg(text(*[1] * 65, 4, loops=1))


@pytest.mark.parametrize("masks", [(1, 4, 2), (1, 1, 4, 4, 2, 2), (2, 1, 1, 4)])
def test_an_echo_is_where_it_is_however_often_they_fire(masks):
    """TDM delays of each chirp are compensated: a closing point's azimuth is the same."""
    config = parse_cfg(text(*masks, loops=32)).model_copy(update={"frame_period": 0.1})
    point = 2.0 * np.array([[np.cos(0.35), np.sin(0.35), 0.0]])

    def pose(times):
        zero = np.zeros(times.shape)
        return np.stack([0.4 * times, zero, zero], axis=-1), zero

    frames = record(config, pose, point, np.array([3000.0]), np.zeros(1), np.random.default_rng(0))
    maps = Heatmaps(config)
    power = maps.range_azimuth(frames)[0]
    row, column = np.unravel_index(power.argmax(), power.shape)
    assert np.degrees(maps.azimuths[column]) == pytest.approx(np.degrees(0.35), abs=1)


# --- binary phase modulation -----------------------------------------------------------------------------------------
def modulated(config: RadarConfig, apart: np.ndarray) -> np.ndarray:
    """Received signal from echoes of each transmitter in each chirp (slot, tx)."""
    return np.stack([apart[0, :, 0] + apart[0, :, 1], apart[1, :, 0] - apart[1, :, 1]], axis=1)


@pytest.mark.parametrize("speed", [0.0, 0.4, -1.1])
def test_binary_phase_modulation_is_taken_apart(speed):
    """Against the closed form of a moving point's echo: as if each transmitter had fired alone, to -24 dB at any speed
    (the antennas' sidelobes are at -25 dB) and to rounding at rest."""
    config = parse_cfg(text(5, 5, loops=32, extra="bpmCfg -1 1 0 1"))
    assert config.tx_order == (0, 2) and config.bpm == (0, 1) and config.loops == 32
    assert parse_cfg(write_cfg(config)) == config and losses(config) == []
    loop, n = np.arange(32), np.arange(96)
    times = loop[:, None] * config.loop_time + np.arange(2) * config.chirp_time  # loop, slot
    phase = 4 * np.pi / config.wavelength * speed * times.T[:, :, None, None, None]
    u_y = 0.3
    antenna = -2 * np.pi / config.wavelength * u_y * virtual_positions(config)[..., 1]  # tx, rx
    beat = 2 * np.pi * 20 * n / 96
    echo = 2000 * np.exp(1j * (phase + antenna[None, None, :, :, None] + beat))  # slot, loop, tx, rx, sample
    sent = modulated(config, echo)  # loop, slot, rx, sample
    words = encode(np.stack([sent.real, sent.imag], axis=-1).round().astype(np.int16)[None],
                   config.model_copy(update={"bpm": None}))  # fmt: skip
    found = decode(words, config)
    alone = np.stack([echo[slot, :, slot] for slot in (0, 1)], axis=1)
    maps = Heatmaps(config)
    want = maps.spectrum(np.stack([alone.real, alone.imag], axis=-1).round().astype(np.int16)[None])
    error = maps.spectrum(found) - want
    assert 20 * np.log10(error.abs().max() / want.abs().max()) < (-24 if speed else -60)
    again = encode(found, config).astype(int) - words  # what is taken apart is put together again, to rounding
    assert np.abs(again).max() <= 3


def test_one_of_three_chirps_may_stand_between_the_two():
    """As in TI's people counting: TX1 and TX3 in the first and third chirp, TX2 alone in the second."""
    config = parse_cfg(text(5, 2, 5, extra="bpmCfg -1 1 0 2"))
    assert config.tx_order == (0, 1, 2) and config.bpm == (0, 2)
    assert parse_cfg(write_cfg(config)) == config


@pytest.mark.parametrize("line", ["bpmCfg -1 1 0 0", "bpmCfg -1 1 0 7", "bpmCfg -1 1 0 1"])
def test_modulation_of_other_chirps_is_refused(line):
    with pytest.raises(InputError, match="two chirps of the loop that fire the same two transmitters"):
        parse_cfg(text(5, 2, 5, extra=line))


# --- subframes -------------------------------------------------------------------------------------------------------
def advanced(subframes: int = 1, bursts: int = 1) -> str:
    lines = text(1, 4, 2).replace("dfeDataOutputMode 1", "dfeDataOutputMode 3").splitlines()
    lines = [line for line in lines if not line.startswith("frameCfg")]
    at = next(k for k, line in enumerate(lines) if line.startswith("lowPower"))
    lines[at:at] = [f"advFrameCfg {subframes} 0 0 1 0", f"subFrameCfg 0 0 0 3 8 33.333 0 {bursts} 1 33.333"]
    return "\n".join(lines)


def test_one_subframe_is_a_plain_frame():
    assert parse_cfg(advanced()) == parse_cfg(text(1, 4, 2))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"subframes": 2}, "numOfSubFrames is 2, expected 1 .advanced frames of a single subframe"),
        ({"bursts": 4}, "numOfBurst is 4, expected 1 .one burst a subframe"),
    ],
)
def test_several_subframes_or_bursts_are_refused(given, words):
    with pytest.raises(InputError, match=words):
        parse_cfg(advanced(**given))


# --- which board -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("line", "board", "remarked"),
    [
        ("", "iwr1843boost", True),
        ("% Platform:xWR18xx", "iwr1843boost", False),
        ("% Platform:xWR18xx_AOP", "awr1843aop", False),
        ("% Board:awr2243boost", "awr2243boost", False),
        ("% Platform:xWR14xx", "iwr1443boost", False),
    ],
)
def test_an_assumed_board_is_remarked(line, board, remarked):
    given = f"{line}\n{text(1, 4)}"
    config = parse_cfg(given)
    assert config.board == board
    assert remarks(given, config) == ([assumed_board(config)] if remarked else [])


def test_sixty_gigahertz_without_a_board():
    given = text(1, 4).replace("profileCfg 0 77 ", "profileCfg 0 60 ")
    config = parse_cfg("% Platform:xWR68xx\n" + given)  # on any of three boards
    assert config.board == "iwr6843isk"
    assert "iwr6843isk is assumed; --board" in remarks("% Platform:xWR68xx\n" + given, config)[0]
    assert parse_cfg("% Platform:xWR68xx_AOP\n" + given).board == "iwr6843aop"
