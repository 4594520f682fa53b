"""Commands to a DCA1000 that answers, refuses, or is absent."""

import socket
import threading

import pytest

from radarize.capture.board import CaptureCard, NetworkAddresses
from radarize.io.errors import InputError
from radarize.radar.dca1000_commands import Opcode, Reply, Request, Status, packet_settings
from radarize.radar.presets import PRESETS
from tests.virtual import SMALL, network


class Scripted:
    """A board that sends given replies; ignores the first `deaf` requests."""

    def __init__(self, statuses: dict[int, int] | None = None, deaf: int = 0):
        self.network, self.asked = network(), []
        self._statuses, self._deaf = statuses or {}, deaf
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((self.network.dca, self.network.command_port))
        self._socket.settimeout(0.05)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "Scripted":
        self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._closed.set()
        self._thread.join()
        self._socket.close()

    def send(self, reply: bytes) -> None:
        self._socket.sendto(reply, (self.network.host, self.network.command_port))

    def _serve(self) -> None:
        while not self._closed.is_set():
            try:
                request = Request.decode(self._socket.recv(2048))
            except TimeoutError:
                continue
            self.asked.append(request)
            if len(self.asked) > self._deaf:
                self.send(Reply(Opcode.STATUS, 0).encode())  # not what was asked for
                self.send(b"\x5a\xa5")
                self.send(Reply(request.command, self._statuses.get(request.command, 0)).encode())


def test_configuration_in_the_order_of_the_manual():
    with Scripted({Opcode.VERSION: 0x0402}) as board, CaptureCard(board.network) as client:
        assert client.configure(SMALL) == "2.8"
        client.start()
        client.stop()
    names = ["ALIVE", "RESET_FPGA", "VERSION", "CONFIGURE", "PACKETS", "START", "STOP"]
    assert [Opcode(request.command).name for request in board.asked] == names
    assert board.asked[3].body.hex() == "01020102031e" and board.asked[4].body.hex() == "be05350c0000"


def test_more_data_gets_shorter_pauses():
    rates = {36: 25e-6, 240: 25e-6, 300: 10e-6, 500: 5e-6, 700: 5e-6}
    with Scripted() as board, CaptureCard(board.network) as client:
        for rate, delay in rates.items():
            client.configure(SMALL.model_copy(update={"frame_period": 8e-6 * SMALL.frame_bytes / rate}))
            assert board.asked[-1].body == packet_settings(delay)
        with pytest.raises(InputError, match="sends 800 Mbit/s, expected at most the DCA1000's 706"):
            client.configure(SMALL.model_copy(update={"frame_period": 8e-6 * SMALL.frame_bytes / 800}))


def test_a_request_that_is_lost_is_repeated(monkeypatch):
    monkeypatch.setattr("radarize.capture.board._PATIENCE", 0.1)
    with Scripted(deaf=2) as board, CaptureCard(board.network) as client:
        client.request(Opcode.ALIVE)
    assert len(board.asked) == 3


def test_no_board_and_a_board_that_refuses(monkeypatch):
    monkeypatch.setattr("radarize.capture.board._PATIENCE", 0.1)
    with CaptureCard(network()) as client:
        with pytest.raises(InputError, match="no DCA1000 answers ALIVE at UDP port .* powered"):
            client.configure(PRESETS["radarize"])
    with Scripted({Opcode.START: 1}) as board, CaptureCard(board.network) as client:
        with pytest.raises(InputError, match="answers START with status 1, expected 0"):
            client.start()


def test_replies_of_others_are_not_heard(monkeypatch):
    monkeypatch.setattr("radarize.capture.board._PATIENCE", 0.2)
    where = network()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as forger, CaptureCard(where) as client:
        forger.bind(("127.0.0.3", where.command_port))  # the board's own port, but not its address
        for reply in (
            Reply(Opcode.ALIVE),
            Reply(Opcode.VERSION, 0x0402),
            Reply(Opcode.STATUS, Status.NO_LVDS),
        ):
            forger.sendto(reply.encode(), (where.host, where.command_port))
        assert client.status(0.1) == Status(0)
        forger.sendto(Reply(Opcode.ALIVE).encode(), (where.host, where.command_port))
        with pytest.raises(InputError, match="no DCA1000 answers ALIVE.*127.0.0.3:.* sent something instead"):
            client.request(Opcode.ALIVE)


def test_nor_are_those_from_another_port_of_the_board(monkeypatch):
    with Scripted() as board, CaptureCard(board.network) as client:
        client.request(Opcode.ALIVE)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as forger:
            forger.bind((board.network.dca, 0))
            for reply in (Reply(Opcode.START, 1), Reply(Opcode.STATUS, Status.MEMORY_FULL)):
                forger.sendto(reply.encode(), (board.network.host, board.network.command_port))
        client.start()
        assert client.status(0.1) == Status(0)


def test_a_forged_failure_and_noise_stop_nothing():
    with Scripted() as board, CaptureCard(board.network) as client:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as forger:
            forger.bind(("127.0.0.3", 0))
            for data in (Reply(Opcode.START, 1).encode(), b"noise"):
                forger.sendto(data, (board.network.host, board.network.command_port))
        client.start()
        board.send(b"noise")
        board.send(Reply(Opcode.STATUS, Status.NO_LVDS).encode())
        assert client.status(0.2) == Status.NO_LVDS  # what comes after a datagram that cannot be read is heard


def test_what_the_board_reports_on_its_own():
    with Scripted() as board, CaptureCard(board.network) as client:
        assert client.troubles() == []
        board.send(Reply(Opcode.STATUS, Status.NO_LVDS).encode())
        board.send(Reply(Opcode.STATUS, Status.RECORD_COMPLETED).encode())
        assert client.status(0.2) == Status.NO_LVDS | Status.RECORD_COMPLETED
        assert len(client.troubles()) == 1 and "ribbon cable" in client.troubles()[0]


def test_addresses_that_cannot_be_used():
    with pytest.raises(InputError, match="--host 192.0.2.7: no network interface .*sudo ip address add 192.0.2.7/24"):
        CaptureCard(NetworkAddresses(host="192.0.2.7"))
    where = network()
    with (
        CaptureCard(where),
        pytest.raises(InputError, match=f"UDP port {where.command_port} is taken.*another capture"),
    ):
        CaptureCard(where)
