"""Batches of a recording's frames with the rows of all sensors, made in this process or in several."""

import pickle
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.io.errors import InputError
from radarize.io.jobs import Report, perform
from radarsim.machine.threads import default_workers, share_with_drjit
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.suite import Suite

#: Frames per batch: ray tests and loops over scatterers are faster for many frames together.
TOGETHER = 16
#: Smallest number of batches per process that is worth its start, some seconds; used if no number is given.
_WORTH = 8


class Batch(NamedTuple):
    """I/Q of a batch's frames, zero where chirps are lost, and rows of all sensors' streams."""

    samples: Int16[np.ndarray, "frame loop tx rx sample 2"]
    rows: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Batches:
    """Frames of a recording, computed in batches.

    Attributes:
        scenario: scenario that is recorded.
        times: start times of the frames on the clock of the motion, s.
        start: time stamp of that clock's zero, s.
        valid: False where a chirp is lost; None: no chirp is lost.
    """

    scenario: Scenario
    times: Float[np.ndarray, "frame"]
    start: float = 0.0
    valid: Bool[np.ndarray, "frame loop tx"] | None = None

    @classmethod
    def of(cls, scenario: Scenario) -> "Batches":
        """Return all frames of a scenario.

        Raises:
            InputError: its motion is shorter than a frame.
        """
        return cls(scenario, scenario.times)

    @cached_property
    def suite(self) -> Suite:
        """Sensors of the recording."""
        return Suite(self.scenario)

    def frames(self, first: int, last: int) -> Frames:
        """Return frames first to last - 1; nothing is computed yet."""
        return self.scenario.frames(self.times[first:last], self.times[last] if last < len(self.times) else None)

    def made(self, first: int, last: int) -> Batch:
        """Compute samples and rows of frames first to last - 1.

        Raises:
            InputError: they are the first of the recording, and none of its frames has an echo.
        """
        frames = self.frames(first, last)
        if first == 0 and not any(map(len, frames.paths)):
            self._require_echoes()
        arrived = np.True_ if self.valid is None else self.valid[first:last, ..., None, None, None]
        return Batch(frames.samples * arrived, self.suite.observe(frames, first, self.start))

    def spans(self) -> list[tuple[int, int]]:
        """First frame of each batch, and the frame after its last."""
        frames = len(self.times)
        return [(first, min(first + TOGETHER, frames)) for first in range(0, frames, TOGETHER)]

    def each(self, spans: list[tuple[int, int]], workers: int | None = 1) -> Iterator[Batch]:
        """Yield batches in the order of their spans.

        Args:
            spans: first frame of each batch, and the frame after its last.
            workers: number of processes, at most one per batch; 1: this process only; None: one per core, if the number
                of batches justifies it.

        Raises:
            InputError: see `made`, or a process died.
        """
        workers = min(default_workers(), len(spans) // _WORTH) if workers is None else workers
        if min(workers, len(spans)) < 2:
            yield from (self.made(*span) for span in spans)
            return
        order = pickle.dumps(replace(self))  # without cached results
        jobs = {f"frames {first} to {last - 1}": partial(_make, order, first, last) for first, last in spans}
        made, awaited = {}, deque(jobs)
        for news in perform(jobs, workers):
            if news.error is not None:
                raise news.failure
            if isinstance(news.result, Batch):
                made[news.name] = news.result
            while awaited and awaited[0] in made:
                yield made.pop(awaited.popleft())

    def _require_echoes(self) -> None:
        """Raise InputError for a recording without echoes, judged by frames spread over all of it."""
        some = np.unique(np.linspace(0, len(self.times) - 1, TOGETHER).astype(int))
        if not any(map(len, self.scenario.frames(self.times[some]).paths)):
            raise InputError(
                f"scene {self.scenario.scene.name}: no frame has an echo, expected surfaces that face the radar within "
                f"{self.scenario.config.max_range:.1f} m of it"
            )


def _make(order: bytes, first: int, last: int, report: Report) -> Batch:
    return _begun(order).made(first, last)


@lru_cache(1)
def _begun(order: bytes) -> Batches:
    """The parent's `Batches`, unpickled once per process."""
    share_with_drjit()
    return pickle.loads(order)
