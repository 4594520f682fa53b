"""Make a data set: keep finished recordings, distribute the remaining tasks, and resume interrupted runs."""

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from radarize import __version__
from radarize.io.errors import FULL, DiskFull, InputError, explained
from radarize.io.jobs import Job, Report, perform
from radarize.io.locks import hold
from radarize.io.replacing import replacing
from radarsim.dataset.specification import Specification
from radarsim.dataset.task import Stale, Task
from radarsim.machine.threads import default_workers

#: File beside the recordings with the expanded specification: parameters of each, and members of every split.
INDEX = "dataset.json"


@dataclass
class Outcome:
    """Result of a run.

    Attributes:
        made: finished in this run.
        kept: were finished before.
        failed: name to error message.
    """

    made: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)


def make(
    specification: Specification,
    folder: Path,
    *,
    workers: int | None = None,
    ray: str | None = None,
    replace: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
    log: Callable[[str], None] = print,
) -> Outcome:
    """Make the recordings of a data set that do not exist yet.

    An existing recording is compared with its task: it is kept if it is whole and has the same parameters; an
    unfinished one is continued at its next frame. An interrupted run is resumed by starting it again, and gives the
    same bytes.

    Args:
        specification: data set to make.
        folder: output folder; every worker must have it under this path.
        workers: local processes; default: one per core, as far as memory goes.
        ray: address of a Ray cluster (``auto``: the one of this machine) to use instead.
        replace: replace recordings that have other parameters; default: an error.
        progress: called with (frames done, total frames), existing recordings included.
        log: takes a line for every finished recording.

    Raises:
        InputError: the folder has recordings of other parameters, another run works there, the disk is full, or the
            user interrupted; finished recordings stay.
    """
    folder = Path(folder).resolve()
    tasks = specification.tasks
    with _alone(folder):
        finished = _examine(tasks, folder, replace)
        _write_index(specification, folder)
        outcome = Outcome(kept=[task.name for task in finished])
        todo = {task.name: task for task in tasks if task not in finished}
        total = sum(task.frames for task in tasks)
        done = {task.name: task.frames for task in finished}
        progress(sum(done.values()), total)
        try:
            for news in perform(making(todo.values(), folder), workers or default_workers(), ray):
                name = news.name
                if news.error is not None:
                    outcome.failed[name] = news.error
                    done.pop(name, None)
                    todo[name].clear(folder)
                    if news.full:
                        raise DiskFull(f"{FULL}; {_finished(outcome, tasks, folder)}")
                    log(f"failed: {news.error}")
                elif news.ended:
                    outcome.made.append(name)
                    done[name] = todo[name].frames
                    log(f"{name}: {news.result}")
                else:
                    done[name] = int(news.done)
                progress(sum(done.values()), total)
        except KeyboardInterrupt:
            raise InputError(f"stopped; {_finished(outcome, tasks, folder)}") from None
    return outcome


def making(tasks: Iterable[Task], folder: Path) -> dict[str, Job]:
    """Jobs that make recordings, report their frames, and return the statistics of the motion in one line."""
    return {task.name: partial(_make, task, folder) for task in tasks}


def _make(task: Task, folder: Path, report: Report) -> str:
    return task.make(folder, lambda done, _: report(done))


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Lock a folder for one run; the lock is released when the process ends."""
    with explained(f"{folder}: cannot be written", OSError):
        folder.mkdir(parents=True, exist_ok=True)
    handle = hold(folder)
    try:
        yield
    finally:
        os.close(handle)


def _examine(tasks: tuple[Task, ...], folder: Path, replace: bool) -> list[Task]:
    """Return the tasks whose recordings exist.

    Raises:
        InputError: some have other parameters, and `replace` is not set.
    """
    finished, stale = [], []
    for task in tasks:
        try:
            if task.is_finished(folder):
                finished.append(task)
        except Stale as error:
            stale.append(str(error))
    if stale and not replace:
        others = f" (and {len(stale) - 1} more)" if len(stale) > 1 else ""
        raise InputError(
            f"{folder}: {stale[0]}{others}; --replace makes such recordings again, another folder keeps them"
        )
    return finished


def _write_index(specification: Specification, folder: Path) -> None:
    with replacing(folder / INDEX) as part:
        part.write_text(json.dumps({"version": __version__, **specification.as_data()}, indent=1) + "\n")


def _finished(outcome: Outcome, tasks: tuple[Task, ...], folder: Path) -> str:
    count = len(outcome.made) + len(outcome.kept)
    return f"{count} of {len(tasks)} recordings are finished in {folder}; the same command continues"
