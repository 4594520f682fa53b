"""Radar's command line over UART: TI's `mmwDemo` firmware, 115200 baud, prompt ``mmwDemo:/>``.

Every command is answered by ``Done``, or by ``Error ...`` and a message (mmWave SDK user guide, "Configuration (.cfg)
file format").
"""

import errno
import termios
import time

import serial
from serial.tools import list_ports

from radarize.io.errors import InputError
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig

BAUD = 115200
PROMPT = "mmwDemo:/>"
#: Timeouts, s; sensorStop answers at the end of the frame, sensorStart after RF calibration.
_PATIENCE, _START_PATIENCE = 3.0, 10.0
#: Commands that are not needed and unknown to some firmware.
_OPTIONAL = ("calibData",)
#: Errors of a disconnected port; termios's own is no OSError.
_LOST = (serial.SerialException, OSError, termios.error)


class Uart:
    """Command port of a radar; a context manager.

    Args:
        port: serial device, e.g. ``/dev/ttyACM0``.
        baud: baud rate of the firmware.

    Attributes:
        ignored: commands that are unknown to the firmware and not needed.

    Raises:
        InputError: the port cannot be opened, with the reason and the remedy.
    """

    def __init__(self, port: str, baud: int = BAUD):
        self.port, self.baud = port, baud
        self.ignored: list[str] = []
        try:
            self._serial = serial.Serial(port, baud, timeout=0.05, write_timeout=_PATIENCE, exclusive=True)
        except (*_LOST, ValueError) as error:
            raise InputError(f"--port {port}: {_why(error)}") from error

    def __enter__(self) -> "Uart":
        return self

    def __exit__(self, *_: object) -> None:
        self._serial.close()

    def configure(self, text: str) -> None:
        """Send a configuration, from sensorStop up to, but without, sensorStart.

        Args:
            text: commands, one per line; comments are skipped.

        Raises:
            InputError: the radar rejects a command (with its message), or does not answer.
        """
        for command in commands(text):
            self.send(command)

    def start(self) -> None:
        """Start to transmit.

        Raises:
            InputError: see `configure`.
        """
        self.send("sensorStart", _START_PATIENCE)

    def stop(self) -> None:
        """Stop at the end of the frame.

        Raises:
            InputError: see `configure`.
        """
        self.send("sensorStop")

    def send(self, command: str, patience: float = _PATIENCE) -> str:
        """Send a command, one line, and return the radar's answer, without echo and prompt; `patience`: timeout, s.

        Raises:
            InputError: an error message, an unreadable answer, or none.
        """
        try:
            self._serial.reset_input_buffer()
            self._serial.write(command.encode("ascii", "replace") + b"\n")
            heard = self._listen(patience)
        except _LOST as error:
            raise InputError(f"--port {self.port}: lost while sending {command!r}; is it still plugged in?") from error
        if not heard.isascii():
            raise InputError(
                f"--port {self.port}: answers {command!r} with unreadable bytes ({heard[:8].hex(' ')}), expected text; "
                f"--baud {self.baud} is wrong, or this is the data port"
            )
        lines = [line.strip() for line in heard.decode("ascii").replace(PROMPT, "\n").splitlines()]
        answer = [line for line in lines if line and line != command]
        if "Done" in answer:
            return "\n".join(line for line in answer if line != "Done")
        if answer and command.split()[0] in _OPTIONAL:
            self.ignored.append(command)
            return ""
        if answer:
            raise InputError(f"--port {self.port}: the radar refuses {command!r}: {' '.join(answer)}")
        raise InputError(
            f"--port {self.port}: no answer to {command!r} within {patience:g} s, expected a radar with the mmWave SDK "
            "demo; is it powered, in functional mode (SOP jumpers) and reset, and is this its command port (the first "
            f"of the two) at {self.baud} baud?"
        )

    def _listen(self, patience: float) -> bytes:
        """Read until the prompt after an answer."""
        heard, deadline = bytearray(), time.monotonic() + patience
        while time.monotonic() < deadline:
            heard += self._serial.read(max(1, self._serial.in_waiting))
            if heard.rstrip().endswith(PROMPT.encode()) and any(word in heard for word in _FINAL):
                break
        return bytes(heard)


#: Ends of an answer: success, failure, or unknown command.
_FINAL = (b"Done", b"Error", b"not recognized")


def commands(text: str) -> list[str]:
    """Commands of a configuration in the required order: sensorStop and flushCfg first, without sensorStart."""
    lines = [" ".join(line.split("%")[0].split()) for line in text.splitlines()]
    rest = [line for line in lines if line and line.split()[0] not in ("sensorStop", "flushCfg", "sensorStart")]
    return ["sensorStop", "flushCfg", *rest]


def text_for(config: RadarConfig, text: str, name: str) -> str:
    """Commands of a configuration: its own text if it is a .cfg, otherwise written from its fields.

    Raises:
        InputError: it does not stream samples over LVDS.
    """
    if text.lstrip().startswith("{"):
        return write_cfg(config)
    streams = [line.split() for line in commands(text) if line.startswith("lvdsStreamCfg")]
    if not streams or streams[-1][3:4] != ["1"]:
        found = " ".join(streams[-1]) if streams else "no lvdsStreamCfg"
        raise InputError(f"{name}: has {found}, expected lvdsStreamCfg -1 0 1 0, or the DCA1000 gets no samples")
    return text


def _why(error: Exception) -> str:
    """Reason why a port cannot be opened, and the remedy."""
    number = getattr(error, "errno", None)
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        there = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
        return f"no such serial port (present: {there}), expected the radar's command port; is its USB cable in?"
    if number in (errno.EACCES, errno.EPERM):
        return "permission denied; add yourself to its group (sudo usermod -aG dialout $USER) and log in again"
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in str(error):
        return "busy; another program has it open"
    return str(error)
