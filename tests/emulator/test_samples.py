"""Samples of the virtual radar: values, timing, and configuration."""

import errno
import select
import time

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.cfg import write_cfg
from radarize.radar.dca1000 import Packet, decode, encode
from radarize.radar.dca1000_commands import Opcode, Reply, Request, Status
from radarsim.emulator.commandline import PROMPT
from radarsim.emulator.disturbance import Disturbance
from radarsim.emulator.simulation import Simulation
from radarsim.emulator.source import Playback
from radarsim.motion.walk import Walk
from radarsim.recording.simulate import simulate
from tests.dataset import hall
from tests.emulator.client import SMALL, attached
from tests.packets import packets
from tests.virtual import CONFIG, record


def test_a_capture_by_hand(playing):
    """Every byte; the last packet is 2 s late, followed by the status, as on the real board."""
    client, adc, lines = playing
    client.record()
    assert all("Error" not in answer for answer in client.configure(SMALL))
    received = [client.data.recv(2048) for _ in range(adc.size * 2 // 1456)]
    before = time.monotonic()
    received.append(client.data.recv(2048))
    assert time.monotonic() - before == pytest.approx(2, abs=0.3)
    assert Reply.decode(client.commands.recvfrom(2048)[0]) == Reply(Opcode.STATUS, Status.RECORD_COMPLETED)
    assert received == [packet.encode() for packet in packets(encode(adc, SMALL).tobytes())]
    assert any("end of the source; 12 frames sent" in line for line in lines)
    # Once more: the recording starts again, and so do the counts; this time the client stops.
    client.command("sensorStop")
    client.record()
    client.command("sensorStart 0")
    again = [client.data.recv(2048) for _ in range(10)]
    assert again == received[:10]
    assert client.ask(Opcode.STOP) == Reply(Opcode.STOP, 0)


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
        client.command(line.replace(" 4 0 20 1 0", " 4 3 20 1 0"))
    assert len(client.packets()) == 3 * SMALL.frame_bytes // 1456


def test_frames_keep_their_period_and_chirps_theirs(tmp_path):
    record(tmp_path / "r.h5", CONFIG, 25)
    with attached(tmp_path / "r.h5") as (emulator, client, _):
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
    # A busy machine holds packets up, but none is early: the earliest ones of each quarter give the radar's clock,
    quarters = behind[: len(behind) // 4 * 4].reshape(4, -1).min(axis=1)
    assert np.ptp(quarters) < 5e-3 + slipped
    # and those of each chirp its place in the burst: spread over the period, the last would be 31 ms late.
    first = np.minimum.reduceat(behind, np.unique(frame, return_index=True)[1])
    late = [np.min((behind - first[frame])[chirp == k]) for k in range(96)]
    assert max(late) < 5e-3


def test_sensor_stop_ends_with_a_whole_frame(tmp_path):
    record(tmp_path / "r.h5", CONFIG, 5)
    with attached(Playback(tmp_path / "r.h5", loop=True)) as (emulator, client, _):
        client.record()
        client.configure(CONFIG)
        for _ in range(7 * CONFIG.frame_bytes // 1456):  # more frames than there are: it loops
            client.data.recv(2048)
        assert client.command("sensorStop").endswith("sensorStop\nDone\n\r" + PROMPT)
        frames = emulator.frames
        client.ask(Opcode.STOP)
        time.sleep(0.1)
        assert emulator.frames == frames >= 7
        assert emulator.link.packets == -(-frames * CONFIG.frame_bytes // 1456)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"samples": 16}, "samples is 16, expected 32"),
        ({"tx_order": (0, 2, 1)}, r"tx_order is \(0, 2, 1\), expected \(0, 1, 2\)"),
        ({"frame_period": 25e-3}, "frame_period is 0.025, expected 0.02"),
    ],
)
def test_another_configuration_than_the_recordings_is_refused(playing, change, message):
    client, _, lines = playing
    answer = client.configure(SMALL.model_copy(update=change))[-1]
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(answer)
    assert answer.endswith("Error -1\n\r" + PROMPT)
    with pytest.raises(AssertionError, match=f"refused: {message}"):
        raise AssertionError(lines[-1])


def test_roundings_of_other_programs_are_taken(playing):
    """xwr_raw_ros writes two digits: 33.33 ms for 33.333."""
    client, _, _ = playing
    rounded = SMALL.model_copy(update={"frame_period": SMALL.frame_period * 33.33 / 33.333})
    assert client.configure(rounded)[-1].endswith("Done\n\r" + PROMPT)


def test_2500_packets_through_a_bad_network(tmp_path):
    """The packets that arrive, and their order, follow from the seed."""
    adc = record(tmp_path / "r.h5", CONFIG, 15)
    shares = (0.04, 0.04, 0.08, 0.008)
    network = Disturbance(*shares, rng=np.random.default_rng(7))
    with attached(Playback(tmp_path / "r.h5", loop=True), disturbance=network) as (emulator, client, _):
        client.record(delay=5e-6)
        client.configure(CONFIG)
        received = []
        while emulator.link.packets < 2_600:
            received += client.packets(silence=0.005)
        client.command("sensorStop")
        client.ask(Opcode.STOP)
        received += client.packets()
        count = emulator.frames
    whole = encode(adc, CONFIG).tobytes()
    sent = packets((whole * (count // 15 + 1))[: count * CONFIG.frame_bytes])
    again = Disturbance(*shares, rng=np.random.default_rng(7))
    expected = [data for packet in sent for data in again(packet.encode())] + list(again.rest())
    assert len(expected) > 2_500 and again.lost > 50 and again.duplicated > 50 and again.reordered > 100
    assert received == expected


def test_a_source_that_is_too_slow_makes_frames_late_with_a_warning(tmp_path):
    adc = record(tmp_path / "r.h5", SMALL, 12)
    with attached(Slow(tmp_path / "r.h5"), ahead=0) as (emulator, client, lines):
        client.record()
        client.configure(SMALL)
        received = b"".join(Packet.decode(data).payload for data in client.packets())
        assert emulator.frames == 12 and emulator.late >= 5 and emulator.lateness > 0.1
    assert any("late: the source is too slow" in line for line in lines)
    assert received == encode(adc, SMALL).tobytes()[: len(received)] and len(received) > 11 * SMALL.frame_bytes


class Slow(Playback):
    def frames(self, config):
        for frame in super().frames(config):
            time.sleep(0.06)
            yield frame


def test_a_scene_is_simulated_as_simulate_does_it(tmp_path):
    (tmp_path / "hall.yaml").write_text(hall.HALL)
    (tmp_path / "small.cfg").write_text(write_cfg(SMALL))
    same = {"seed": 3, "radar": str(tmp_path / "small.cfg")}
    way = {"platform": "cart", "duration": 0.2, "waypoints": np.array(hall.WAY)}
    with Recording(simulate(tmp_path / "hall.yaml", tmp_path / "hall.h5", **same, **way)) as recording:
        expected = encode(recording.adc(0, len(recording)), SMALL).tobytes()
    walk = Simulation(str(tmp_path / "hall.yaml"), Walk(**way), **same)
    with attached(walk) as (emulator, client, lines):
        client.record()
        assert client.configure(SMALL)[-1].endswith("Done\n\r" + PROMPT)
        arrived = []
        while not any("end of the source" in line for line in lines):
            arrived += client.packets(silence=0.1)
            assert emulator.ready >= 0  # or the source's own error
        received = b"".join(Packet.decode(data).payload for data in arrived)
    assert received == expected[: len(received)] and len(expected) - len(received) < 1456


class Cut:
    """A socket that fails as if its cable were unplugged."""

    def sendto(self, *_: object) -> None:
        raise OSError(errno.ENETUNREACH, "Network is unreachable")


def test_an_unplugged_cable_loses_packets_and_stops_nothing(tmp_path, monkeypatch):
    record(tmp_path / "r.h5", SMALL, 5)
    with attached(Playback(tmp_path / "r.h5", loop=True)) as (emulator, client, lines):
        client.record()
        with monkeypatch.context() as cut:
            cut.setattr(emulator._sockets, "_out", Cut())
            assert client.configure(SMALL)[-1].endswith("Done\n\r" + PROMPT)
            waited = time.monotonic() + 5
            while emulator.frames < 3:
                assert time.monotonic() < waited and emulator._thread.is_alive()
                time.sleep(0.01)
            client.commands.sendto(Request(Opcode.ALIVE).encode(), client.board)  # whose reply is lost
            time.sleep(0.1)
        assert select.select([client.data], [], [], 5)[0]  # plugged in again
        assert "Done" in client.command("sensorStop")
        assert client.ask(Opcode.ALIVE) == Reply(Opcode.ALIVE, 0)
        assert sum("are lost (Network is unreachable)" in line for line in lines) == 1


def test_a_reset_while_it_starts_is_not_forgotten(tmp_path, monkeypatch):
    record(tmp_path / "r.h5", SMALL, 5)
    with attached(Playback(tmp_path / "r.h5", loop=True)) as (emulator, _, lines):
        prepare = emulator._prepare
        monkeypatch.setattr(emulator, "_prepare", lambda config: (prepare(config), emulator._reset()))
        with pytest.raises(InputError, match="reset while it started"):
            emulator.start(SMALL, 0)
        time.sleep(0.1)
        assert emulator.frames == 0 and not any("started," in line for line in lines)
