"""TI SDK configuration files (``.cfg``): the command lines that the demo firmware takes over UART.

Command syntax: mmWave SDK 3.x user's guide, section "Configuration (.cfg) file format". Commands that concern only the
on-chip processing (CFAR, angle of arrival, tracking, ...) are ignored.
"""

import difflib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from radarize.io.errors import InputError
from radarize.io.files import read_bytes
from radarize.io.jsonfile import parse_json
from radarize.radar.boards import BOARDS, Board, board_of
from radarize.radar.config import HIGH_PASS_1, HIGH_PASS_2, RadarConfig

#: Fields of the commands read here, in order.
FIELDS: dict[str, tuple[str, ...]] = {
    "dfeDataOutputMode": ("mode",),
    "channelCfg": ("rxChannelEn", "txChannelEn", "cascading"),
    "adcCfg": ("numADCBits", "adcOutputFmt"),
    "adcbufCfg": ("subFrameIdx", "adcOutputFmt", "SampleSwap", "ChanInterleave", "ChirpThreshold"),
    "profileCfg": tuple(
        "profileId startFreq idleTime adcStartTime rampEndTime txOutPower txPhaseShifter freqSlopeConst txStartTime "
        "numAdcSamples digOutSampleRate hpfCornerFreq1 hpfCornerFreq2 rxGain".split()
    ),
    "chirpCfg": tuple(
        "startIdx endIdx profileId startFreqVar freqSlopeVar idleTimeVar adcStartTimeVar txEnable".split()
    ),
    "frameCfg": tuple("startIdx endIdx numLoops numFrames framePeriodicity triggerSelect frameTriggerDelay".split()),
    "bpmCfg": ("subFrameIdx", "isEnabled", "chirp0Idx", "chirp1Idx"),
    "lvdsStreamCfg": ("subFrameIdx", "enableHeader", "dataFmt", "enableSW"),
    "compRangeBiasAndRxChanPhase": ("rangeBias", *(f"{p}{i}" for i in range(12) for p in ("re", "im"))),
    "antPhaseRot": tuple(f"rotation{i}" for i in range(12)),
}
REQUIRED = ("dfeDataOutputMode", "channelCfg", "adcCfg", "adcbufCfg", "profileCfg", "chirpCfg", "frameCfg")
#: Bytes of a file.
_LARGEST = 1 << 20
REFUSED = {"advFrameCfg": "advanced frames", "subFrameCfg": "advanced frames", "contModeCfg": "continuous mode"}


def read_text(path: Path) -> str:
    """Text of a configuration file.

    Raises:
        InputError: it cannot be read, or is not text.
    """
    data = read_bytes(path, "a radar's configuration", _LARGEST)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # comments in local alphabets; commands are ASCII
    if "\0" in text:
        raise InputError(f"{path}: is binary data, expected a text file with radar settings")
    return text


# --- reading ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Command:
    """One line of a configuration: values are read by field name, errors say where."""

    file: str
    line: int
    name: str
    values: tuple[str, ...]

    def error(self, field: str, expected: str) -> InputError:
        value = self.values[FIELDS[self.name].index(field)]
        return InputError(f"{self.file}, line {self.line}: {self.name} {field} is {value}, expected {expected}")

    def decimal(self, field: str, unit: int = 0) -> float:
        """A number in units of 10^unit, exact: 122 with unit -6 is the float nearest to 0.000122."""
        try:
            value = Decimal(self.values[FIELDS[self.name].index(field)])
        except InvalidOperation:
            raise self.error(field, "a number") from None
        if not value.is_finite() or abs(value) > Decimal("1e30"):
            raise self.error(field, "a finite number")
        return float(value.scaleb(unit))

    def integer(self, field: str, low: int = 0, high: int = 2**32 - 1) -> int:
        value = self.decimal(field)
        if value != int(value) or not low <= value <= high:
            raise self.error(field, f"a whole number from {low} to {high}")
        return int(value)

    def require(self, field: str, allowed: tuple[int, ...], meaning: str) -> int:
        value = self.integer(field, low=-(2**31))
        if value not in allowed:
            raise self.error(field, f"{' or '.join(map(str, allowed))} ({meaning})")
        return value


