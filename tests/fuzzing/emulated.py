"""Inputs of the emulated radar and capture card: lines of the serial port, and requests of the network."""

from types import SimpleNamespace

from hypothesis import strategies as st

from radarize.io.errors import InputError
from radarize.radar.cfg import write_cfg
from radarize.radar.dca1000_commands import RAW_TWO_LANES, Opcode, Request, packet_settings
from radarsim.emulator.board import Board
from radarsim.emulator.commandline import CommandLine
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.reader import CONFIG, Reader


def command_line() -> Reader:
    """Session on the serial port: a configuration and a start, misspelled, and further commands."""
    whole = write_cfg(CONFIG)

    def read(text: str) -> None:
        radar = SimpleNamespace(start=lambda config, frames: None, stop=lambda: None)
        line = CommandLine(radar)
        for each in text.splitlines():
            answer = line.execute(each)
            assert isinstance(answer, str) and len(answer) < 2000 + len(each)

    inputs = misspelled([whole, whole + "sensorStop\nsensorStart 0\n", whole + "sensorStop\nflushCfg\n" + whole])
    return Reader(inputs, lambda data, folder: data.decode("utf-8", "replace"), read)


def board() -> Reader:
    """Sequence of damaged requests."""
    sound = [Request(command).encode() for command in Opcode]
    sound += [
        Request(Opcode.CONFIGURE, RAW_TWO_LANES).encode(),
        Request(Opcode.PACKETS, packet_settings()).encode(),
        Request(Opcode.EEPROM, bytes(18)).encode(),
    ]

    def read(stream: list[bytes]) -> None:
        link = SimpleNamespace(recording=False, start=lambda gap, size: None, stop=lambda: None)
        board = Board(link, lambda: None, lambda words: None)
        for data in stream:
            try:
                request = Request.decode(data)
            except InputError:
                continue  # as the board's socket does
            assert 0 <= board.execute(request) < 1 << 16

    inputs = st.lists(st.one_of(st.sampled_from(sound), damaged(sound)), min_size=1, max_size=8)
    return Reader(inputs, lambda stream, folder: stream, read, lambda stream: sum(map(len, stream)))
