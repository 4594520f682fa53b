"""Configurations of TI's low-power chips (xWRL6432, xWRL6844): the commands of the MMWAVE-L-SDK's demos.

A frame is bursts of chirps; the transmitters alternate from chirp to chirp (TDM), or two use binary phase
modulation. Samples are real, at half the rate of complex ones of the same range.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from radarize.io.errors import InputError
from radarize.radar.boards import load_board
from radarize.radar.commands import Command
from radarize.radar.config import Firing, RadarConfig

#: Commands that identify such a configuration.
COMMANDS = {"chirpComnCfg", "chirpTimingCfg"}
_REQUIRED = ("channelCfg", "chirpComnCfg", "chirpTimingCfg", "frameCfg")
#: High-pass corners (Hz) of `chirpRxHpfSel`: 175, 350, 700 and 1400 kHz of one second-order filter, as two
#: first-order stages like those of the SDK's other codes.
_HIGH_PASS = ((175e3, 350e3), (350e3, 350e3), (700e3, 700e3), (700e3, 1.4e6))
#: s; resolution of a burst's period.
_ROUNDED = 0.5e-6


class _Masks(NamedTuple):
    """Units of a chip's commands: rate of real samples at a divider of 1, Hz; bits of the receivers, and of each
    transmitter (all of them set if it is enabled)."""

    clock: float
    rx: tuple[int, ...]
    tx: tuple[int, ...]


#: `channelCfg 7 3` enables all of an xWRL6432, `channelCfg 153 255` all of an xWRL6844 (two bits a transmitter).
_CHIPS = {
    "iwrl6432": _Masks(100e6, (0x1, 0x2, 0x4), (0x1, 0x2)),
    "awrl6844": _Masks(200e6, (0x01, 0x08, 0x10, 0x80), (0x03, 0x0C, 0x30, 0xC0)),
}


def parse_low_power(last: Mapping[str, Command], board: Any, name: str) -> RadarConfig:
    """Read a low-power configuration.

    Args:
        last: its commands.
        board: board that it names; None: none, and the receivers' mask determines the chip.
        name: name in error messages.

    Raises:
        InputError: a command is missing, or uses an unsupported feature.
    """
    if missing := [command for command in _REQUIRED if command not in last]:
        raise InputError(f"{name}: has no {missing[0]} line, expected the commands {', '.join(_REQUIRED)}")
    channel, common, timing, frame = (last[command] for command in _REQUIRED)
    if "numOfChirpsInBurst" not in frame.fields:
        raise InputError(f"{name}, line {frame.line}: frameCfg has {len(frame.values)} values, expected 6 (bursts)")
    rx_mask, tx_mask = channel.integer("rxChannelEn", 1, 255), channel.integer("txChannelEn", 1, 255)
    if board is None:
        board = "iwrl6432boost" if rx_mask < 8 else "awrl6844evm"
    chip = board.get("chip") if isinstance(board, dict) else load_board(board).chip
    if chip not in _CHIPS:
        raise InputError(f"{name}: is a low-power configuration, but its board {board} has an {chip}")
    masks = _CHIPS[chip]
    tx = tuple(k for k, bits in enumerate(masks.tx) if tx_mask & bits)
    rate = masks.clock / common.integer("digOutputSampRate", 1, 255)
    order, bpm = _order(common, tx)
    idle, ramp = timing.decimal("chirpIdleTime", -6), common.decimal("chirpRampEndTime", -6)
    loops, pause = _loops(frame, len(order), idle + ramp)
    calibration = last.get("factoryCalibCfg")
    return RadarConfig.build(
        name,
        board=board,
        start_frequency=timing.decimal("chirpRfFreqStart", 9),
        slope=timing.decimal("chirpRfFreqSlope", 12),
        idle_time=idle,
        adc_start_time=timing.integer("chirpAdcSkipSamples") / rate,
        ramp_end_time=ramp,
        samples=common.integer("numOfAdcSamples", 4) // 2,
        sample_rate=rate / 2,
        loops=loops,
        loop_idle_time=pause,
        frame_period=frame.decimal("framePeriodicity", -3),
        tx_order=order,
        bpm=bpm,
        rx=tuple(k for k, bit in enumerate(masks.rx) if rx_mask & bit),
        rx_gain_db=calibration.integer("rxGain", 0, 63) if calibration else 30,
        tx_backoff_db=calibration.decimal("backoff0") if calibration else 0,
        high_pass=_HIGH_PASS[common.integer("chirpRxHpfSel", 0, 3)],
        iq_order="real",
        **_measured(last.get("compRangeBiasAndRxChanPhase")),
    )


def _order(common: Command, tx: tuple[int, ...]) -> tuple[tuple[Firing, ...], tuple[int, int] | None]:
    """Firing order of a loop, and the slots of binary phase modulation."""
    pattern = common.require("chirpTxMimoPatSel", (0, 1, 4), "0 = none, 1 = TDM, 4 = BPM")
    if not tx:
        raise common.error("chirpTxMimoPatSel", "a transmitter that channelCfg enables")
    if pattern == 0 and len(tx) > 1:
        return (tx,), None
    if pattern == 4 and len(tx) > 1:
        if len(tx) != 2:
            raise common.error("chirpTxMimoPatSel", f"1 (TDM): {len(tx)} transmitters in binary phase modulation are "
                               "not taken apart, two are")  # fmt: skip
        return tx, (0, 1)
    return tx, None


def _loops(frame: Command, slots: int, chirp_time: float) -> tuple[int, float]:
    """Loops of a frame, and the pause after each, s."""
    frame.require("numOfChirpsAccum", (0, 1), "no chirps summed on the chip")
    chirps, bursts = frame.integer("numOfChirpsInBurst", 1, 4096), frame.integer("numOfBurstsInFrame", 1, 4096)
    if chirps % slots:
        raise frame.error("numOfChirpsInBurst", f"a multiple of the {slots} chirps of a loop")
    pause = frame.decimal("burstPeriodicity", -6) - chirps * chirp_time
    if bursts == 1 or abs(pause) <= _ROUNDED:
        return chirps // slots * bursts, 0.0
    if pause < 0:
        raise frame.error("burstPeriodicity", f"at least the {1e6 * chirps * chirp_time:g} us of its chirps")
    if chirps != slots:
        raise frame.error(
            "numOfChirpsInBurst", f"{slots}, one loop a burst: the pause of {1e6 * pause:g} us between bursts leaves "
            "gaps in the Doppler transform"
        )  # fmt: skip
    return bursts, round(pause, 12)


def _measured(command: Command | None) -> dict[str, Any]:
    """Measured range bias and channel factors."""
    if command is None:
        return {}
    pairs = range(len(command.fields) // 2)
    factors = tuple((command.decimal(f"re{i}"), command.decimal(f"im{i}")) for i in pairs)
    return {"range_bias": command.decimal("rangeBias"), "channel_calibration": factors}
