"""What takes long in a comparison, done once: trainings, runs, timings. What a step found is kept beside what it made;
whatever ends a comparison, the same command goes on after the last step that ended.
"""

import json
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import groupby
from pathlib import Path
from typing import Protocol

from radarize.errors import InputError
from radarize.evaluation.runfiles import read_json, write_whole

#: File with what a step found.
FOUND = "found.json"
Report = Callable[[float], None]


class Step(Protocol):
    """One of them; hashable, and goes to other processes.

    Attributes:
        frames: how long it takes, in frames of a run.
        alone: it uses all cores, or needs quiet ones.
        place: its folder in the output's.
    """

    frames: int
    alone: bool
    place: str

    def identity(self) -> dict[str, object]:
        """All that what it finds depends on, as JSON has it."""
        ...

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Do it, in its folder; `report` takes the share that is done.

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
    for alone, group in groupby(steps, key=lambda step: step.alone):
        group = list(group)
        known = {step: found for step in group if (found := kept(step, output)) is not None}
        results |= known
        done += sum(step.frames for step in known)
        progress(done, total)
        todo = [step for step in group if step not in known]
        here = alone or workers == 1

        def report(share: float, step: Step, before: int) -> None:
            progress(before + int(share * step.frames), total)

        if here:
            for step in todo:
                results[step] = _do(step, output, lambda share, step=step, before=done: report(share, step, before))
                done += step.frames
                progress(done, total)
        else:
            for step, found in _side_by_side(todo, output, workers):
                results[step] = found
                done += step.frames
                progress(done, total)
    return results


def _do(step: Step, output: Path, report: Report = lambda share: None) -> dict[str, object] | str:
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


def _side_by_side(steps: list[Step], output: Path, workers: int) -> Iterator[tuple[Step, dict[str, object] | str]]:
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin)
    jobs = {pool.submit(_do, step, output): step for step in steps}
    try:
        for job in as_completed(jobs):
            yield jobs[job], job.result()
    except BaseException:
        for process in multiprocessing.active_children():
            process.kill()  # what they are at would last too long
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """How a worker starts: one thread each, for processes share no locks."""
    for name in ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = "1"
    if "torch" in sys.modules:  # came along with the program
        sys.modules["torch"].set_num_threads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers, which would go on for another."""
    multiprocessing.parent_process().join()
    os._exit(1)
