"""Command line of TI's `mmwDemo` firmware: its commands, their preconditions, and its messages.

Behaviour and messages follow mmWave SDK 3.6, `packages/ti/utils/cli` and `packages/ti/demo/xwr18xx/mmw`. Where
sensorStart rejects the chirps, the firmware prints error numbers only; the messages here are this project's.
"""

from collections.abc import Callable
from typing import Protocol

from radarize.io.errors import InputError
from radarize.radar.cfg import parse_cfg
from radarize.radar.commands import FIELDS
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits

PROMPT = "mmwDemo:/>"
BANNER = (
    "******************************************\n"
    "xWR18xx MMW Demo 03.06.00.00 (emulated)\n"
    "******************************************\n"
)
#: Number of values of each configuration command. RF commands, which flushCfg clears, and the demo's own, which
#: every sensorStart without argument requires again.
RF = {name: len(FIELDS[name]) for name in ("dfeDataOutputMode", "channelCfg", "adcCfg", "profileCfg", "chirpCfg")}
RF |= {"frameCfg": len(FIELDS["frameCfg"]), "lowPower": 2, "advFrameCfg": 5, "subFrameCfg": 10, "contModeCfg": 9}
DEMO = {
    "adcbufCfg": 5, "guiMonitor": 7, "cfarCfg": 9, "multiObjBeamForming": 3, "calibDcRangeSig": 5, "clutterRemoval": 2,
    "compRangeBiasAndRxChanPhase": 25, "measureRangeBiasAndRxChanPhase": 3, "aoaFovCfg": 5, "cfarFovCfg": 4,
    "extendedMaxVelocity": 2, "CQRxSatMonitor": 5, "CQSigImgMonitor": 3, "analogMonitor": 2, "lvdsStreamCfg": 4,
    "calibData": 3,
}  # fmt: skip
OPTIONAL = {"bpmCfg": 4, "configDataPort": 2}
_COUNTS = RF | DEMO | OPTIONAL
#: Read only at the first sensorStart; other values need a reboot.
_OPENING = ("channelCfg", "adcCfg", "lowPower")
_MOST_FRAMES = 65535
_FRAMES = ("profileCfg", "chirpCfg", "frameCfg")
_USAGE = "Error: Invalid usage of the CLI command\n"
_STARTED = "Ignored: This command is not allowed after sensor has started\n"
_RECONFIGURE = (
    "Error: Reconfig is not supported, only argument of 0 is\n(do not reconfig, just re-start the sensor) valid\n"
)
_NOTHING_NEW = (
    'Error: You have provided no configuration, issue "sensorStart 0" OR provide full configuration and issue '
    '"sensorStart"\n'
)
_ALL_NEW = (
    'Error: You have provided complete new configuration, issue "sensorStart" (without argument) if you want it to '
    "take effect\n"
)
_PARTIAL = (
    "Error: You have provided partial configuration between stop and this command and partial configuration cannot be "
    'undone.Issue the full configuration and do "sensorStart" \n'
)


class Radar(Protocol):
    """Radar that the commands control."""

    def start(self, config: RadarConfig, frames: int) -> None:
        """Send a number of frames, or endlessly if `frames` is 0; raise InputError for an unusable configuration."""

    def stop(self) -> None:
        """Stop and return when the frame in progress has ended."""


