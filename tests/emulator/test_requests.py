"""The virtual DCA1000's answers to requests from outside."""

import pytest

from radarize.radar.dca1000_commands import RAW_TWO_LANES, Opcode, Reply, Request, packet_settings
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
    "command, body, says",
    [
        (Opcode.CONFIGURE, bytes([1, 1, 1, 2, 3, 30]), "expected 01 02 01 02 03 1e"),
        (Opcode.PACKETS, packet_settings()[:4], "packet settings of 4 bytes"),
        (Opcode.PACKETS, bytes([0xBE, 5, 1, 0, 0, 0]), "packet delay is 0.008 us"),
        (Opcode.START_PLAYBACK, b"", "request 7 fails"),
        (99, b"", "request 99 fails"),
    ],
)
def test_requests_that_fail(playing, command, body, says):
    client, _, said = playing
    assert client.ask(command, body) == Reply(command, 1)
    assert says in said[-1]


def test_damaged_requests_get_no_reply(playing):
    client, _, said = playing
    good = Request(Opcode.ALIVE).encode()
    for damaged in (b"", good[:-1], b"\0" + good[1:], good[:4] + b"\1" + good[5:], b"x" * 2000):
        client.commands.sendto(damaged, client.board)
    assert client.ask(Opcode.ALIVE) == Reply(Opcode.ALIVE, 0)
    assert sum("no reply" in line for line in said) == 5
