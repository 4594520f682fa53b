import itertools
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarize.io.errors import InputError
from radarize.radar.assembler import FrameAssembler
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import Packet, decode, encode, range_balance
from tests.packets import packets

ORDERS = [order for n in (1, 2, 3) for order in itertools.permutations((0, 1, 2), n)]


def small(tx_order=(0, 2, 1), rx=(0, 1, 2, 3), samples=8, loops=3, iq_order="qqii") -> RadarConfig:
    return RadarConfig(
        start_frequency=77e9,
        slope=60e12,
        idle_time=20e-6,
        adc_start_time=5e-6,
        ramp_end_time=60e-6,
        samples=samples,
        sample_rate=5e6,
        loops=loops,
        frame_period=50e-3,
        tx_order=tx_order,
        rx=rx,
        iq_order=iq_order,
    )


def random_frames(config: RadarConfig, count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(-(2**15), 2**15, (count, *config.frame_shape), dtype=np.int16)


def captured(frames: np.ndarray, config: RadarConfig) -> list[int]:
    """The words in the order of the data sheet, one by one."""
    words = []
    for frame, loop, tx in itertools.product(range(len(frames)), range(config.loops), config.tx_order):
        for rx in range(len(config.rx)):
            samples = frames[frame, loop, sorted(config.tx_order).index(tx), rx]
            for n in range(0, config.samples, 2):
                i, q = samples[n : n + 2, 0], samples[n : n + 2, 1]
                words += [*i, *q] if config.iq_order == "iiqq" else [*q, *i]
    return words


# --- samples ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("iq_order", ["iiqq", "qqii"])
@pytest.mark.parametrize("rx", [(0,), (1, 3), (0, 1, 2, 3)])
@pytest.mark.parametrize("order", ORDERS)
def test_order_of_words(order, rx, iq_order):
    config = small(order, rx, iq_order=iq_order)
    frames = random_frames(config, 2)
    words = np.array(captured(frames, config), np.int16)
    assert np.array_equal(encode(frames, config), words)
    assert np.array_equal(decode(words, config), frames)
    assert decode(words, config).dtype == np.int16


def test_decoding_does_not_touch_the_words():
    config = small()
    words = encode(random_frames(config, 1), config)
    words.setflags(write=False)
    before = words.copy()
    decode(words, config)[:] = 0
    assert np.array_equal(words, before)


def test_sizes_that_do_not_fit():
    config = small()
    words = encode(random_frames(config, 2), config)
    with pytest.raises(InputError, match=r"1.99\d frames, expected a multiple of 576"):
        decode(words[:-4], config)
    with pytest.raises(InputError, match="samples is 7, expected an even number"):
        decode(words, small(samples=7))
    with pytest.raises(InputError, match="expected"):
        encode(random_frames(small(samples=10), 1), config)


@pytest.mark.parametrize("iq_order", ["iiqq", "qqii"])
def test_near_echoes_show_the_iq_order(iq_order):
    config = small(samples=64, iq_order=iq_order)
    rng = np.random.default_rng(1)
    tones = np.exp(2j * np.pi * np.outer([3.3, 9.1, 20.2], np.arange(64)) / 64)
    signal = (np.array([800, 300, 100]) @ tones) + rng.normal(0, 20, (2, *config.frame_shape[:-1]))
    frames = np.stack([signal.real + 50, signal.imag - 70], -1).round().astype(np.int16)
    # The order in the configuration must not matter.
    for order in ("iiqq", "qqii"):
        decoded = decode(encode(frames, config), config.model_copy(update={"iq_order": order}))
        assert range_balance(decoded) * (1 if order == iq_order else -1) > 10


def test_noise_or_silence_does_not_show_the_iq_order():
    config = small(samples=64, loops=16)
    noise = np.random.default_rng(2).normal(0, 50, (4, *config.frame_shape)).astype(np.int16)
    assert abs(range_balance(noise)) < 1
    assert range_balance(np.zeros((1, *config.frame_shape), np.int16)) == 0


# --- packets ---------------------------------------------------------------------------------------------------------
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**48 - 1), st.binary(min_size=1, max_size=1456))
def test_packet_round_trip(sequence, offset, payload):
    packet = Packet(sequence, offset, payload)
    data = packet.encode()
    assert Packet.decode(data) == packet
    assert struct.unpack("<I", data[:4])[0] == sequence
    assert int.from_bytes(data[4:10], "little") == offset


