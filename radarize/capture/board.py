"""DCA1000 capture board: commands and replies over UDP, from the computer's side."""

import errno
import socket
import time
from dataclasses import dataclass

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import DATA_PORT
from radarize.radar.dca1000_commands import (
    BOARD_ADDRESS,
    COMMAND_PORT,
    COMPUTER_ADDRESS,
    RAW_TWO_LANES,
    Opcode,
    Reply,
    Request,
    Status,
    packet_settings,
)

#: Timeout of a reply, s; requests are repeated, since UDP may lose them.
_PATIENCE, _ATTEMPTS = 1.0, 3
#: Delays between packets, s, the usual one first, and their data rates, Mbit/s.
_THROUGHPUT = {25e-6: 325.0, 10e-6: 545.0, 5e-6: 706.0}
_TROUBLE = {
    Status.NO_LVDS: "gets no samples from the radar; is the ribbon cable in, and lvdsStreamCfg -1 0 1 0 configured?",
    Status.MEMORY_FULL: "its memory is full: the network is too slow, samples are lost",
    Status.LVDS_BUFFER_FULL: "its LVDS buffer is full: the radar sends too fast, samples are lost",
}


@dataclass(frozen=True)
class NetworkAddresses:
    """Addresses and ports; the defaults are those of a board as delivered.

    Attributes:
        host: address of this computer, to which packets are sent.
        dca: the board's address.
        command_port, data_port: UDP.
    """

    host: str = COMPUTER_ADDRESS
    dca: str = BOARD_ADDRESS
    command_port: int = COMMAND_PORT
    data_port: int = DATA_PORT

    def bind(self, port: int) -> socket.socket:
        """Bind a UDP socket to `host`.

        Raises:
            InputError: the address is none of this computer's, or the port is in use.
        """
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            receiver.bind((self.host, port))
        except (OSError, OverflowError) as error:
            receiver.close()
            raise InputError(self._why(error, port)) from error
        return receiver

    def _why(self, error: Exception, port: int) -> str:
        number = getattr(error, "errno", None)
        if number == errno.EADDRNOTAVAIL:
            return (
                f"--host {self.host}: no network interface of this computer has that address, expected the one that "
                f"the DCA1000 sends to (sudo ip address add {self.host}/24 dev INTERFACE)"
            )
        if number == errno.EADDRINUSE:
            return f"--host {self.host}: UDP port {port} is taken, expected it free; is another capture running?"
        return f"--host {self.host}, UDP port {port}: {getattr(error, 'strerror', None) or error}"


class CaptureCard:
    """A DCA1000; use as a context manager.

    Raises:
        InputError: the command port cannot be bound.
    """

    def __init__(self, network: NetworkAddresses):
        self.network = network
        self._socket = network.bind(network.command_port)
        self._reported = Status(0)
        self._foreign = ""
        self._port: int | None = None

    def __enter__(self) -> "CaptureCard":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def configure(self, config: RadarConfig) -> str:
        """Configure the board for raw samples of a configuration; return its firmware version.

        Raises:
            InputError: no reply or an error, or a data rate beyond the board's.
        """
        rate = 8e-6 * config.frame_bytes * config.frame_rate
        if rate > max(_THROUGHPUT.values()):
            limit = max(_THROUGHPUT.values())
            raise InputError(f"radar configuration: sends {rate:.0f} Mbit/s, expected at most the DCA1000's {limit:g}")
        # A margin of a quarter for bursts, if there is one.
        delay = next((d for d, limit in _THROUGHPUT.items() if rate < 0.75 * limit), min(_THROUGHPUT))
        self.request(Opcode.ALIVE)
        self.request(Opcode.RESET_FPGA)
        version = self.request(Opcode.VERSION, answer=True)
        self.request(Opcode.CONFIGURE, RAW_TWO_LANES)
        self.request(Opcode.PACKETS, packet_settings(delay))
        return f"{version & 0x7F}.{version >> 7 & 0x7F}"

    def start(self) -> None:
        """Start to forward samples."""
        self._reported = Status(0)
        self.request(Opcode.START)

    def stop(self) -> None:
        """Stop forwarding samples."""
        self.request(Opcode.STOP)

    def request(self, command: Opcode, body: bytes = b"", answer: bool = False) -> int:
        """Send a command; return the status of its reply.

        Args:
            answer: the status is a value, not success or failure.

        Raises:
            InputError: no reply, or failure.
        """
        for _ in range(_ATTEMPTS):
            try:
                self._socket.sendto(Request(command, body).encode(), (self.network.dca, self.network.command_port))
            except OSError as error:
                raise InputError(f"--dca {self.network.dca}: {error.strerror or error}") from error
            deadline = time.monotonic() + _PATIENCE
            while reply := self._hear(deadline):
                if reply.command != command:
                    continue
                if reply.status and not answer:
                    raise InputError(
                        f"--dca {self.network.dca}: the DCA1000 answers {command.name} with status {reply.status}, "
                        "expected 0 (success); switch it off and on again"
                    )
                return reply.status
        elsewhere = f"; {self._foreign} sent something instead, which is not the board" if self._foreign else ""
        raise InputError(
            f"--dca {self.network.dca}: no DCA1000 answers {command.name} at UDP port {self.network.command_port} "
            f"({_ATTEMPTS} times asked); is it powered, its Ethernet cable in, and no firewall before "
            f"{self.network.host}?{elsewhere}"
        )

    def status(self, patience: float = 0.0) -> Status:
        """Status reported by the board since `start`, without a request."""
        deadline = time.monotonic() + patience
        while self._hear(deadline):
            pass
        return self._reported

    def troubles(self) -> list[str]:
        """Reported troubles in words."""
        reported = self.status()
        return [f"the DCA1000 {words}" for bit, words in _TROUBLE.items() if reported & bit]

    def _hear(self, deadline: float) -> Reply | None:
        """Next reply of the board until a deadline (monotonic, s); unsolicited reports are stored.

        It replies from one port of its address, (real boards: 1024), which is not known in advance; after its first
        reply, other senders are ignored.
        """
        while True:
            self._socket.settimeout(max(deadline - time.monotonic(), 0.0))
            try:
                data, (sender, port) = self._socket.recvfrom(2048)
            except OSError:
                return None
            if sender != self.network.dca or self._port not in (None, port):
                self._foreign = f"{sender}:{port}"
                continue
            try:
                reply = Reply.decode(data)
            except InputError:
                continue
            self._port = port
            if reply.command == Opcode.STATUS:
                self._reported |= Status(reply.status)
            return reply
