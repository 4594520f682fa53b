"""Command side of the emulated DCA1000: answers requests and controls the data side.

A real board acknowledges nearly every request as successful, even a start before any settings (the `test_cmd` capture
among the real recordings). The emulator fails requests that would not give samples of an IWR1843: settings other than
raw, two lanes and 16 bit, packet parameters out of range, unknown codes, a second start.
"""

import socket
import threading
from collections.abc import Callable
from typing import NamedTuple

from radarize.io.errors import InputError
from radarize.radar.dca1000 import DATA_PORT, MAX_PAYLOAD
from radarize.radar.dca1000_commands import (
    COMMAND_PORT,
    RAW_TWO_LANES,
    VERSION_2_8,
    Opcode,
    Reply,
    Request,
    Status,
    read_packet_settings,
)
from radarsim.emulator.link import Link

_DONE, _FAILED = 0, 1
_DEFAULT = (25e-6, MAX_PAYLOAD)  # delay between packets, s, and their payload, bytes


class Board:
    """Answers a DCA1000 gives to requests.

    Args:
        link: data side.
        reset_radar: function that reboots the radar on the board.
        log: takes a line for the user, such as "radar: stopped".
    """

    def __init__(self, link: Link, reset_radar: Callable[[], None], log: Callable[[str], None]):
        self._link, self._reset_radar, self._log = link, reset_radar, log
        self._packets = _DEFAULT

    def execute(self, request: Request) -> int:
        """Execute a request and return the status of its reply."""
        try:
            return self._execute(request.command, request.body)
        except InputError as error:
            self._log(f"board: {error}")
            return _FAILED

    def _execute(self, command: int, body: bytes) -> int:
        match command:
            case Opcode.ALIVE | Opcode.STATUS | Opcode.RADAR_MODE:
                pass
            case Opcode.VERSION:
                return VERSION_2_8
            case Opcode.RESET_FPGA:
                self._link.stop()
                self._packets = _DEFAULT
            case Opcode.RESET_RADAR:
                self._log("board: radar reset")
                self._reset_radar()
            case Opcode.CONFIGURE:
                if body[:5] != RAW_TWO_LANES[:5] or len(body) != len(RAW_TWO_LANES):  # the last byte is a timer
                    wanted = f"{RAW_TWO_LANES.hex(' ')} (raw, 2 lanes, 16 bit)"
                    raise InputError(f"settings {body.hex(' ')} fail, expected {wanted}")
            case Opcode.PACKETS:
                self._packets = read_packet_settings(body)
            case Opcode.EEPROM:
                self._log("board: EEPROM written; the emulator keeps its addresses")
            case Opcode.START:
                if self._link.recording:
                    raise InputError("start fails, it is recording")
                self._link.start(*self._packets)
                self._log(f"board: recording, {self._packets[0] * 1e6:g} us between packets")
            case Opcode.STOP:
                self._link.stop()
            case _:
                raise InputError(f"request {command} fails, the emulator cannot do it")
        return _DONE


class Addresses(NamedTuple):
    """Addresses and UDP ports of the DCA1000 and the capture computer (really 192.168.33.180 and .30)."""

    board: str = "127.0.0.2"
    computer: str = "127.0.0.1"
    command_port: int = COMMAND_PORT
    data_port: int = DATA_PORT


class BoardSockets:
    """Network interface of the emulated DCA1000.

    Replies and data are sent from port 1024, as by a real board, to fixed ports of the computer: software that
    listens elsewhere, or connects its socket to the command port, fails here as with a real board.

    Args:
        at: addresses; requests arrive at `board` and `command_port`, packets are sent to `computer` and `data_port`,
            replies to its `command_port`.
        log: takes a line for the user, such as "radar: stopped".

    Raises:
        InputError: the address is in use, or not one of this machine.
    """

    def __init__(self, at: Addresses, log: Callable[[str], None]):
        self._log, self._unheard = log, False
        self._replies_to, self._data_to = (at.computer, at.command_port), (at.computer, at.data_port)
        self._commands = _bound(at.board, at.command_port)
        try:
            self._out = _bound(at.board, 1024)
        except InputError:
            self._out = _bound(at.board, 0)  # if port 1024 is used by another emulator
        self._out.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self._closed = threading.Event()
        self._thread: threading.Thread | None = None

    def serve(self, execute: Callable[[Request], int]) -> None:
        """Answer requests in a thread until the sockets are closed."""
        self._thread = threading.Thread(target=self._serve, args=(execute,), name="commands", daemon=True)
        self._thread.start()

    def data(self, packet: bytes) -> None:
        """Send a data packet."""
        self._send(packet, self._data_to)

    def report(self, status: Status) -> None:
        """Send a status message without a request."""
        self._send(Reply(Opcode.STATUS, status).encode(), self._replies_to)

    def close(self) -> None:
        self._closed.set()
        if self._thread is not None:
            self._thread.join()
        self._commands.close()
        self._out.close()

    def _send(self, packet: bytes, where: tuple[str, int]) -> None:
        """Send a packet. Without a network, as with a real board, it is lost and the board continues."""
        try:
            self._out.sendto(packet, where)
            self._unheard = False
        except OSError as error:
            if not self._unheard:
                self._log(f"board: packets to {where[0]}:{where[1]} are lost ({error.strerror or error})")
            self._unheard = True

    def _serve(self, execute: Callable[[Request], int]) -> None:
        self._commands.settimeout(0.05)
        while not self._closed.is_set():
            try:
                data, _ = self._commands.recvfrom(2048)
                request = Request.decode(data)
            except TimeoutError:
                continue
            except InputError as error:
                self._log(f"board: {error}; no reply")
                continue
            except OSError as error:
                self._log(f"board: a request is lost ({error.strerror or error})")
                self._closed.wait(0.1)
                continue
            self._send(Reply(request.command, execute(request)).encode(), self._replies_to)


def _bound(address: str, port: int) -> socket.socket:
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        out.bind((address, port))
    except OSError as error:
        out.close()
        raise InputError(f"{address}:{port} cannot be the board's address ({error.strerror})") from error
    return out
