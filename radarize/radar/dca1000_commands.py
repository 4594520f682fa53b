"""Commands of the DCA1000: requests and replies over UDP, and unsolicited status messages.

TI SPRUIJ4A, section 5, checked on real captures; all little-endian. Requests go to the board's port 4096, replies and
status to port 4096 of the computer, from any port of the board.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag

from radarize.io.errors import InputError
from radarize.radar.dca1000 import HEADER, MAX_PAYLOAD

COMMAND_PORT = 4096
COMPUTER_ADDRESS, BOARD_ADDRESS = "192.168.33.30", "192.168.33.180"  # as delivered
_START, _END = 0xA55A, 0xEEAA
_REQUEST_HEAD, _REPLY = struct.Struct("<HHH"), struct.Struct("<HHHH")
_MAX_BODY = 504
_PACKETS = struct.Struct("<HHH")
_TICK = 8e-9  # s, unit of the packet delay
_PACKET_HEAD = HEADER.size + 4  # counted in the packet size: the data header and 4 bytes more
#: Shortest and longest delay between packets, s.
DELAYS = (5e-6, 500e-6)
#: Bytes, sizes of packets that a board accepts; and s, its shortest accepted delay: xwr_raw_ros writes 25 where 25 us
#: are 3125 ticks, and boards then send at full speed.
SIZES, _MICROSECONDS_MEANT = (48, 1472), 25 * _TICK
#: Body of CONFIGURE: raw mode, two lanes, capture, over Ethernet, 16 bit, timer.
RAW_TWO_LANES = bytes([1, 2, 1, 2, 3, 30])
#: Status of VERSION: 2.8, major and minor in 7 bits each.
VERSION_2_8 = 2 | 8 << 7


class Opcode(IntEnum):
    """Codes of requests, repeated in replies."""

    RESET_FPGA = 1
    RESET_RADAR = 2
    CONFIGURE = 3
    EEPROM = 4
    START = 5
    STOP = 6
    START_PLAYBACK = 7
    STOP_PLAYBACK = 8
    ALIVE = 9
    STATUS = 10
    PACKETS = 11
    RADAR_MODE = 12
    INIT_PLAYBACK = 13
    VERSION = 14


class Status(IntFlag):
    """Bits of an unsolicited STATUS."""

    NO_LVDS = 1 << 0
    NO_HEADER = 1 << 1
    MEMORY_FULL = 1 << 7
    RECORD_COMPLETED = 1 << 8
    LVDS_BUFFER_FULL = 1 << 9


@dataclass(frozen=True)
class Request:
    """A command to the board."""

    command: int
    body: bytes = b""

    def encode(self) -> bytes:
        """UDP payload of the request."""
        return _REQUEST_HEAD.pack(_START, self.command, len(self.body)) + self.body + struct.pack("<H", _END)

    @classmethod
    def decode(cls, data: bytes) -> "Request":
        """Read a UDP payload.

        Raises:
            InputError: the frame around the body is damaged.
        """
        size = len(data) - _REQUEST_HEAD.size - 2
        if not 0 <= size <= _MAX_BODY:
            raise InputError(f"DCA1000 request of {len(data)} bytes, expected 8 to {_MAX_BODY + 8}")
        start, command, stated = _REQUEST_HEAD.unpack_from(data)
        if start != _START or stated != size or data[-2:] != struct.pack("<H", _END):
            raise InputError(f"DCA1000 request {data[:16].hex(' ')}, expected 5a a5, code, size, body, aa ee")
        return cls(command, bytes(data[_REQUEST_HEAD.size : -2]))


@dataclass(frozen=True)
class Reply:
    """Reply of the board to a request (status 0: success, 1: failure), or an unsolicited STATUS."""

    command: int
    status: int = 0

    def encode(self) -> bytes:
        """UDP payload of the reply."""
        return _REPLY.pack(_START, self.command, self.status, _END)

    @classmethod
    def decode(cls, data: bytes) -> "Reply":
        """Read a UDP payload.

        Raises:
            InputError: not a reply.
        """
        if len(data) != _REPLY.size or data[:2] != struct.pack("<H", _START) or data[-2:] != struct.pack("<H", _END):
            raise InputError(f"DCA1000 reply {data[:16].hex(' ')}, expected 5a a5, code, status, aa ee")
        _, command, status, _ = _REPLY.unpack(data)
        return cls(command, status)


def packet_settings(delay: float = 25e-6) -> bytes:
    """Body of PACKETS, for packets of `MAX_PAYLOAD` bytes of samples.

    Args:
        delay: between packets, s: 5, 10, 25 and 50 us let 706, 545, 325 and 193 Mbit/s through.

    Raises:
        InputError: the delay is outside `DELAYS`.
    """
    if not DELAYS[0] <= delay <= DELAYS[1]:
        raise InputError(f"packet delay is {delay * 1e6:g} us, expected 5-500 us")
    return _PACKETS.pack(MAX_PAYLOAD + _PACKET_HEAD, round(delay / _TICK), 0)


def read_packet_settings(body: bytes) -> tuple[float, int]:
    """Delay (s) and payload (bytes) in the body of PACKETS.

    TI's own program asks for packets of 1472 bytes, others for 1470: boards send 1456 bytes of samples for both.

    Raises:
        InputError: not such a body, or a value is out of range.
    """
    if len(body) != _PACKETS.size:
        raise InputError(f"packet settings of {len(body)} bytes, expected {_PACKETS.size}")
    size, ticks, _ = _PACKETS.unpack(body)
    delay = ticks * _TICK
    if not SIZES[0] <= size <= SIZES[1]:
        raise InputError(f"packet size is {size} bytes, expected {SIZES[0]}-{SIZES[1]}")
    if not _MICROSECONDS_MEANT <= delay <= DELAYS[1] + _TICK:
        raise InputError(f"packet delay is {delay * 1e6:g} us, expected 5-500 us")
    return delay, min(size - _PACKET_HEAD, MAX_PAYLOAD)
