"""What takes long in a comparison, done once: trainings, runs, timings. What a step found is kept beside what it made;
whatever ends a comparison, the same command goes on after the last step that ended.
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

#: File with what a step found.
FOUND = "found.json"


class Step(Protocol):
    """One of them; hashable, and goes to other processes.

    Attributes:
        frames: how long it takes, in frames of a run.
        alone: it uses all cores, or needs quiet ones.
        place: its folder in the output's.
    """

    @property
    def frames(self) -> int: ...

    @property
    def alone(self) -> bool: ...

    @property
    def place(self) -> str: ...

    def identity(self) -> dict[str, object]:
        """All that what it finds depends on, as JSON has it."""
        ...

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Do it in its folder; `report` takes the share that is done.

        Raises:
            InputError: it cannot be done.
        """
        ...


def kept(step: Step, output: Path) -> dict[str, object] | None:
    """What a step found earlier; None if it has yet to be done, or was done with something else."""
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
    """Do steps in order, those that are not `alone` side by side.

    Args:
        steps: what to do.
        output: folder of all.
        workers: processes, each with its share of the cores; 1: this one, which also does steps that are `alone`.
        progress: called with (frames done, frames in all).
        ray: address of a Ray cluster to use instead (`radarize.io.jobs`); steps that are `alone` have a node each.

    Returns:
        What each step found, or the sentence why it could not be done.
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
                # What `_do` returned, or why it could not be done.
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
    # Read as they will be next time.
    text = json.dumps({"of": step.identity(), "found": found}, indent=1)
    write_whole(folder / FOUND, text + "\n")
    return json.loads(text)["found"]