@pytest.mark.parametrize("size", [0, 4, 10, 1467])
def test_packets_of_impossible_size(size):
    with pytest.raises(InputError, match=f"packet of {size} bytes"):
        Packet.decode(bytes(size))


CONFIG = small(samples=64)  # 9216 bytes a frame, 768 a chirp: neither divides by 1456


def assemble(stream, window=1 << 20):
    assembler = FrameAssembler(CONFIG, window=window)
    frames = [frame for packet in stream for frame in assembler.add(packet)]
    frames += assembler.finish()
    return frames, assembler


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_reassembly_of_a_lossy_shuffled_repeated_stream(data):
    count = data.draw(st.integers(1, 6))
    frames = random_frames(CONFIG, count, seed=data.draw(st.integers(0, 99)))
    sent = list(packets(encode(frames, CONFIG).tobytes()))
    lost = data.draw(st.sets(st.integers(0, len(sent) - 2), max_size=5))  # the last one arrives, so the end is known
    arriving = [p for i, p in enumerate(sent) if i not in lost]
    arriving += data.draw(st.lists(st.sampled_from(arriving), max_size=4))
    arriving = data.draw(st.permutations(arriving))

    got, assembler = assemble(arriving)

    kept = np.ones((count, CONFIG.frame_bytes), bool).reshape(-1)
    for i in lost:
        kept[sent[i].offset : sent[i].offset + len(sent[i].payload)] = False
    expected = np.where(kept, np.frombuffer(encode(frames, CONFIG).tobytes(), np.uint8), 0).astype(np.uint8)
    assert len(got) == count
    assert np.concatenate([words for words, _ in got]).tobytes() == expected.tobytes()
    whole = kept.reshape(count, CONFIG.loops, 3, -1).all(-1)
    physical = whole[:, :, [0, 2, 1]]  # fired TX1, TX3, TX2; given as TX1, TX2, TX3
    assert np.array_equal([valid for _, valid in got], physical)
    assert assembler.counts.lost_bytes == (~kept).sum()


def test_frames_come_as_soon_as_they_are_whole():
    frames = random_frames(CONFIG, 4)
    assembler = FrameAssembler(CONFIG)
    arrived = 0
    for packet in packets(encode(frames, CONFIG).tobytes()):
        arrived += len(list(assembler.add(packet)))
        assert arrived == (packet.offset + len(packet.payload)) // CONFIG.frame_bytes


def test_a_packet_within_the_window_is_still_accepted_and_later_ones_are_not():
    frames = random_frames(CONFIG, 10)
    sent = list(packets(encode(frames, CONFIG).tobytes()))
    soon, _ = assemble([sent[0], *sent[2:9], sent[1], *sent[9:]], window=8192)
    assert all(valid.all() for _, valid in soon)
    late, assembler = assemble([sent[0], *sent[2:40], sent[1], *sent[40:]], window=8192)
    assert assembler.counts.late == 1 and assembler.counts.lost_bytes == 1456
    assert [valid.all() for _, valid in late] == [False] + [True] * 9
    assert np.array_equal(decode(late[1][0], CONFIG)[0], frames[1])  # nothing shifted


def test_an_incomplete_last_frame_is_left_out_and_counted():
    sent = list(packets(encode(random_frames(CONFIG, 2), CONFIG).tobytes()))
    got, assembler = assemble(sent[:-1])
    assert len(got) == 1
    assert assembler.counts.incomplete_bytes == sent[-1].offset - CONFIG.frame_bytes


def test_a_damaged_byte_count_does_not_make_millions_of_empty_frames():
    sent = list(packets(encode(random_frames(CONFIG, 2), CONFIG).tobytes()))
    sent[5] = Packet(6, 2**47, sent[5].payload)
    got, assembler = assemble(sent)
    assert len(got) == 2 and assembler.counts.stray == 1


def test_listening_may_begin_in_the_middle_of_a_capture():
    frames = random_frames(CONFIG, 3)
    start = 1000 * CONFIG.frame_bytes - 500  # the tail of a frame comes first
    stream = bytes(500) + encode(frames, CONFIG).tobytes()
    got, assembler = assemble(packets(stream, sequence=700, offset=start), window=1 << 16)
    assert [valid.all() for _, valid in got] == [True] * 3
    assert np.array_equal(decode(got[0][0], CONFIG)[0], frames[0])
    assert assembler.counts.lost_bytes == 0
