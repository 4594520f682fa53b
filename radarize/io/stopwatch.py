"""How long steps take, wherever they are: `stage` names a step, the `Stopwatch` that runs takes its time."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_running: ContextVar["Stopwatch | None"] = ContextVar("running", default=None)


class Stopwatch:
    """Times the stages that are entered while it runs: ``with stopwatch.running(): ...``.

    Attributes:
        seconds: of each stage by name, without the stages within it.
    """

    def __init__(self):
        self.seconds: dict[str, float] = defaultdict(float)

    @contextmanager
    def running(self) -> Iterator["Stopwatch"]:
        """Take the time of stages from now on, in this thread."""
        before = _running.set(self)
        try:
            yield self
        finally:
            _running.reset(before)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """A step of the pipeline; what steps within it take is theirs. Without a stopwatch nothing is timed."""
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