def parse_cfg(text: str, name: str = "configuration") -> RadarConfig:
    """Read a TI SDK configuration of one TDM-MIMO chirp profile.

    Args:
        text: content of a ``.cfg`` file.
        name: what errors call it, usually the path.

    Raises:
        InputError: with file, line, command and field: a missing or malformed line, or a setting that this project
            does not cover (real samples, several transmitters at once, several profiles, advanced frames, chirps
            that vary).
    """
    commands: dict[str, list[Command]] = {}
    for command in _commands(text, name):
        commands.setdefault(command.name, []).append(command)
    for required in REQUIRED:
        if required not in commands:
            raise InputError(f"{name}: has no {required} line, expected the commands {', '.join(REQUIRED)}")
    last = {key: lines[-1] for key, lines in commands.items()}  # the firmware keeps the latest

    last["dfeDataOutputMode"].require("mode", (1,), "plain frames; neither continuous nor advanced ones")
    last["adcCfg"].require("numADCBits", (2,), "16 bit")
    last["adcCfg"].require("adcOutputFmt", (1,), "complex 1x samples")
    last["adcbufCfg"].require("adcOutputFmt", (0,), "complex samples")
    last["adcbufCfg"].require("ChanInterleave", (1,), "receivers one after another")
    swap = last["adcbufCfg"].require("SampleSwap", (0, 1), "0 = I first, 1 = Q first")
    if "bpmCfg" in last:
        last["bpmCfg"].require("isEnabled", (0,), "no binary phase modulation: one transmitter a chirp")
    if "lvdsStreamCfg" in last:
        last["lvdsStreamCfg"].require("enableHeader", (0,), "samples without headers")
        last["lvdsStreamCfg"].require("dataFmt", (0, 1), "1 = ADC samples alone")

    channel = last["channelCfg"]
    rx = tuple(i for i in range(4) if channel.integer("rxChannelEn", 1, 15) >> i & 1)
    channel.require("cascading", (0,), "a single device")
    order, profile = _firing(last["frameCfg"], commands["chirpCfg"], commands["profileCfg"], channel)
    tx_order, repeats = distinct_order(order, f"{name}, line {last['frameCfg'].line}: frameCfg")
    board = _board(text, profile.decimal("startFreq", 9), name)
    calibration = _calibration(last)
    return RadarConfig.build(
        name,
        board=board,
        start_frequency=profile.decimal("startFreq", 9),
        slope=profile.decimal("freqSlopeConst", 12),
        idle_time=profile.decimal("idleTime", -6),
        adc_start_time=profile.decimal("adcStartTime", -6),
        ramp_end_time=profile.decimal("rampEndTime", -6),
        samples=profile.integer("numAdcSamples", 1),
        sample_rate=profile.decimal("digOutSampleRate", 3),
        loops=last["frameCfg"].integer("numLoops", 1) * repeats,
        frame_period=last["frameCfg"].decimal("framePeriodicity", -3),
        tx_order=tx_order,
        rx=rx,
        rx_gain_db=profile.integer("rxGain") & 0x3F,  # bits 7:6 select the RF gain target
        tx_backoff_db=_backoff(profile, tx_order),
        high_pass=(
            HIGH_PASS_1[profile.integer("hpfCornerFreq1", 0, 3)],
            HIGH_PASS_2[profile.integer("hpfCornerFreq2", 0, 3)],
        ),
        iq_order="qqii" if swap else "iiqq",
        **calibration,
    )


def _commands(text: str, name: str) -> Iterator[Command]:
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("%")[0].split()
        if not words:
            continue
        word = words[0]
        if not re.fullmatch(r"[A-Za-z]\w*", word):
            raise InputError(f"{name}, line {number}: starts with {word[:40]!r}, expected a command such as profileCfg")
        if word in REFUSED:
            raise InputError(
                f"{name}, line {number}: {word} asks for {REFUSED[word]}, expected plain frames (frameCfg)"
            )
        if word in FIELDS:
            count = len(FIELDS[word])
            if len(words) - 1 != count:
                raise InputError(
                    f"{name}, line {number}: {word} has {len(words) - 1} values, expected {count} "
                    f"({', '.join(FIELDS[word][:14])}{', ...' if count > 14 else ''})"
                )
            yield Command(name, number, word, tuple(words[1:]))
        elif close := difflib.get_close_matches(word, FIELDS, 1, cutoff=0.85):
            raise InputError(f"{name}, line {number}: unknown command {word}, expected {close[0]}")


