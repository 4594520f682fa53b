"""TI SDK configuration files (``.cfg``): command lines sent to the demo firmware over UART.

Low-power chips have commands of their own (`radarize.radar.lowpower`).
"""

import re
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

from radarize.io.errors import InputError
from radarize.io.files import read_bytes
from radarize.io.jsonfile import parse_json
from radarize.radar.array import losses
from radarize.radar.boards import BOARDS, Board, likely_board, load_board, named_board
from radarize.radar.commands import Command, commands_of
from radarize.radar.config import HIGH_PASS_1, HIGH_PASS_2, Firing, RadarConfig, fired
from radarize.radar.lowpower import COMMANDS as LOW_POWER
from radarize.radar.lowpower import parse_low_power

REQUIRED = ("dfeDataOutputMode", "channelCfg", "adcCfg", "adcbufCfg", "profileCfg", "chirpCfg", "frameCfg")
#: Largest size of a file, bytes.
_LARGEST = 1 << 20
#: Largest number of different chirps in a loop.
_MOST_CHIRPS = 64


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
def parse_cfg(text: str, name: str = "configuration") -> RadarConfig:
    """Read a TI SDK configuration of one chirp profile.

    Args:
        text: content of a ``.cfg`` file.
        name: name in error messages, usually the path.

    Raises:
        InputError: names file, line, command and field: a missing or malformed line, or a setting that this project
            does not cover (several profiles, several subframes, chirps that vary).

    Example:
        >>> from radarize.radar.cfg import parse_cfg, remarks
        >>> from radarize.radar.presets import load_config
        >>> _, text = load_config("radarize")
        >>> config = parse_cfg(text)
        >>> config.tx_order, remarks(text, config)
        ((0, 2, 1), [])
    """
    commands: dict[str, list[Command]] = {}
    for command in commands_of(text, name):
        commands.setdefault(command.name, []).append(command)
    last = {key: lines[-1] for key, lines in commands.items()}  # the last one is effective
    if not LOW_POWER.isdisjoint(last):
        return parse_low_power(last, _board(text, name), name)
    if advanced := "advFrameCfg" in last:
        last["advFrameCfg"].require(
            "numOfSubFrames", (1,), "advanced frames of a single subframe, which has one profile"
        )
    frame_commands = ("advFrameCfg", "subFrameCfg") if advanced else ("frameCfg",)
    for required in (*REQUIRED[:-1], *frame_commands):
        if required not in commands:
            raise InputError(f"{name}: has no {required} line, expected the commands {', '.join(REQUIRED)}")

    frame = _subframe(commands["subFrameCfg"]) if advanced else _frame(last["frameCfg"])
    mode = "advanced frames" if advanced else "plain frames; neither continuous nor advanced ones"
    last["dfeDataOutputMode"].require("mode", (3 if advanced else 1,), mode)
    last["adcCfg"].require("numADCBits", (2,), "16 bit")
    real = not last["adcCfg"].require("adcOutputFmt", (0, 1), "real or complex 1x samples")
    last["adcbufCfg"].require(
        "adcOutputFmt", (int(real),), f"{'real' if real else 'complex'} samples, as adcCfg has it"
    )
    last["adcbufCfg"].require("ChanInterleave", (1,), "receivers one after another")
    swap = last["adcbufCfg"].require("SampleSwap", (0, 1), "0 = I first, 1 = Q first")
    if "lvdsStreamCfg" in last:
        last["lvdsStreamCfg"].require("enableHeader", (0,), "samples without headers")
        last["lvdsStreamCfg"].require("dataFmt", (0, 1), "1 = ADC samples alone")

    channel = last["channelCfg"]
    rx = numbers(channel.integer("rxChannelEn", 1, 255))
    channel.require("cascading", (0,), "a single device")
    order, profile = _firing(frame, commands["chirpCfg"], commands["profileCfg"], channel)
    if "bpmCfg" in last and last["bpmCfg"].integer("isEnabled", 0, 1):
        (tx_order, bpm), repeats = _modulated(last["bpmCfg"], frame, order), 1
    else:
        bpm, where = None, f"{name}, line {frame.command.line}: {frame.command.name}"
        tx_order, repeats = distinct_order(order, where)
    start_frequency = profile.decimal("startFreq", 9)
    samples = profile.integer("numAdcSamples", 2 if real else 1)
    return RadarConfig.build(
        name,
        board=_board(text, name) or likely_board(start_frequency),
        start_frequency=start_frequency,
        slope=profile.decimal("freqSlopeConst", 12),
        idle_time=profile.decimal("idleTime", -6),
        adc_start_time=profile.decimal("adcStartTime", -6),
        ramp_end_time=profile.decimal("rampEndTime", -6),
        samples=samples // 2 if real else samples,
        sample_rate=profile.decimal("digOutSampleRate", 3) / (2 if real else 1),
        loops=frame.loops * repeats,
        frame_period=frame.period,
        tx_order=tx_order,
        rx=rx,
        rx_gain_db=profile.integer("rxGain") & 0x3F,  # bits 7:6 select the RF gain target
        tx_backoff_db=_backoff(profile, tx_order),
        high_pass=(
            HIGH_PASS_1[profile.integer("hpfCornerFreq1", 0, 3)],
            HIGH_PASS_2[profile.integer("hpfCornerFreq2", 0, 3)],
        ),
        iq_order="real" if real else "qqii" if swap else "iiqq",
        loop_idle_time=_loop_idle_time(text),
        bpm=bpm,
        **_calibration(last),
    )


