"""Long steps of a benchmark, each done once: trainings, runs, timings. The result of a step is stored in its folder; if
a benchmark is interrupted, the same command continues after the last step that has ended.
"""

import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Protocol, cast

from radarize.io import jobs
from radarize.io.errors import InputError
from radarize.io.jobs import Report
from radarize.io.jsonfile import read_json
from radarize.io.replacing import write_whole

#: File with the result of a step.
FOUND = "found.json"


class Step(Protocol):
    """A step; hashable, and can be sent to other processes.

    Attributes:
        frames: duration, in frames of a run.
        alone: whether it uses all cores, or needs them idle.
        place: its folder inside the output folder.
    """

    @property
    def frames(self) -> int: ...

    @property
    def alone(self) -> bool: ...

    @property
    def place(self) -> str: ...

    def identity(self) -> dict[str, object]:
        """Return fingerprints of everything that the result depends on, in types of JSON."""
        ...

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Execute the step in its folder, and return its result; `report` takes the share that is done.

        Raises:
            InputError: it cannot be executed.
        """
        ...


def kept(step: Step, output: Path) -> dict[str, object] | None:
    """Return the stored result of a step; None without one, or if its inputs have changed."""
    try:
        about = read_json(output / step.place / FOUND)
    except InputError:
        return None
    return about["found"] if about.get("of") == step.identity() else None


def perform(
    steps: Iterable[Step],
    output: Path,
    workers: int,
    progress: Callable[[int, int], None],
    ray: str | None = None,
) -> dict[Step, dict[str, object] | str]:
    """Execute steps in order; steps that are not `alone` run in parallel.

    Args:
        steps: steps to execute.
        output: output folder of all steps.
        workers: number of processes, each with its share of the cores; 1: this process, which also executes steps that
            are `alone`.
        progress: called with (frames done, frames in all).
        ray: address of a Ray cluster to use instead (`radarize.io.jobs`); steps that are `alone` have a node each.

    Returns:
        Result of each step, or the sentence of its error.
    """
    steps = list(dict.fromkeys(steps))
    total = sum(step.frames for step in steps)
    results: dict[Step, dict[str, object] | str] = {}
    done: dict[str, float] = {}  # frames

    def report(step: Step, share: float) -> None:
        done[step.place] = share * step.frames
        progress(int(sum(done.values())), total)

    progress(0, total)
    for alone, group in groupby(steps, key=lambda step: step.alone):
        todo: dict[str, Step] = {}
        for step in group:
            if (found := kept(step, output)) is None:
                todo[step.place] = step
            else:
                results[step] = found
                report(step, 1.0)
        work = {name: partial(_do, step, output) for name, step in todo.items()}
        if ray is None and (alone or workers == 1):
            heard: Iterator[jobs.News] = (
                jobs.attempt(name, job, partial(report, todo[name])) for name, job in work.items()
            )
        else:
            heard = jobs.perform(work, workers, ray, alone)
        for news in heard:
            if news.ended:
                # The value returned by `_do`, or the error.
                results[todo[news.name]] = cast(dict[str, object] | str, news.result or news.error)
            report(todo[news.name], 1.0 if news.ended else news.done)
    return results


def _do(step: Step, output: Path, report: Report) -> dict[str, object] | str:
    folder = output / step.place
    try:
        found = step.do(folder, report)
    except InputError as error:
        return str(error)
    folder.mkdir(parents=True, exist_ok=True)
    # Types as read from the file.
    text = json.dumps({"of": step.identity(), "found": found}, indent=1)
    write_whole(folder / FOUND, text + "\n")
    return json.loads(text)["found"]