def _firing(
    frame: Command, chirps: list[Command], profiles: list[Command], channel: Command
) -> tuple[tuple[int, ...], Command]:
    """Transmitters of one pass through the frame's chirps, 0-based physical numbers, and the profile they use."""
    enabled = channel.integer("txChannelEn", 1, 7)
    first = frame.integer("startIdx", 0, 511)
    end = frame.integer("endIdx", first, 511)
    order: list[int] = []
    used: list[int] = []
    for index in range(first, end + 1):
        matching = [c for c in chirps if c.integer("startIdx", 0, 511) <= index <= c.integer("endIdx", 0, 511)]
        if not matching:
            raise frame.error("endIdx", f"a chirpCfg line for each chirp {first}...{end}; chirp {index} has none")
        chirp = matching[-1]
        for field in ("startFreqVar", "freqSlopeVar", "idleTimeVar", "adcStartTimeVar"):
            if chirp.decimal(field) != 0:
                raise chirp.error(field, "0 (all chirps alike)")
        mask = chirp.integer("txEnable", 0, 7)
        if mask not in (1, 2, 4):
            raise chirp.error("txEnable", "1, 2 or 4 (one transmitter a chirp)")
        if not mask & enabled:
            raise chirp.error("txEnable", f"a transmitter that channelCfg txChannelEn {enabled} enables")
        if used and chirp.integer("profileId") != used[0]:
            raise chirp.error("profileId", f"{used[0]}, as the frame's other chirps (one profile per frame)")
        used.append(chirp.integer("profileId"))
        order.append(mask.bit_length() - 1)
    defined = [p for p in profiles if p.integer("profileId", 0, 3) == used[0]]
    if not defined:
        raise chirp.error("profileId", "the number of a profileCfg line")
    if defined[-1].integer("txPhaseShifter") != 0:
        raise defined[-1].error("txPhaseShifter", "0 (no phase shift)")
    return tuple(order), defined[-1]


