"""The virtual radar from outside: a serial port, UDP, and what a client gets that knows nothing of this project."""

import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
import serial

from radarize.errors import InputError
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import Packet, decode, encode, packets
from radarize.radar.dca1000_commands import RAW_TWO_LANES, Command, Reply, Request, Status, packet_settings
from radarize.radar.presets import PRESETS
from radarize.recording import Recording
from radarsim.emulator.commandline import PROMPT
from radarsim.emulator.disturbance import Disturbance
from radarsim.emulator.emulator import Emulator
from radarsim.emulator.source import Playback, Walk
from tests.emulator.captures import captured
from tests.emulator.rig import BOARD, COMPUTER, CONFIG, emulator, free_ports, record

SMALL = CONFIG.model_copy(update={"loops": 4, "samples": 32, "frame_period": 20e-3})


class Client:
    """Any capture software: a serial port, and two sockets as a DCA1000 wants them."""

    def __init__(self, port: str, ports: tuple[int, int]):
        self.serial = serial.Serial(port, 115200, timeout=150)
        self.commands, self.data = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.commands.bind((COMPUTER, ports[0]))
        self.data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.data.bind((COMPUTER, ports[1]))
        self.commands.settimeout(5)
        self.board = (BOARD, ports[0])

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_) -> None:
        self.serial.close()
        self.commands.close()
        self.data.close()

    def say(self, line: str, ending: str = "\n") -> str:
        """What comes back for a line, up to the prompt."""
        self.serial.write((line + ending).encode())
        return self.serial.read_until(PROMPT.encode()).decode()

    def configure(self, config: RadarConfig) -> list[str]:
        return [self.say(line) for line in write_cfg(config).splitlines()]

    def ask(self, command: Command, body: bytes = b"") -> Reply:
        self.commands.sendto(Request(command, body).encode(), self.board)
        return Reply.decode(self.commands.recvfrom(2048)[0])

    def record(self, delay: float = 25e-6) -> None:
        for command, body in (
            (Command.ALIVE, b""),
            (Command.RESET_FPGA, b""),
            (Command.CONFIGURE, RAW_TWO_LANES),
            (Command.PACKETS, packet_settings(delay)),
            (Command.START, b""),
        ):
            assert self.ask(command, body) == Reply(command, 0)

    def packets(self, silence: float = 0.5) -> list[bytes]:
        """Data packets until none comes for so long."""
        found = []
        while select.select([self.data], [], [], silence)[0]:
            found.append(self.data.recv(2048))
        return found


@contextmanager
def emulated(source: object, **options: object) -> Iterator[tuple[Emulator, Client, list[str]]]:
    """An emulator, a client of it, and what it tells its user."""
    ports = free_ports()
    said: list[str] = []
    with Emulator(source, command_port=ports[0], data_port=ports[1], say=said.append, **options) as emulator:
        with Client(emulator.port, ports) as client:
            yield emulator, client, said


@pytest.fixture
def playing(tmp_path) -> Iterator[tuple[Client, np.ndarray, list[str]]]:
    """A small recording, played."""
    adc = record(tmp_path / "small.h5", SMALL, 12)
    with emulated(Playback(tmp_path / "small.h5")) as (_, client, said):
        yield client, adc, said


# --- the serial port --------------------------------------------------------------------------------------------------
def test_echo_answer_and_prompt(playing):
    client, _, _ = playing
    assert client.say("sensorStop") == "sensorStop\nIgnored: Sensor is already stopped\n\rDone\n\r" + PROMPT
    assert client.say("nonsense 1 2") == "nonsense 1 2\n'nonsense' is not recognized as a CLI command\n\r" + PROMPT
    assert client.say("") == "\n" + PROMPT
    # After "\r\n", as from a terminal program, the firmware prompts twice.
    assert client.say("% hello", "\r\n") == "% hello\r\nSkipped\n\r" + PROMPT
    assert client.serial.read_until(PROMPT.encode()) == b"\n" + PROMPT.encode()


def test_characters_take_their_time(playing):
    client, _, _ = playing
    start = time.monotonic()
    answer = client.say("x" * 200)
    assert time.monotonic() - start > len(answer) * 10 / 115200


def test_the_wrong_baud_rate_gives_garbage(playing):
    client, _, _ = playing
    client.serial.baudrate = 921600
    client.serial.timeout = 0.3
    client.serial.write(b"sensorStop\n")
    answer = client.serial.read(1000)
    assert len(answer) == 11 and not any(32 <= byte < 127 for byte in answer)
    client.serial.baudrate = 115200
    assert client.say("version").endswith("Done\n\r" + PROMPT)


