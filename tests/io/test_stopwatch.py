"""Time by stage of the running stopwatch, without the time of nested stages."""

import time

import pytest

from radarize.io.stopwatch import Stopwatch, stage


class Clock:
    """A clock that the test advances."""

    def __init__(self, monkeypatch):
        self.now = 5.0
        monkeypatch.setattr(time, "perf_counter", lambda: self.now)

    def work(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    return Clock(monkeypatch)


def test_stages_within_stages_are_theirs(clock):
    watch = Stopwatch()
    with watch.running():
        for _ in range(2):
            with stage("rotation"):
                clock.work(1)
                with stage("maps"):
                    clock.work(2)
                    with stage("spectra"):
                        clock.work(4)
                with stage("rotation"):
                    clock.work(8)
                clock.work(16)
            clock.work(100)  # of no stage
    assert watch.seconds == {"rotation": 50, "maps": 4, "spectra": 8}


def test_only_what_runs_is_timed(clock):
    one, other = Stopwatch(), Stopwatch()
    with stage("maps"):
        clock.work(1)  # nobody asks
    with one.running():
        with stage("scans"):
            clock.work(2)
        with other.running(), stage("scans"):
            clock.work(4)
        with stage("scans"):
            clock.work(8)
    with stage("scans"):
        clock.work(16)
    assert (one.seconds, other.seconds) == ({"scans": 10}, {"scans": 4})


def test_errors_pass_and_leave_the_watch_stopped(clock):
    watch = Stopwatch()
    with pytest.raises(KeyError), watch.running(), stage("slam"):
        clock.work(1)
        raise KeyError
    with stage("slam"):
        clock.work(2)
    assert watch.seconds.get("slam", 0) <= 1