def distinct_order(order: tuple[int, ...], where: str) -> tuple[tuple[int, ...], int]:
    """Shortest firing order that, repeated, gives the chirps of a loop; and how often it repeats.

    Raises:
        InputError: a transmitter fires twice within the shortest repetition.
    """
    for length in range(1, len(order) + 1):
        if len(order) % length == 0 and order[:length] * (len(order) // length) == order:
            break
    if len(set(order[:length])) != length:
        numbers = ", ".join(f"TX{t + 1}" for t in order)
        raise InputError(f"{where} fires {numbers} in a loop, expected each transmitter once")
    return order[:length], len(order) // length


def _board(text: str, start_frequency: float, name: str) -> object:
    """The board that a comment names (``% Board:`` of ours, ``% Platform:`` of TI's visualizer), else by the band. Ours
    is a name, the path of a board's file, or what that holds, as `write_cfg` has it."""
    if found := re.search(r"^%\s*Board:[ \t]*(\S.*?)\s*$", text, re.MULTILINE):
        if found[1].startswith("{"):
            return parse_json(found[1], f"{name}: Board")
        beside = Path(name).parent / found[1]
        return beside if found[1] not in BOARDS and beside.is_file() else found[1]
    platform = re.search(r"^%\s*Platform:\s*(\S+)", text, re.MULTILINE)
    return board_of(platform[1] if platform else "", start_frequency)


def _backoff(profile: Command, tx_order: tuple[int, ...]) -> float:
    code = profile.integer("txOutPower")
    steps = {code >> 8 * t & 0xFF for t in tx_order}  # one byte per transmitter, dB
    if len(steps) > 1:
        raise profile.error("txOutPower", "the same back-off for all transmitters in use")
    return steps.pop()


def _calibration(last: dict[str, Command]) -> dict[str, Any]:
    """What was measured; nothing where the file holds what TI's hold before anybody has."""
    factors = [1 + 0j] * 12
    bias = 0.0
    if command := last.get("compRangeBiasAndRxChanPhase"):
        bias = command.decimal("rangeBias")
        factors = [complex(command.decimal(f"re{i}"), command.decimal(f"im{i}")) for i in range(12)]
    if command := last.get("antPhaseRot"):  # people-counting firmware: signs of the receivers' feeds
        signs = [command.require(f"rotation{i}", (-1, 1), "in or out of phase") for i in range(12)]
        factors = [s * f for s, f in zip(signs, factors, strict=True)]
    pairs = tuple((f.real, f.imag) for f in factors)
    return {"channel_calibration": pairs} | ({"range_bias": bias} if bias or set(pairs) != {(1.0, 0.0)} else {})


# --- writing ----------------------------------------------------------------------------------------------------------
def write_cfg(config: RadarConfig) -> str:
    """The configuration as commands for the SDK demo firmware; ``parse_cfg`` of it is equal to `config`.

    Raises:
        InputError: a value has no code in the format (a gain that is not a whole number of dB, say).
    """
    gain = _whole("rx_gain_db", config.rx_gain_db, 63)
    backoff = _whole("tx_backoff_db", config.tx_backoff_db, 255)
    hpf1 = _code("high_pass[0]", config.high_pass[0], HIGH_PASS_1)
    hpf2 = _code("high_pass[1]", config.high_pass[1], HIGH_PASS_2)
    rx_mask = sum(1 << i for i in config.rx)
    tx_mask = sum(1 << i for i in config.tx)
    profile = (
        f"{_text(config.start_frequency, -9)} {_text(config.idle_time, 6)} {_text(config.adc_start_time, 6)} "
        f"{_text(config.ramp_end_time, 6)} {sum(backoff << 8 * t for t in config.tx)} 0 {_text(config.slope, -12)} 1 "
        f"{config.samples} {_text(config.sample_rate, -3)} {hpf1} {hpf2} {gain}"
    )
    factors = " ".join(f"{_text(factor.real)} {_text(factor.imag)}" for factor in config.channel_factors.ravel())
    board = config.board.model_dump_json() if isinstance(config.board, Board) else config.board
    swap = int(config.iq_order == "qqii")
    lines = [
        f"% Board:{board}",
        "sensorStop",
        "flushCfg",
        "dfeDataOutputMode 1",
        f"channelCfg {rx_mask} {tx_mask} 0",
        "adcCfg 2 1",
        f"adcbufCfg -1 0 {swap} 1 1",
        f"profileCfg 0 {profile}",
        *(f"chirpCfg {slot} {slot} 0 0 0 0 0 {1 << tx}" for slot, tx in enumerate(config.tx_order)),
        f"frameCfg 0 {len(config.tx_order) - 1} {config.loops} 0 {_text(config.frame_period, 3)} 1 0",
        "lowPower 0 0",
        "guiMonitor -1 0 0 0 0 0 0",
        "cfarCfg -1 0 2 8 4 3 0 15 1",
        "cfarCfg -1 1 0 8 4 4 1 15 1",
        "multiObjBeamForming -1 1 0.5",
        "clutterRemoval -1 0",
        "calibDcRangeSig -1 0 -5 8 256",
        "extendedMaxVelocity -1 0",
        "lvdsStreamCfg -1 0 1 0",
        f"compRangeBiasAndRxChanPhase {_text(config.range_bias)} {factors}",
        "measureRangeBiasAndRxChanPhase 0 1.5 0.2",
        "CQRxSatMonitor 0 3 4 63 0",
        "CQSigImgMonitor 0 31 4",
        "analogMonitor 0 0",
        "aoaFovCfg -1 -90 90 -90 90",
        f"cfarFovCfg -1 0 0 {config.max_range:.2f}",
        f"cfarFovCfg -1 1 {-config.max_velocity:.2f} {config.max_velocity:.2f}",
        "calibData 0 0 0",
        "sensorStart",
    ]
    return "\n".join(lines) + "\n"


def _text(value: float, unit: int = 0) -> str:
    """Shortest decimal of value * 10^unit that reads back to the same float."""
    text = format(Decimal(repr(float(value))).scaleb(unit), "f")
    return text.rstrip("0").rstrip(".") if "." in text else text


def _whole(field: str, value: float, high: int) -> int:
    if value != int(value) or not 0 <= value <= high:
        raise InputError(f"{field} is {value:g}, expected a whole number of dB from 0 to {high} in a .cfg file")
    return int(value)


def _code(field: str, value: float, table: tuple[float, ...]) -> int:
    if value not in table:
        raise InputError(
            f"{field} is {value:g} Hz, expected one of {', '.join(f'{f:g}' for f in table)} in a .cfg file"
        )
    return table.index(value)