def test_the_board_resets_the_radar(playing):
    client, _, said = playing
    client.configure(SMALL)
    assert client.ask(Command.RESET_RADAR) == Reply(Command.RESET_RADAR, 0)
    client.serial.write(b"sensorStop\n")  # into the void: the radar is booting
    banner = client.serial.read_until(PROMPT.encode()).decode()
    assert "xWR18xx MMW Demo" in banner and "sensorStop" not in banner
    assert "Full configuration must be provided" in client.say("sensorStart 0")
    assert "board: radar reset" in said


def test_a_link_names_the_port_and_goes_away(tmp_path):
    record(tmp_path / "small.h5", SMALL, 1)
    link = tmp_path / "tty"
    for _ in range(2):
        with emulated(Playback(tmp_path / "small.h5"), port_link=link) as (emulator, client, _):
            assert os.readlink(link) == emulator.port
            assert client.say("flushCfg").startswith("flushCfg\nDone")
        assert not link.is_symlink()
    link.write_text("something of the user's")
    with (
        pytest.raises(InputError, match="cannot become a link"),
        emulated(Playback(tmp_path / "small.h5"), port_link=link),
    ):
        pass
    assert link.read_text() == "something of the user's"


# --- the board --------------------------------------------------------------------------------------------------------
def test_replies_are_those_of_a_real_board(playing, recordings):
    client, _, _ = playing
    real = [payload for _, port, payload in captured(recordings / "iwr1843-pcap/test_cmd.pcap") if port == 4096]
    assert len(real) == 10
    bodies = {Command.CONFIGURE: RAW_TWO_LANES, Command.PACKETS: packet_settings(), Command.EEPROM: bytes(18)}
    for payload in real:
        expected = Reply.decode(payload[:8])
        assert client.ask(expected.command, bodies.get(expected.command, b"")) == expected


@pytest.mark.parametrize(
    "command, body, says",
    [
        (Command.CONFIGURE, bytes([1, 1, 1, 2, 3, 30]), "expected 01 02 01 02 03 1e"),
        (Command.PACKETS, packet_settings()[:4], "packet settings of 4 bytes"),
        (Command.PACKETS, bytes([0xBE, 5, 1, 0, 0, 0]), "packet delay is 0.008 us"),
        (Command.START_PLAYBACK, b"", "request 7 fails"),
        (99, b"", "request 99 fails"),
    ],
)
def test_requests_that_fail(playing, command, body, says):
    client, _, said = playing
    assert client.ask(command, body) == Reply(command, 1)
    assert says in said[-1]


def test_damaged_requests_get_no_reply(playing):
    client, _, said = playing
    good = Request(Command.ALIVE).encode()
    for damaged in (b"", good[:-1], b"\0" + good[1:], good[:4] + b"\1" + good[5:], b"x" * 2000):
        client.commands.sendto(damaged, client.board)
    assert client.ask(Command.ALIVE) == Reply(Command.ALIVE, 0)
    assert sum("no reply" in line for line in said) == 5


