"""Timing of steps: `stage` names a step, and the running `Stopwatch` measures its time."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_running: ContextVar["Stopwatch | None"] = ContextVar("running", default=None)


class Stopwatch:
    """Measures the time of stages entered while it runs: ``with stopwatch.running(): ...``.

    Attributes:
        seconds: time of each stage by name, without nested stages, s.
    """

    def __init__(self):
        self.seconds: dict[str, float] = defaultdict(float)

    @contextmanager
    def running(self) -> Iterator["Stopwatch"]:
        """Measure stages from now on, in this thread."""
        before = _running.set(self)
        try:
            yield self
        finally:
            _running.reset(before)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Mark a step of the pipeline; time in nested steps counts for these. Without a stopwatch nothing is measured."""
    watch = _running.get()
    if watch is None:
        yield
        return
    start, others = time.perf_counter(), sum(watch.seconds.values())
    try:
        yield
    finally:
        within = sum(watch.seconds.values()) - others
        watch.seconds[name] += time.perf_counter() - start - within
