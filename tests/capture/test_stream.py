"""Frames between processes: all in order, or whole ones dropped and counted."""

import multiprocessing
import os
import signal
import threading
import time

import numpy as np
import pytest

from radarize.capture.ring import FrameRing
from radarize.capture.stream import FrameStream, follow
from radarize.io.errors import InputError
from tests.capture import sources
from tests.virtual import SMALL


def put(ring: FrameRing, number: int) -> bool:
    valid = np.ones(SMALL.frame_shape[:2], bool)
    return ring.put(number, number * 0.1, sources.frame(SMALL, number), valid)


def test_a_full_ring_takes_no_more_and_loses_nothing():
    ring, taken = FrameRing(SMALL, 4), []
    for first in range(0, 18, 6):
        assert [put(ring, first + k) for k in range(6)] == [True] * 4 + [False] * 2
        found = ring.get(3, 0)
        assert len(found) == 3 and (found["adc"] == found["number"][:, None, None, None, None, None]).all()
        taken += [*found["number"], *ring.get(9, 0)["number"]]
    assert taken == [0, 1, 2, 3, 6, 7, 8, 9, 12, 13, 14, 15]
    assert len(ring.get(4, 0.01)) == 0
    put(ring, 20)
    assert ring.end(0.1)
    assert ring.get(4, 0)["time"].tolist() == [2.0]
    assert ring.get(4, 0) is None and ring.get(4, 0) is None


def test_a_stream_from_another_process():
    with FrameStream(SMALL, sources.count, SMALL, 50, slots=64) as stream:
        batches = list(follow(stream, threading.Event(), most=16))
        assert max(map(len, batches)) <= 16
        assert [number for batch in batches for number in batch["number"]] == list(range(50))
        assert stream.counts.frames == 50 and stream.counts.dropped == 0 and stream.packets.received == 50
        assert stream.troubles() == []


def test_a_slow_reader_gets_whole_frames_and_a_count():
    with FrameStream(SMALL, sources.count, SMALL, 50, slots=8) as stream:
        while stream.packets.received < 50:  # the source waits for nobody
            time.sleep(0.01)
        numbers = [number for batch in follow(stream, threading.Event(), most=4) for number in batch["number"]]
        assert numbers == list(range(8)) and stream.counts.dropped == 42
        assert stream.troubles() == ["42 of 50 frames were dropped: this computer is too slow for them"]


def test_the_user_and_the_number_of_frames_end_it():
    stopping = threading.Event()
    with FrameStream(SMALL, sources.wait) as stream:
        stopping.set()
        assert list(follow(stream, stopping, most=4)) == []
    with FrameStream(SMALL, sources.count, SMALL, 20, slots=64) as stream:
        found = list(follow(stream, threading.Event(), most=3, frames=7))
        assert np.concatenate(found)["number"].tolist() == list(range(7))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_what_a_terminal_sends_to_all_its_processes_loses_no_frame(number):
    """A closed terminal and `timeout` do so; the main process stops as the user does."""
    with FrameStream(SMALL, sources.count, SMALL, 50, 0.01) as stream:
        (receiver,) = multiprocessing.active_children()
        os.kill(receiver.pid, number)
        found = [number for batch in follow(stream, threading.Event(), most=16) for number in batch["number"]]
        assert found == list(range(50))


def test_failures_are_sentences():
    with FrameStream(SMALL, sources.fail) as stream, pytest.raises(InputError, match="the file is damaged"):
        list(follow(stream, threading.Event(), most=4))
    with FrameStream(SMALL, sources.die) as stream, pytest.raises(InputError, match="has died .exit code 9"):
        list(follow(stream, threading.Event(), most=4))