# --- the samples ------------------------------------------------------------------------------------------------------
def test_a_capture_by_hand(playing):
    """Every byte; the last packet 2 s late, then the status: as the real board does it."""
    client, adc, said = playing
    client.record()
    assert all("Error" not in answer for answer in client.configure(SMALL))
    received = [client.data.recv(2048) for _ in range(adc.size * 2 // 1456)]
    before = time.monotonic()
    received.append(client.data.recv(2048))
    assert time.monotonic() - before == pytest.approx(2, abs=0.3)
    assert Reply.decode(client.commands.recvfrom(2048)[0]) == Reply(Command.STATUS, Status.RECORD_COMPLETED)
    assert received == [packet.encode() for packet in packets(encode(adc, SMALL).tobytes())]
    assert any("end of the source; 12 frames sent" in line for line in said)
    # Once more: the recording starts again, and so do the counts; this time the client stops.
    client.say("sensorStop")
    client.record()
    client.say("sensorStart 0")
    again = [client.data.recv(2048) for _ in range(10)]
    assert again == received[:10]
    assert client.ask(Command.STOP) == Reply(Command.STOP, 0)


def test_q_first_or_i_first_as_the_configuration_says(playing):
    client, adc, _ = playing
    other = SMALL.model_copy(update={"iq_order": "iiqq"})
    client.record()
    client.configure(other)
    received = b"".join(Packet.decode(data).payload for data in client.packets())
    words = np.frombuffer(received, "<i2")[: SMALL.frame_bytes // 2 * 11]
    assert np.array_equal(decode(words, other), adc[:11])


def test_a_number_of_frames(playing):
    client, _, _ = playing
    client.record()
    for line in write_cfg(SMALL).splitlines():
        client.say(line.replace(" 4 0 20 1 0", " 4 3 20 1 0"))
    assert len(client.packets()) == 3 * SMALL.frame_bytes // 1456


def test_frames_keep_their_period_and_chirps_theirs(tmp_path):
    record(tmp_path / "r.h5", CONFIG, 25)
    with emulated(Playback(tmp_path / "r.h5")) as (emulator, client, _):
        client.record()
        client.configure(CONFIG)
        arrivals, offsets = [], []
        while select.select([client.data], [], [], 0.5)[0]:
            offsets.append(Packet.decode(client.data.recv(2048)).offset)
            arrivals.append(time.monotonic())
        slipped = emulator.lateness
    frame, within = np.divmod(np.array(offsets) + 1455, CONFIG.frame_bytes)
    chirp = within // (CONFIG.frame_bytes // 96)
    due = frame * CONFIG.frame_period + (chirp + 1) * CONFIG.chirp_time
    behind = np.array(arrivals) - due
    # A busy machine holds packets up, but none is early: the most punctual ones of each quarter tell the radar's clock.
    quarters = behind[: len(behind) // 4 * 4].reshape(4, -1).min(axis=1)
    assert np.ptp(quarters) < 5e-3 + slipped
    assert np.diff(arrivals).max() > CONFIG.frame_period - CONFIG.burst_time - 5e-3  # the pause between frames


def test_sensor_stop_ends_with_a_whole_frame(tmp_path):
    record(tmp_path / "r.h5", CONFIG, 5)
    with emulated(Playback(tmp_path / "r.h5", loop=True)) as (emulator, client, _):
        client.record()
        client.configure(CONFIG)
        for _ in range(7 * CONFIG.frame_bytes // 1456):  # more frames than there are: it loops
            client.data.recv(2048)
        assert client.say("sensorStop").endswith("sensorStop\nDone\n\r" + PROMPT)
        frames = emulator.frames
        client.ask(Command.STOP)
        time.sleep(0.1)
        assert emulator.frames == frames >= 7
        assert emulator.link.packets == -(-frames * CONFIG.frame_bytes // 1456)


@pytest.mark.parametrize(
    "change, says",
    [
        ({"samples": 16}, "samples is 16, expected 32"),
        ({"tx_order": (0, 2, 1)}, r"tx_order is \(0, 2, 1\), expected \(0, 1, 2\)"),
        ({"frame_period": 25e-3}, "frame_period is 0.025, expected 0.02"),
    ],
)
def test_another_configuration_than_the_recordings_is_refused(playing, change, says):
    client, _, said = playing
    answer = client.configure(SMALL.model_copy(update=change))[-1]
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(answer)
    assert answer.endswith("Error -1\n\r" + PROMPT)
    with pytest.raises(AssertionError, match=f"refused: {says}"):
        raise AssertionError(said[-1])


def test_10000_packets_through_a_bad_network(tmp_path):
    """What arrives is what the seed says, in that order."""
    adc = record(tmp_path / "r.h5", CONFIG, 15)
    shares = (0.01, 0.01, 0.02, 0.002)
    network = Disturbance(*shares, rng=np.random.default_rng(7))
    with emulated(Playback(tmp_path / "r.h5", loop=True), disturbance=network) as (emulator, client, _):
        client.record(delay=5e-6)
        client.configure(CONFIG)
        received = []
        while emulator.link.packets < 10_100:
            received += client.packets(silence=0.005)
        client.say("sensorStop")
        client.ask(Command.STOP)
        received += client.packets()
        count = emulator.frames
    whole = encode(adc, CONFIG).tobytes()
    sent = packets((whole * (count // 15 + 1))[: count * CONFIG.frame_bytes])
    again = Disturbance(*shares, rng=np.random.default_rng(7))
    expected = [data for packet in sent for data in again(packet.encode())] + list(again.rest())
    assert len(expected) > 10_000 and again.lost > 50 and again.duplicated > 50 and again.reordered > 100
    assert received == expected


def test_a_source_that_is_too_slow_makes_frames_late_and_says_so(tmp_path):
    adc = record(tmp_path / "r.h5", SMALL, 8)
    with emulated(Slow(tmp_path / "r.h5"), ahead=0) as (emulator, client, said):
        client.record()
        client.configure(SMALL)
        received = b"".join(Packet.decode(data).payload for data in client.packets())
        assert emulator.frames == 8 and emulator.late >= 5 and emulator.lateness > 0.1
    assert any("late: the source is too slow" in line for line in said)
    assert received == encode(adc, SMALL).tobytes()[: len(received)] and len(received) > 7 * SMALL.frame_bytes


class Slow(Playback):
    def frames(self, config):
        for frame in super().frames(config):
            time.sleep(0.06)
            yield frame


def test_a_scene_is_simulated_as_simulate_does_it(tmp_path):
    from radarsim.simulate import simulate

    (tmp_path / "small.cfg").write_text(write_cfg(SMALL))
    simulate("office", tmp_path / "office.h5", duration=0.2, seed=3, radar=str(tmp_path / "small.cfg"))
    with Recording(tmp_path / "office.h5") as recording:
        expected = encode(recording.adc(0, len(recording)), SMALL).tobytes()
    walk = Walk("office", duration=0.2, seed=3, radar=str(tmp_path / "small.cfg"))
    with emulated(walk) as (emulator, client, said):
        client.record()
        assert client.configure(SMALL)[-1].endswith("Done\n\r" + PROMPT)
        arrived = []
        while not any("end of the source" in line for line in said):
            arrived += client.packets(silence=0.1)
            assert emulator.ready >= 0  # or the source's own error
        received = b"".join(Packet.decode(data).payload for data in arrived)
    assert received == expected[: len(received)] and len(expected) - len(received) < 1456


# --- the command line, and an independent client ----------------------------------------------------------------------
def test_xwr_captures_what_was_recorded(tmp_path):
    """The client `xwr` (PyPI), from the command line's emulator: configures, captures, gets the samples."""
    from xwr import DCAConfig, XWRConfig, XWRSystem

    adc = record(tmp_path / "r.h5", CONFIG, 25)
    with emulator(tmp_path / "r.h5", tmp_path) as running:
        radar = XWRConfig(
            device="AWR1843", frequency=77.0, idle_time=30.0, adc_start_time=5.0, ramp_end_time=60.0, tx_start_time=1.0,
            freq_slope=60.0, adc_samples=128, sample_rate=5000, frame_length=32, frame_period=40.0,
            port=str(running.port),
        )  # fmt: skip
        capture = DCAConfig(
            sys_ip=COMPUTER, fpga_ip=BOARD, config_port=running.command_port, data_port=running.data_port, delay=25.0
        )
        system = XWRSystem(radar=radar, capture=capture, strict=True)
        frames = list(system.stream())
        system.stop()
    assert "25 frames sent" in running.said
    # The end of the 25th frame comes 2 s late, after xwr has given up.
    assert len(frames) == 24 and all(frame.complete for frame in frames)
    received = np.stack([np.frombuffer(frame.data, "<i2") for frame in frames]).reshape(24, *radar.raw_shape)
    q0, q1, i0, i1 = (received[..., n::4] for n in range(4))
    samples = np.stack([np.stack([i0, i1], -1), np.stack([q0, q1], -1)], -1).reshape(24, *CONFIG.frame_shape)
    assert np.array_equal(samples, adc[:24])


def test_our_own_capture_loses_nothing_in_10_s(tmp_path):
    """The preset `radarize`, 30 frames/s, both command lines in processes of their own."""
    preset = PRESETS["radarize"]
    adc = record(tmp_path / "r.h5", preset, 30)
    with emulator(tmp_path / "r.h5", tmp_path, "--loop") as running:
        captured = subprocess.run(
            [
                sys.executable, "-m", "radarize.cli", "capture", "--config", "radarize", "--port", running.port,
                "--host", COMPUTER, "--dca", BOARD, "--command-port", str(running.command_port),
                "--data-port", str(running.data_port), "--frames", "300", "-o", tmp_path / "out.h5",
            ],
            capture_output=True, text=True, timeout=300,
        )  # fmt: skip
    assert captured.returncode == 0, captured.stderr
    with Recording(tmp_path / "out.h5") as recording:
        assert recording.config == preset and recording.valid(0, 300).all()  # no packet lost
        numbers = np.round(recording.times / preset.frame_period).astype(int)
        for first in range(0, len(recording), 30):
            assert np.array_equal(recording.adc(first, first + 30), adc[numbers[first : first + 30] % 30])
        dropped = recording.attributes["warnings"]
        if dropped and os.getloadavg()[0] > 2 * len(os.sched_getaffinity(0)):
            pytest.skip(f"this machine is too busy to write 30 frames/s: {dropped}")
        assert len(recording) == 300 and dropped == ""


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["nowhere.h5"], "nowhere.h5: no such file"),
        (["nowhere"], "no scene 'nowhere'"),
        (["REC", "--board", "203.0.113.5"], "203.0.113.5:4096 cannot be the board's address"),
        (["REC", "--loss", "2"], "loss"),
    ],
)
def test_the_command_line_says_what_is_wrong(tmp_path, arguments, says):
    record(tmp_path / "r.h5", SMALL, 1)
    arguments = [str(tmp_path / "r.h5") if argument == "REC" else argument for argument in arguments]
    done = subprocess.run(
        [sys.executable, "-m", "radarsim.cli", "emulate", *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2 and says in done.stderr and done.stderr.count("\n") == 1, done.stderr
