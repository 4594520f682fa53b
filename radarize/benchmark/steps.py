"""What takes long in a comparison, done once: trainings, runs, timings. What a step found is kept beside what it made;
whatever ends a comparison, the same command goes on after the last step that ended.
"""

import json
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from itertools import groupby
from pathlib import Path
from typing import Protocol

from radarize.errors import InputError
from radarize.jsonfile import read_json
from radarize.replacing import write_whole

#: File with what a step found.
FOUND = "found.json"
Report = Callable[[float], None]
#: s between looks at how far workers have come.
_PATIENCE = 0.5
#: In a worker: shares of units that are done.
_shares: Sequence[float] = []


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
        """Do it, in its folder; `report` takes the share that is done.

        Raises:
            InputError: it cannot be done.
        """
        ...

    def do_each(self, places: "dict[Path, Step]", report: Report) -> dict[Path, dict[str, object] | str]:
        """Do several in their folders at once, if it is told to be done `together` with others.

        Returns:
            What each found, or why it cannot be done.
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
    steps: Iterable[Step], output: Path, workers: int, progress: Callable[[int, int], None]
) -> dict[Step, dict[str, object] | str]:
    """Do steps in order, those that are not `alone` side by side.

    Args:
        steps: what to do.
        output: folder of all.
        workers: processes of one thread each; 1: this process, with all its threads.
        progress: called with (frames done, frames in all).

    Returns:
        What each step found, or the sentence why it could not be done.
    """
    steps = list(dict.fromkeys(steps))
    total, done, results = sum(step.frames for step in steps), 0, {}

    def report(frames: float) -> None:
        progress(done + int(frames), total)

    for alone, group in groupby(steps, key=lambda step: step.alone):
        group = list(group)
        known = {step: found for step in group if (found := kept(step, output)) is not None}
        results |= known
        done += sum(step.frames for step in known)
        report(0)
        units: dict[object, list[Step]] = {}
        for step in group:
            if step not in known:
                units.setdefault(step if step.together is None else step.together, []).append(step)
        if alone or workers == 1:
            ended = _one_by_one(units.values(), output, report)
        else:
            ended = _side_by_side(units.values(), output, workers, report)
        for unit, found in ended:
            results |= zip(unit, found, strict=True)
            done += sum(step.frames for step in unit)
            report(0)
    return results


Ended = tuple[list[Step], list[dict[str, object] | str]]


def _one_by_one(units: Iterable[list[Step]], output: Path, report: Callable[[float], None]) -> Iterator[Ended]:
    for unit in units:
        frames = sum(step.frames for step in unit)
        yield unit, _do(unit, output, lambda share, frames=frames: report(share * frames))


def _do(unit: list[Step], output: Path, report: Report = lambda share: None) -> list[dict[str, object] | str]:
    places = {output / step.place: step for step in unit}
    if len(unit) > 1:
        results = unit[0].do_each(places, report)
    else:
        ((folder, step),) = places.items()
        try:
            results = {folder: step.do(folder, report)}
        except InputError as error:
            results = {folder: str(error)}
    return [_keep(step, folder, results[folder]) for folder, step in places.items()]


def _keep(step: Step, folder: Path, found: dict[str, object] | str) -> dict[str, object] | str:
    if isinstance(found, str):
        return found
    folder.mkdir(parents=True, exist_ok=True)
    # Read as they will be next time.
    text = json.dumps({"of": step.identity(), "found": found}, indent=1)
    write_whole(folder / FOUND, text + "\n")
    return json.loads(text)["found"]


def _side_by_side(
    units: Iterable[list[Step]], output: Path, workers: int, report: Callable[[float], None]
) -> Iterator[Ended]:
    units, context = list(units), multiprocessing.get_context("spawn")
    shares = context.Array("d", max(len(units), 1), lock=False)
    pool = ProcessPoolExecutor(workers, context, _begin, (shares,))
    jobs = {pool.submit(_do_there, k, unit, output): k for k, unit in enumerate(units)}
    waiting = set(jobs)
    try:
        while waiting:
            ended, waiting = wait(waiting, _PATIENCE, FIRST_COMPLETED)
            for job in ended:
                yield units[jobs[job]], job.result()
            under_way = [jobs[job] for job in waiting]
            report(sum(shares[k] * sum(step.frames for step in units[k]) for k in under_way))
    except BaseException:
        for process in multiprocessing.active_children():
            process.kill()  # what they are at would last too long
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin(shares: Sequence[float]) -> None:
    """How a worker starts: one thread each, for processes share no locks."""
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = "1"
    if "torch" in sys.modules:  # came along with the program
        sys.modules["torch"].set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    global _shares  # memory is inherited, never sent
    _shares = shares


def _do_there(number: int, unit: list[Step], output: Path) -> list[dict[str, object] | str]:
    """In a worker."""
    return _do(unit, output, lambda share: _shares.__setitem__(number, share))


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers, which would go on for another."""
    multiprocessing.parent_process().join()
    os._exit(1)