class CommandLine:
    """Firmware command line in its state after power-up."""

    def __init__(self, radar: Radar):
        self._radar = radar
        self._lines: list[tuple[str, ...]] = []
        self._pending: set[str] = set()  # demo commands since power-up or the last sensorStop
        self._opened: list[tuple[str, ...]] | None = None
        self._last: tuple[RadarConfig, int] | None = None
        self._started = False

    def execute(self, line: str) -> str:
        """Return the firmware's answer to a line, without echo and prompt."""
        if line.startswith("%"):
            return "Skipped\n"
        words = line.split()
        if not words:
            return ""
        name, *values = words
        if name not in self._OWN | _COUNTS:
            return f"'{name}' is not recognized as a CLI command\n"
        text = self._OWN[name](self, values) if name in self._OWN else self._configure(name, values)
        return text + ("Error -1\n" if "Error: " in text else "Done\n")

    def _configure(self, name: str, values: list[str]) -> str:
        if self._started and name != "configDataPort":
            return _STARTED
        if len(values) != _COUNTS[name]:
            return _USAGE
        modes = [line[1] for line in self._lines if line[0] == "dfeDataOutputMode"]
        if name in _FRAMES and modes[-1:] not in (["1"], ["3"]):
            mode = "Frame or Advanced Frame" if name == "profileCfg" else "Chirp"
            return f"Error: Configuration is valid only if the DFE Output Mode is {mode}\n"
        if name == "dfeDataOutputMode" and values[0] not in ("1", "2", "3"):
            return "Error: Invalid mode.\n"
        self._lines.append((name, *values))
        if name in DEMO:
            self._pending.add(name)
        return ""

    def _flush(self, values: list[str]) -> str:
        if self._started:
            return _STARTED
        self._lines = [line for line in self._lines if line[0] not in RF]
        return ""

    def _start(self, values: list[str]) -> str:
        anew = not values
        if len(values) == 1 and values[0] != "0":
            return _RECONFIGURE
        if len(values) > 1:
            return _USAGE
        whole = self._pending == set(DEMO)
        if self._last is None and not whole:
            return "Error: Full configuration must be provided before sensor can be started the first time\n"
        if self._started:
            return "Ignored: Sensor is already started\n"
        if anew and not self._pending:
            return _NOTHING_NEW
        if not whole and self._pending:
            return _PARTIAL
        if not anew and whole and self._last is not None:
            return _ALL_NEW
        return self._run(anew)

    def _run(self, anew: bool) -> str:
        debug = "" if self._opened is not None else "Debug: Init Calibration Status = 0x1ffe\n"
        try:
            if anew or self._last is None:
                self._check_opening()
                config, frames = self._read()
            else:
                config, frames = self._last
            self._radar.start(config, frames)
        except InputError as error:
            return f"{debug}Error: mmWave Config failed: {error}\n"
        self._last, self._started = (config, frames), True
        return debug

    def _check_opening(self) -> None:
        """Check the settings that need a reboot; real firmware stops in an assertion if they change."""
        opening = sorted({line[0]: line for line in self._lines if line[0] in _OPENING}.values())
        if self._opened is None:
            self._opened = opening
        elif opening != self._opened:
            raise InputError(f"{', '.join(_OPENING)} differ from the first sensorStart's, expected a reboot in between")

    def _read(self) -> tuple[RadarConfig, int]:
        """Return the configuration and the number of frames to send."""
        config = parse_cfg("\n".join(" ".join(line) for line in self._lines), "commands so far")
        check_limits(config, demo=True)
        last = {line[0]: line[1:] for line in self._lines}
        if last["lvdsStreamCfg"][FIELDS["lvdsStreamCfg"].index("dataFmt")] != "1":
            raise InputError("lvdsStreamCfg dataFmt is not 1 (ADC samples), so nothing would go to the DCA1000")
        frames = last["frameCfg"][FIELDS["frameCfg"].index("numFrames")]
        if not (frames.isdecimal() and frames.isascii() and len(frames) <= 5 and int(frames) <= _MOST_FRAMES):
            raise InputError(f"frameCfg numFrames is {frames}, expected 0 (without end) to {_MOST_FRAMES}")
        return config, int(frames)

    def _stop(self, values: list[str]) -> str:
        if not self._started:
            return "Ignored: Sensor is already stopped\n"
        self._radar.stop()
        self._started = False
        self._pending.clear()
        return ""

    def _version(self, values: list[str]) -> str:
        return (
            "Platform                : xWR18xx\n"
            "mmWave SDK Version      : 03.06.00.00\n"
            "Device Info             : IWR18xx non-secure ES 01.00\n"
        )

    def _status(self, values: list[str]) -> str:
        state = 2 if self._started else 3 if self._last else 0
        return f"Sensor State: {state}\nData port baud rate: 921600\n"

    def _help(self, values: list[str]) -> str:
        names = "\n".join(sorted(self._OWN | _COUNTS))
        return f"Help: This will display the usage of the CLI commands\n{names}\n"

    _OWN: dict[str, Callable[["CommandLine", list[str]], str]] = {
        "sensorStart": _start, "sensorStop": _stop, "flushCfg": _flush, "version": _version,
        "queryDemoStatus": _status, "help": _help,
    }  # fmt: skip
