"""Serial port of the virtual radar: a pseudo-terminal at 115200 baud with the firmware's command line."""

import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError
from radarsim.emulator.commandline import BANNER, PROMPT

BAUD, _SPEED = 115200, termios.B115200
_BYTE_TIME = 10 / BAUD  # s: start bit, eight, stop bit
_BOOT_TIME = 0.3  # s without input after a reset
_LONGEST_LINE = 255  # size of the firmware's buffer


class Uart:
    """Pseudo-terminal that echoes and answers lines at the speed of a UART.

    Args:
        boot: function called at power-up and after every reset; it returns the function that answers lines.
        link: symbolic link to the terminal to create, for a constant name.

    Attributes:
        path: path of the terminal.

    Raises:
        InputError: the link cannot be made.
    """

    def __init__(self, boot: Callable[[], Callable[[str], str]], link: Path | None = None):
        self._boot = boot
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        os.close(slave)  # so that the master detects whether a client is connected
        os.set_blocking(self._master, False)
        self._link = link
        if link is not None:
            self._make_link(link)
        self._execute = boot()
        self._line = bytearray()
        self._reset, self._closed = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._serve, name="uart", daemon=True)
        self._thread.start()

    def reset(self) -> None:
        """Reboot: clear the configuration, ignore input for a while, then send banner and prompt."""
        self._reset.set()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()
        os.close(self._master)
        if self._link is not None and self._link.is_symlink() and os.readlink(self._link) == self.path:
            self._link.unlink()

    def _make_link(self, link: Path) -> None:
        try:
            if link.is_symlink():  # left behind by an emulator that was killed
                link.unlink()
            link.symlink_to(self.path)
        except OSError as error:
            os.close(self._master)
            raise InputError(f"{link}: cannot become a link to the serial port ({error.strerror})") from error

    def _serve(self) -> None:
        poll = select.poll()
        poll.register(self._master, select.POLLIN)
        while not self._closed.is_set():
            events = dict(poll.poll(20))
            if self._reset.is_set():
                self._reboot()
            elif events.get(self._master, 0) & select.POLLIN:
                self._take(self._read())
            elif events:  # no client has the port open
                time.sleep(0.01)

    def _reboot(self) -> None:
        self._closed.wait(_BOOT_TIME)
        self._reset.clear()
        self._read()  # input during the reboot is lost
        self._line.clear()
        self._execute = self._boot()
        self._write(BANNER.replace("\n", "\n\r") + PROMPT)

    def _read(self) -> bytes:
        try:
            return os.read(self._master, 65536)
        except OSError:  # no input, or the client has just closed the port
            return b""

    def _take(self, data: bytes) -> None:
        if termios.tcgetattr(self._master)[5] != _SPEED:  # another baud rate garbles the bytes
            self._write(bytes(0x80 | byte >> 1 for byte in data).decode("latin-1"))
            return
        for byte in data:
            if byte in b"\r\n":
                # The firmware accepts either line ending: after "\r\n" it sends two prompts.
                self._answer("\r\n" if byte == ord("\r") else "\n")
            else:
                self._line.append(byte)
                if len(self._line) == _LONGEST_LINE:
                    self._answer("")

    def _answer(self, ending: str) -> None:
        line = self._line.decode("latin-1")
        self._line.clear()
        self._write(line + ending)
        answer = self._execute(line)
        self._write(answer.replace("\n", "\n\r") + PROMPT)

    def _write(self, text: str) -> None:
        data = text.encode("latin-1", "replace")
        time.sleep(len(data) * _BYTE_TIME)
        try:
            os.write(self._master, data)
        except OSError:  # no reader: a UART does not wait
            pass
