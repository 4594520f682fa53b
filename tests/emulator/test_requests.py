"""Replies of the virtual DCA1000 to requests."""

import struct

import pytest

from radarize.radar.dca1000_commands import RAW_TWO_LANES, Opcode, Reply, Request, packet_settings, read_packet_settings
from tests.emulator.captures import captured


def test_replies_are_those_of_a_real_board(playing, recordings):
    client, _, _ = playing
    real = [payload for _, port, payload in captured(recordings / "iwr1843-pcap/test_cmd.pcap") if port == 4096]
    assert len(real) == 10
    bodies = {
        Opcode.CONFIGURE: RAW_TWO_LANES,
        Opcode.PACKETS: packet_settings(),
        Opcode.EEPROM: bytes(18),
    }
    for payload in real:
        expected = Reply.decode(payload[:8])
        assert client.ask(expected.command, bodies.get(expected.command, b"")) == expected


@pytest.mark.parametrize(
    "command, body, message",
    [
        (Opcode.CONFIGURE, bytes([1, 1, 1, 2, 3, 30]), "expected 01 02 01 02 03 1e"),
        (Opcode.PACKETS, packet_settings()[:4], "packet settings of 4 bytes"),
        (Opcode.PACKETS, bytes([0xBE, 5, 1, 0, 0, 0]), "packet delay is 0.008 us"),
        (Opcode.PACKETS, struct.pack("<3H", 47, 3125, 0), "packet size is 47 bytes, expected 48-1472"),
        (Opcode.PACKETS, struct.pack("<3H", 1473, 3125, 0), "packet size is 1473 bytes, expected 48-1472"),
        (Opcode.START_PLAYBACK, b"", "request 7 fails"),
        (99, b"", "request 99 fails"),
    ],
)
def test_requests_that_fail(playing, command, body, message):
    client, _, lines = playing
    assert client.ask(command, body) == Reply(command, 1)
    assert message in lines[-1]


@pytest.mark.parametrize(
    ("size", "ticks", "expected"),
    [(1472, 3125, (25e-6, 1456)), (1470, 625, (5e-6, 1456)), (48, 3125, (25e-6, 34)), (1472, 25, (0.2e-6, 1456))],
)
def test_packet_sizes_of_other_programs(playing, size, ticks, expected):
    """1472 and 25 us are TI's defaults; xwr_raw_ros writes microseconds for ticks of 8 ns."""
    client, _, _ = playing
    body = struct.pack("<3H", size, ticks, 0)
    assert client.ask(Opcode.PACKETS, body) == Reply(Opcode.PACKETS, 0)
    assert read_packet_settings(body) == pytest.approx(expected)


def test_damaged_requests_get_no_reply(playing):
    client, _, lines = playing
    good = Request(Opcode.ALIVE).encode()
    for damaged in (b"", good[:-1], b"\0" + good[1:], good[:4] + b"\1" + good[5:], b"x" * 2000):
        client.commands.sendto(damaged, client.board)
    assert client.ask(Opcode.ALIVE) == Reply(Opcode.ALIVE, 0)
    assert sum("no reply" in line for line in lines) == 5