def remarks(text: str, config: RadarConfig) -> list[str]:
    """Remarks on a configuration, a sentence each: the board that was assumed if none is named, and losses by the
    firing order of its transmitters (`radarize.radar.array.losses`).

    Args:
        text: content of a ``.cfg`` file; for other formats there are no remarks on the board.
        config: configuration read from it.
    """
    found = losses(config)
    if _is_cfg(text) and _board(text, "configuration") is None:
        found.insert(0, assumed_board(config))
    return found


def assumed_board(config: RadarConfig) -> str:
    """Remark that no board is named: which one is assumed, and how to set it."""
    return (
        f"no board is named, but its antennas determine all directions: {config.board} is assumed; --board, or a "
        f"line '% Board:{config.board}' in the .cfg, sets another one"
    )


def _is_cfg(text: str) -> bool:
    return bool(re.search(r"^\s*(profileCfg|chirpComnCfg)\b", text, re.MULTILINE))


class Frame(NamedTuple):
    """Chirps of a frame.

    Attributes:
        command: command that defines the frame.
        first, end: indices of a loop's chirps.
        loops: number of loops.
        period: frame period, s.
    """

    command: Command
    first: int
    end: int
    loops: int
    period: float


def _frame(command: Command) -> Frame:
    if "startIdx" not in command.fields:
        raise InputError(
            f"{command.file}, line {command.line}: frameCfg has the {len(command.values)} values of a low-power chip, "
            f"expected {' and '.join(sorted(LOW_POWER))} beside it"
        )
    first = command.integer("startIdx", 0, 511)
    end = command.integer("endIdx", first, 511)
    return Frame(command, first, end, command.integer("numLoops", 1), command.decimal("framePeriodicity", -3))


def _subframe(subframes: list[Command]) -> Frame:
    """Frame of an advanced configuration: a single subframe of one burst equals a plain frame."""
    command = subframes[-1]
    for field in ("numOfBurst", "numOfBurstLoops"):
        command.require(field, (1,), "one burst a subframe: pauses between bursts leave gaps in the Doppler transform")
    first = command.integer("chirpStartIdx", 0, 511)
    end = first + command.integer("numOfChirps", 1, 512 - first) - 1
    return Frame(command, first, end, command.integer("numLoops", 1), command.decimal("subFramePeriodicity", -3))


