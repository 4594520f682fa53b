"""Packets with damaged or forged headers: the stream continues, and no real packet is lost."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarize.capture import receiver
from radarize.capture.receiver import Origin
from radarize.radar.assembler import FrameAssembler
from radarize.radar.dca1000 import MAX_PAYLOAD, Packet, decode, encode
from tests.packets import packets
from tests.virtual import SMALL

FRAMES = np.random.default_rng(0).integers(-300, 300, (400, *SMALL.frame_shape), dtype=np.int16)
SENT = list(packets(encode(FRAMES, SMALL).tobytes()))
RATE = SMALL.frame_bytes / SMALL.frame_period  # bytes/s


def forged(offset: float) -> Packet:
    return Packet(1, int(offset), b"\x55" * MAX_PAYLOAD)


def assembled(stream) -> tuple[np.ndarray, np.ndarray, FrameAssembler]:
    """Frames, masks of whole chirps, and the assembler."""
    assembler = FrameAssembler(SMALL)
    frames = [frame for packet in stream for frame in assembler.add(packet)] + list(assembler.finish())
    assert assembler.counts.packets == len(stream)
    words, valid = zip(*frames, strict=True)
    return decode(np.concatenate(words), SMALL), np.array(valid), assembler


def with_forged(places: dict[int, list[Packet]]) -> list[Packet]:
    """Stream with packets inserted before those of some numbers."""
    return [each for number, packet in enumerate(SENT) for each in (*places.get(number, ()), packet)]


@pytest.mark.parametrize(
    "places",
    [
        {1000: [forged(12 * RATE)]},  # which once filled frames with zeros, and called what was real late
        {1000: [forged(50 * RATE)]},
        {0: [forged(2**47)]},  # which once made nothing of all that followed
        {2: [forged(2**47)], 3: [forged(2**46)]},
        {0: [forged(2**47 + MAX_PAYLOAD * k) for k in range(6)]},  # a beginning that several agree on
        {k: [forged((12 + k) * RATE)] for k in range(100, 2000, 20)},
        {k: [forged(12 * RATE + MAX_PAYLOAD * k)] for k in range(100, 2000)},  # agreeing, but the stream goes on
        {1000: [forged(12 * RATE)] * 50},  # repeated, which is no agreement
    ],
)
def test_what_lies_far_away_is_left_out(places):
    adc, valid, assembler = assembled(with_forged(places))
    assert np.array_equal(adc, FRAMES) and valid.all()
    assert assembler.counts.stray == sum(map(len, places.values())) and assembler.counts.late == 0
    assert "far from all others" in assembler.counts.warnings()[0]


def test_a_gap_is_accepted_when_several_packets_agree():
    left = [packet for packet in SENT if not 300 < packet.sequence <= 1500]  # 1.7 MB
    adc, valid, assembler = assembled(left)
    assert len(adc) == len(FRAMES) and np.array_equal(adc[valid], FRAMES[valid])
    assert assembler.counts.lost_bytes == 1200 * MAX_PAYLOAD and assembler.counts.stray == 0


def test_nothing_is_further_than_the_radar_can_have_come(monkeypatch):
    """Six packets 12 s ahead agree in a pause of the stream; the clock excludes them."""
    origin = Origin("board", SMALL)
    frames, now = [], 0.0
    monkeypatch.setattr(receiver, "time", SimpleNamespace(monotonic=lambda: now))
    for packet in with_forged({1000: [forged(12 * RATE + MAX_PAYLOAD * k) for k in range(6)]}):
        now = max(now, packet.offset / RATE if packet.sequence > 1 else 0.0)
        frames += origin.take(("board", 1024), packet.encode())
        origin.look()
    frames += origin.finish()
    assert np.array_equal(decode(np.concatenate([words for words, _ in frames]), SMALL), FRAMES)
    assert origin.look().stray == 6 and origin.look().late == 0


def test_one_port_of_the_board_is_heard():
    """Forged packets have the positions of real ones, and start before the first of these."""
    origin = Origin("board", SMALL)
    frames, false = [], 0
    for packet in SENT:
        for sender in (("board", 5000 + packet.sequence % 200), ("elsewhere", 1024)):
            frames += origin.take(sender, forged(packet.offset).encode())
            false += 1
        frames += origin.take(("board", 1024), packet.encode())
    frames += origin.finish()
    assert np.array_equal(decode(np.concatenate([words for words, _ in frames]), SMALL), FRAMES)
    assert origin.foreign == false and origin.look().received == len(SENT)


def test_a_capture_of_a_few_packets_is_whole():
    origin = Origin("board", SMALL)
    few = list(packets(encode(FRAMES[:1, :1], SMALL.model_copy(update={"loops": 1})).tobytes()))
    small = Origin("board", SMALL.model_copy(update={"loops": 1}))
    assert len(few) < 4
    frames = [frame for packet in few for frame in small.take(("board", 1024), packet.encode())] + list(small.finish())
    assert len(frames) == 1 and frames[0][1].all()
    assert list(origin.finish()) == []


def test_damaged_packets_alone_end_without_a_frame():
    origin = Origin("board", SMALL)
    assert not list(origin.take(("board", 4098), b"\x00"))
    assert not list(origin.finish())
    assert origin.look().packets == 1 and origin.look().received == 0
