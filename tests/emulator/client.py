"""Independent client of the virtual radar, which shares only the protocol's constants with the project."""

import select
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import serial

from radarize.capture.board import NetworkAddresses
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000_commands import RAW_TWO_LANES, Opcode, Reply, Request, packet_settings
from radarsim.emulator.commandline import PROMPT
from radarsim.emulator.emulator import Emulator
from tests.virtual import CONFIG, emulated

SMALL = CONFIG.model_copy(update={"loops": 4, "samples": 32, "frame_period": 20e-3})


class Client:
    """Minimal capture software: a serial port, and two sockets at the DCA1000's addresses."""

    def __init__(self, port: str, where: NetworkAddresses):
        self.serial = serial.Serial(port, 115200, timeout=150)
        self.commands, self.data = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.commands.bind((where.host, where.command_port))
        self.data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.data.bind((where.host, where.data_port))
        self.commands.settimeout(5)
        self.board = (where.dca, where.command_port)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_) -> None:
        self.serial.close()
        self.commands.close()
        self.data.close()

    def command(self, line: str, ending: str = "\n") -> str:
        """Send a line and return the answer up to the prompt."""
        self.serial.write((line + ending).encode())
        return self.serial.read_until(PROMPT.encode()).decode()

    def configure(self, config: RadarConfig) -> list[str]:
        return [self.command(line) for line in write_cfg(config).splitlines()]

    def ask(self, command: Opcode, body: bytes = b"") -> Reply:
        self.commands.sendto(Request(command, body).encode(), self.board)
        return Reply.decode(self.commands.recvfrom(2048)[0])

    def record(self, delay: float = 25e-6) -> None:
        for command, body in (
            (Opcode.ALIVE, b""),
            (Opcode.RESET_FPGA, b""),
            (Opcode.CONFIGURE, RAW_TWO_LANES),
            (Opcode.PACKETS, packet_settings(delay)),
            (Opcode.START, b""),
        ):
            assert self.ask(command, body) == Reply(command, 0)

    def packets(self, silence: float = 0.5) -> list[bytes]:
        """Receive data packets until none arrives within a timeout."""
        found = []
        while select.select([self.data], [], [], silence)[0]:
            found.append(self.data.recv(2048))
        return found


@contextmanager
def attached(source: object, **options: object) -> Iterator[tuple[Emulator, Client, list[str]]]:
    """An emulator, a client of it, and the lines that it logs."""
    lines: list[str] = []
    with emulated(source, log=lines.append, **options) as (emulator, where), Client(emulator.port, where) as client:
        yield emulator, client, lines
