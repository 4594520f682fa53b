"""Packets of the emulated board and their times, against the standard and a real capture; network faults."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarize.io.errors import InputError
from radarize.radar.assembler import FrameAssembler
from radarize.radar.dca1000 import Packet, decode, encode
from radarize.radar.dca1000_commands import Status
from radarsim.emulator.disturbance import DELAYED, REORDERED, Disturbance
from radarsim.emulator.link import Link
from tests.emulator.captures import captured
from tests.packets import packets
from tests.virtual import CONFIG


class Wire:
    """Fake clock that advances in sleep, and a log of what was sent when."""

    def __init__(self, disturbance: Disturbance | None = None):
        self.now = 0.0
        self.sent: list[tuple[float, bytes]] = []
        self.reports: list[tuple[float, Status]] = []
        self.link = Link(
            lambda packet: self.sent.append((self.now, packet)),
            lambda status: self.reports.append((self.now, status)),
            disturbance,
            clock=lambda: self.now,
            sleep=self._sleep,
        )

    def _sleep(self, seconds: float) -> None:
        self.now += seconds

    @property
    def decoded(self) -> list[Packet]:
        return [Packet.decode(packet) for _, packet in self.sent]


def test_a_real_capture_comes_out_as_it_was(recordings):
    """16 chirps of 1024 bytes: the same packets at the same times, the last one 2 s late, and the same status."""
    real = [p for p in captured(recordings / "iwr1843-pcap/test_one_frame.pcap") if p[1] == 4098]
    stream = b"".join(Packet.decode(payload).payload for _, _, payload in real)
    wire = Wire()
    wire.link.start(delay=25e-6)
    for chirp in range(16):
        wire.link.take(stream[1024 * chirp : 1024 * (chirp + 1)], (chirp + 1) * 973.1e-6)
    wire.link.advance(5.0)
    assert [packet for _, packet in wire.sent] == [payload for _, _, payload in real]
    ours, theirs = np.array([time for time, _ in wire.sent]), np.array([time for time, _, _ in real])
    # The last full packet fills when the 16th chirp comes; timing starts there.
    assert np.allclose(ours[:11] - ours[10], theirs[:11] - theirs[10], atol=60e-6)
    assert ours[11] - ours[10] == pytest.approx(theirs[11] - theirs[10], abs=1e-3)
    assert wire.reports == [(wire.sent[-1][0], Status.RECORD_COMPLETED)]
    assert not wire.link.recording


@pytest.mark.parametrize("delay, megabits", [(5e-6, 706), (10e-6, 545), (25e-6, 325), (50e-6, 193)])
def test_throughput_is_the_data_sheets(delay, megabits):
    wire = Wire()
    wire.link.start(delay)
    wire.link.take(bytes(1456 * 1000), 0.0)
    wire.link.advance(1.0)
    times = [time for time, _ in wire.sent]
    rate = 8 * 1466 / np.diff(times).mean() / 1e6
    assert rate == pytest.approx(megabits, rel=0.04)
    assert np.diff(times).max() < 2e-4  # one by one or, where that is shorter than a nap, a few together


def test_packets_disregard_frames_and_count_from_the_start():
    rng = np.random.default_rng(0)
    data = rng.bytes(10_000)
    wire = Wire()
    wire.link.take(b"before anybody listens", 0.1)
    for _ in range(2):
        wire.sent.clear()
        wire.link.start()
        for first in range(0, len(data), 777):
            wire.link.take(data[first : first + 777], wire.now + 1e-3)
        assert len(wire.sent) == 10_000 // 1456
        wire.link.stop()
        assert [p.encode() for p in wire.decoded] == [p.encode() for p in packets(data)]
    wire.link.take(data, wire.now + 1)
    assert len(wire.sent) == 7 and not wire.reports


def test_a_busy_machine_delays_packets_and_they_catch_up():
    """After 100 ms of delay: no burst beyond a small buffer, and on time again after 100 / (4 - 1) ms."""
    wire = Wire()
    wire.link.start()
    for number in range(1, 501):
        if number == 100:
            wire.now += 0.1
        wire.link.take(bytes(1456), number * 1e-3)
    times = np.array([time for time, _ in wire.sent])
    behind = times - np.arange(1, 501) * 1e-3
    assert behind[98] < 1e-4 < 0.09 < behind[99] < 0.11
    assert 0.05 < behind[140] < 0.08 and behind[240:].max() < 1e-3 and behind.min() > -2e-4
    assert max(np.sum((times >= t) & (times < t + 1e-3)) for t in times) <= 16


def test_more_than_the_packets_can_carry_waits_in_memory_until_that_is_full(monkeypatch):
    monkeypatch.setattr("radarsim.emulator.link.MEMORY", 100 * 1456)
    wire = Wire()
    wire.link.start(delay=500e-6)
    for chirp in range(1000):
        wire.link.take(bytes(1456), chirp * 256e-6)
        if wire.reports:
            break
    # 1.95 packets come for each that goes, so about 205 have come when 100 wait.
    assert wire.reports[0][1] == Status.MEMORY_FULL and not wire.link.recording
    assert 195 < chirp < 215


# --- disturbances -----------------------------------------------------------------------------------------------------
@settings(max_examples=60, deadline=None)
@given(
    shares=st.tuples(*[st.sampled_from([0, 0.01, 0.2, 1])] * 4), seed=st.integers(0, 2**31), count=st.integers(0, 600)
)
def test_what_should_arrive_arrives(shares, seed, count):
    sent = [number.to_bytes(4, "big") for number in range(count)]

    def through() -> tuple[list[bytes], Disturbance]:
        network = Disturbance(*shares, rng=np.random.default_rng(seed))
        arrived = [packet for each in sent for packet in network(each)]
        return arrived + list(network.rest()), network

    arrived, network = through()
    counts = Counter(arrived)
    assert set(counts) <= set(sent) and set(counts.values()) <= {1, 2}
    assert len(sent) - len(counts) == network.lost
    assert sum(times == 2 for times in counts.values()) == network.duplicated
    assert through()[0] == arrived
    first_seen = [p for p in dict.fromkeys(reversed(arrived))][::-1]  # where each came last
    held = sum(a > b for a, b in zip(first_seen, first_seen[1:], strict=False))
    assert held <= network.reordered + network.delayed + network.duplicated
    if not any(shares):
        assert arrived == sent


def test_rates_and_distances_of_disturbances():
    network = Disturbance(0.01, 0.01, 0.02, 0.005, np.random.default_rng(1))
    count = 20_000
    arrived = [n for k in range(count) for n in network(k.to_bytes(4, "big"))]
    expected = {"lost": 0.01, "duplicated": 0.01, "reordered": 0.02, "delayed": 0.005}
    for name, share in expected.items():
        assert getattr(network, name) == pytest.approx(share * count, abs=5 * np.sqrt(share * count)), name
    numbers = [int.from_bytes(packet, "big") for packet in arrived]
    newest = np.maximum.accumulate(numbers)
    behind = (newest - numbers)[newest > numbers]
    assert behind.max() <= DELAYED[1] and REORDERED[0] <= behind.min()
    assert np.sum(behind > REORDERED[1] + 1) == pytest.approx(network.delayed, abs=network.duplicated)


def test_a_share_outside_0_to_1_is_refused():
    with pytest.raises(InputError, match="loss is 1.5"):
        Disturbance(loss=1.5)


def test_frames_come_whole_through_a_bad_network():
    """10,000 packets: each sample is in its place or lost, and the lost ones are marked."""
    config = CONFIG
    frames = np.random.default_rng(3).integers(-(2**15), 2**15, (75, *config.frame_shape), dtype=np.int16)
    network = Disturbance(0.01, 0.01, 0.02, 0.005, np.random.default_rng(4))
    wire = Wire(network)
    wire.link.start()
    stream = encode(frames, config).tobytes()
    for number, first in enumerate(range(0, len(stream), 1 << 14)):
        wire.link.take(stream[first : first + (1 << 14)], number * 1e-3)
    wire.link.stop()
    assert wire.link.packets == len(stream) // 1456 + 1 > 10_000
    assert len(wire.sent) == wire.link.packets - network.lost + network.duplicated

    assembler = FrameAssembler(config)
    settled = [frame for packet in wire.decoded for frame in assembler.add(packet)] + list(assembler.finish())
    assert len(settled) == len(frames)
    received = decode(np.concatenate([words for words, _ in settled]), config)
    valid = np.stack([whole for _, whole in settled])
    counts = assembler.counts
    assert counts.late == 0 and counts.duplicates == network.duplicated
    assert network.lost * 1456 - 1456 < counts.lost_bytes <= network.lost * 1456
    assert np.array_equal(received[valid], frames[valid])
    assert 0.97 < valid.mean() < 1
    there = received != 0
    assert np.array_equal(received[there], frames[there])