def _firing(
    frame: Frame, chirps: list[Command], profiles: list[Command], channel: Command
) -> tuple[tuple[Firing, ...], Command]:
    """Transmitters that fire in one pass through the frame's chirps, by 0-based physical numbers, and their profile."""
    enabled = channel.integer("txChannelEn", 1, 255)
    order: list[Firing] = []
    used: list[int] = []
    for index in range(frame.first, frame.end + 1):
        matching = [c for c in chirps if c.integer("startIdx", 0, 511) <= index <= c.integer("endIdx", 0, 511)]
        if not matching:
            raise InputError(
                f"{frame.command.file}, line {frame.command.line}: {frame.command.name} has the chirps "
                f"{frame.first}...{frame.end}, expected a chirpCfg line for each; chirp {index} has none"
            )
        chirp = matching[-1]
        for field in ("startFreqVar", "freqSlopeVar", "idleTimeVar", "adcStartTimeVar"):
            if chirp.decimal(field) != 0:
                raise chirp.error(field, "0 (the same for all chirps)")
        mask = chirp.integer("txEnable", 0, 255)
        if not mask:
            raise chirp.error("txEnable", "a transmitter at least")
        if mask & ~enabled:
            raise chirp.error("txEnable", f"transmitters that channelCfg txChannelEn {enabled} enables")
        if used and chirp.integer("profileId") != used[0]:
            raise chirp.error("profileId", f"{used[0]}, as the frame's other chirps (one profile per frame)")
        used.append(chirp.integer("profileId"))
        order.append(firing_of(mask))
    defined = [p for p in profiles if p.integer("profileId", 0, 3) == used[0]]
    if not defined:
        raise chirp.error("profileId", "the number of a profileCfg line")
    if defined[-1].integer("txPhaseShifter") != 0:
        raise defined[-1].error("txPhaseShifter", "0 (no phase shift)")
    return tuple(order), defined[-1]


def numbers(mask: int) -> tuple[int, ...]:
    """0-based antenna numbers of a bit mask."""
    return tuple(k for k in range(mask.bit_length()) if mask >> k & 1)


def firing_of(mask: int) -> Firing:
    """Transmitters of a bit mask, as a `Firing`."""
    several = numbers(mask)
    return several[0] if len(several) == 1 else several


