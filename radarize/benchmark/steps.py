"""What takes long in a comparison, done once: trainings, runs, timings. What a step found is kept beside what it made;
whatever ends a comparison, the same command goes on after the last step that ended.
"""

import json
from collections.abc import Callable, Iterable
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Protocol

from radarize import jobs
from radarize.errors import InputError
from radarize.jobs import Report
from radarize.jsonfile import read_json
from radarize.replacing import write_whole

#: File with what a step found.
FOUND = "found.json"


class Step(Protocol):
    """One of them; hashable, and goes to other processes.

    Attributes:
        frames: how long it takes, in frames of a run.
        alone: it uses all cores, or needs quiet ones.
        place: its folder in the output's.
        together: steps of which this is the same are done at once, by the first one's `do_each`; None: by itself.
    """

    frames: int
    alone: bool
    place: str
    together: object | None

    def identity(self) -> dict[str, object]:
        """All that what it finds depends on, as JSON has it."""
        ...

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Do it, in its folder, if it is done by itself; `report` takes the share that is done.

        Raises:
            InputError: it cannot be done.
        """
        ...

    def do_each(self, places: "dict[Path, Step]", report: Report) -> dict[Path, dict[str, object] | str]:
        """Do several in their folders at once, if it is told to be done `together` with others.

        Returns:
            What each found, or why it cannot be done.

        Raises:
            InputError: none of them can be.
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
        ray: address of a Ray cluster to use instead (`radarize.jobs`); steps that are `alone` have a node each.

    Returns:
        What each step found, or the sentence why it could not be done.
    """
    steps = list(dict.fromkeys(steps))
    total, results = sum(step.frames for step in steps), {}
    units: dict[str, list[Step]] = {}
    done: dict[str, float] = {}  # frames of units

    def report(name: str, share: float) -> None:
        done[name] = share * sum(step.frames for step in units[name])
        progress(int(sum(done.values())), total)

    progress(0, total)
    for alone, group in groupby(steps, key=lambda step: step.alone):
        group = list(group)
        known = {step: found for step in group if (found := kept(step, output)) is not None}
        results |= known
        for step in known:
            units[step.place] = [step]
            report(step.place, 1.0)
        new = _units(step for step in group if step not in known)
        units |= new
        todo = {name: partial(_do, unit, output) for name, unit in new.items()}
        if ray is None and (alone or workers == 1):
            heard = (jobs.attempt(name, job, partial(report, name)) for name, job in todo.items())
        else:
            heard = jobs.perform(todo, workers, ray, alone)
        for news in heard:
            if news.ended:
                unit = units[news.name]
                results |= zip(unit, news.result or [news.error] * len(unit), strict=True)
            report(news.name, 1.0 if news.ended else news.done)
    return results


def _units(steps: Iterable[Step]) -> dict[str, list[Step]]:
    """Steps that are done at once, by the first one's place."""
    found: dict[object, list[Step]] = {}
    for step in steps:
        found.setdefault(step if step.together is None else step.together, []).append(step)
    return {unit[0].place: unit for unit in found.values()}


def _do(unit: list[Step], output: Path, report: Report) -> list[dict[str, object] | str]:
    places = {output / step.place: step for step in unit}
    try:
        together = unit[0].together is not None
        results = unit[0].do_each(places, report) if together else {k: step.do(k, report) for k, step in places.items()}
    except InputError as error:
        results = dict.fromkeys(places, str(error))
    return [_keep(step, folder, results[folder]) for folder, step in places.items()]


def _keep(step: Step, folder: Path, found: dict[str, object] | str) -> dict[str, object] | str:
    if isinstance(found, str):
        return found
    folder.mkdir(parents=True, exist_ok=True)
    # Read as they will be next time.
    text = json.dumps({"of": step.identity(), "found": found}, indent=1)
    write_whole(folder / FOUND, text + "\n")
    return json.loads(text)["found"]