def distinct_order(order: tuple[Firing, ...], where: str) -> tuple[tuple[Firing, ...], int]:
    """Shortest firing order whose repetition gives the chirps of a loop, and the number of repetitions.

    Raises:
        InputError: it is too long.
    """
    for length in range(1, len(order) + 1):
        if len(order) % length == 0 and order[:length] * (len(order) // length) == order:
            break
    if length > _MOST_CHIRPS:
        raise InputError(f"{where} has {length} chirps until its transmitters repeat, expected at most {_MOST_CHIRPS}")
    return order[:length], len(order) // length


def _modulated(command: Command, frame: Frame, order: tuple[Firing, ...]) -> tuple[tuple[Firing, ...], tuple[int, int]]:
    """Firing order of a loop with binary phase modulation, demodulated: the first of the two transmitters in the place
    of the chirp with both in phase, the second in that of the chirp with the second one inverted; and these places."""
    first, second = (command.integer(field, 0, 511) - frame.first for field in ("chirp0Idx", "chirp1Idx"))
    pairs = {order[slot] if 0 <= slot < len(order) else () for slot in (first, second)}
    both = fired(pairs.pop()) if len(pairs) == 1 and first != second else ()
    if len(both) != 2:
        raise command.error("isEnabled", "0, or two chirps of the loop that fire the same two transmitters")
    apart = [*order]
    apart[first], apart[second] = both
    return tuple(apart), (first, second)


def _board(text: str, name: str) -> Any:
    """Board named by a comment (``% Board:`` of this project, ``% Platform:`` of TI's visualizer) or a command; None if
    there is none. This project's comment has a name, the path of a board's file, or its content, as `write_cfg` writes
    it."""
    if found := re.search(r"^%\s*Board:[ \t]*(\S.*?)\s*$", text, re.MULTILINE):
        if found[1].startswith("{"):
            return parse_json(found[1], f"{name}: Board")
        beside = Path(name).parent / found[1]
        return beside if found[1] not in BOARDS and beside.is_file() else found[1]
    platform = re.search(r"^(?:%\s*Platform:|antGeometryBoard)\s*(\S+)", text, re.MULTILINE)
    return named_board(platform[1]) if platform else None


def _loop_idle_time(text: str) -> float:
    """Idle time after a loop from this project's comment, s: the SDK's chips have none."""
    found = re.search(r"^%\s*LoopIdleTime:\s*(\d+\.?\d*)\s*$", text, re.MULTILINE)
    return float(Decimal(found[1]).scaleb(-6)) if found else 0.0


def _backoff(profile: Command, tx_order: tuple[Firing, ...]) -> float:
    code = profile.integer("txOutPower")
    steps = {code >> 8 * t & 0xFF for firing in tx_order for t in fired(firing)}  # one byte per transmitter, dB
    if len(steps) > 1:
        raise profile.error("txOutPower", "the same back-off for all transmitters in use")
    return steps.pop()


def _calibration(last: dict[str, Command]) -> dict[str, Any]:
    """Measured calibration; empty if the file has TI's default values."""
    factors: list[complex] = []
    bias = 0.0
    if command := last.get("compRangeBiasAndRxChanPhase"):
        bias = command.decimal("rangeBias")
        factors = [
            complex(command.decimal(f"re{i}"), command.decimal(f"im{i}")) for i in range(len(command.fields) // 2)
        ]
    if command := last.get("antPhaseRot"):  # people-counting firmware: signs of the receivers' feeds
        signs = [command.require(field, (-1, 1), "in or out of phase") for field in command.fields]
        factors = factors or [1 + 0j] * len(signs)
        if len(factors) != len(signs):
            raise command.error("rotation0", f"a sign for each of the {len(factors)} channels that are calibrated")
        factors = [s * f for s, f in zip(signs, factors, strict=True)]
    pairs = tuple((f.real, f.imag) for f in factors)
    measured = bias or set(pairs) - {(1.0, 0.0)}
    return ({"channel_calibration": pairs} if pairs else {}) | ({"range_bias": bias} if measured else {})


# --- writing ----------------------------------------------------------------------------------------------------------
def write_cfg(config: RadarConfig) -> str:
    """Write a configuration as commands for the SDK demo firmware; ``parse_cfg`` of it returns an equal configuration.

    Raises:
        InputError: a value has no code in the format (such as a gain that is not a whole number of dB).
    """
    gain = _whole("rx_gain_db", config.rx_gain_db, 63)
    backoff = _whole("tx_backoff_db", config.tx_backoff_db, 255)
    hpf1 = _code("high_pass[0]", config.high_pass[0], HIGH_PASS_1)
    hpf2 = _code("high_pass[1]", config.high_pass[1], HIGH_PASS_2)
    rx_mask = sum(1 << i for i in config.rx)
    tx_mask = sum(1 << i for i in {t for firing in config.tx_order for t in fired(firing)})
    real = config.iq_order == "real"
    order = list(config.tx_order)
    if config.bpm:
        together = tuple(t for slot in config.bpm for t in fired(config.tx_order[slot]))
        order[config.bpm[0]] = order[config.bpm[1]] = together
    profile = (
        f"{_text(config.start_frequency, -9)} {_text(config.idle_time, 6)} {_text(config.adc_start_time, 6)} "
        f"{_text(config.ramp_end_time, 6)} {sum(backoff << 8 * t for t in numbers(tx_mask))} 0 "
        f"{_text(config.slope, -12)} 1 "
        f"{config.samples * (1 + real)} {_text(config.sample_rate * (1 + real), -3)} {hpf1} {hpf2} {gain}"
    )
    factors = " ".join(f"{_text(factor.real)} {_text(factor.imag)}" for factor in config.channel_factors.ravel())
    board = config.board.model_dump_json() if isinstance(config.board, Board) else config.board
    swap = int(config.iq_order == "qqii")
    lines = [
        *cfg_headers(config),
        f"% Board:{board}",
        *([f"% LoopIdleTime:{_text(config.loop_idle_time, 6)}"] if config.loop_idle_time else []),
        "sensorStop",
        "flushCfg",
        "dfeDataOutputMode 1",
        f"channelCfg {rx_mask} {tx_mask} 0",
        f"adcCfg 2 {int(not real)}",
        f"adcbufCfg -1 {int(real)} {swap} 1 1",
        f"profileCfg 0 {profile}",
        *(
            f"chirpCfg {slot} {slot} 0 0 0 0 0 {sum(1 << tx for tx in fired(firing))}"
            for slot, firing in enumerate(order)
        ),
        f"frameCfg 0 {len(config.tx_order) - 1} {config.loops} 0 {_text(config.frame_period, 3)} 1 0",
        *([f"bpmCfg -1 1 {config.bpm[0]} {config.bpm[1]}"] if config.bpm else []),
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


def cfg_headers(config: RadarConfig) -> list[str]:
    """Comment lines of TI's visualizer without which radarize_ae and xwr_raw_ros refuse a file.

    Example:
        >>> cfg_headers(PRESETS["radarize"])
        ['% Created for SDK ver:03.06', '% Platform:xWR18xx']
    """
    chip = re.search(r"\d\d", load_board(config.board).chip)
    return ["% Created for SDK ver:03.06", f"% Platform:xWR{chip[0] if chip else 'xx'}xx"]


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
