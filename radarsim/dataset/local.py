"""Tasks on this machine: worker processes that live through many tasks, each with its share of the cores."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path

import psutil

from radarize.errors import InputError
from radarsim.dataset.task import Event, Task

#: A worker's memory at its peak, bytes (benchmarks/dataset_speed.py measures it).
MEMORY = 1.5e9
#: How often a task is begun that its worker does not survive.
ATTEMPTS = 2
_SPAWN = multiprocessing.get_context("spawn")


def default_workers() -> int:
    """One per core, as far as memory goes: processes share no locks, so two of one thread outrun one of two."""
    return max(1, min(len(os.sched_getaffinity(0)), int(psutil.virtual_memory().available / MEMORY)))


class _Worker:
    """A process and the task that it has."""

    def __init__(self, folder: Path, threads: int):
        self.connection, theirs = _SPAWN.Pipe()
        self.process = _SPAWN.Process(target=_serve, args=(theirs, folder, threads), daemon=True)
        self.process.start()
        theirs.close()
        self.task: Task | None = None

    def give(self, task: Task) -> None:
        self.task = task
        self.connection.send(task)

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.connection.close()


def work(tasks: list[Task], folder: Path, workers: int | None = None) -> Iterator[Event]:
    """Make recordings on local processes.

    Args:
        tasks: what to make.
        folder: where.
        workers: processes.

    Yields:
        progress, and how each task ended. A worker that dies is replaced, and its task begun again.
    """
    count = min(default_workers() if workers is None else workers, len(tasks))
    threads = max(1, len(os.sched_getaffinity(0)) // count)
    todo, attempts = deque(tasks), dict.fromkeys((task.name for task in tasks), 0)
    crew: list[_Worker] = []
    try:
        while todo or any(worker.task for worker in crew):
            while todo and len(crew) < count:
                crew.append(_Worker(folder, threads))
            for worker in crew:
                if worker.task is None and todo:
                    worker.give(todo.popleft())
            ready = wait([w.connection for w in crew] + [w.process.sentinel for w in crew])
            for worker in list(crew):
                if worker.connection in ready and (event := _receive(worker)):
                    yield event
                elif worker.process.sentinel in ready or worker.connection in ready:
                    crew.remove(worker)
                    worker.stop()
                    if task := worker.task:
                        attempts[task.name] += 1
                        if attempts[task.name] < ATTEMPTS:
                            todo.appendleft(task)
                            yield Event(task, frames=0)
                        else:
                            yield Event(task, error=f"{task.name}: its process {_end(worker.process.exitcode)}")
    finally:
        for worker in crew:
            worker.stop()


def _receive(worker: _Worker) -> Event | None:
    try:
        event = worker.connection.recv()
    except (EOFError, OSError):
        return None
    if event.error is not None or event.motion is not None:
        worker.task = None
    return event


def _end(code: int | None) -> str:
    if code == -signal.SIGKILL:
        return "was killed, twice; most often memory is short, and fewer --workers need less"
    return f"ended with code {code}, twice"


def _serve(connection: Connection, folder: Path, threads: int) -> None:
    """A worker's life."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            task = connection.recv()
        except EOFError:
            return
        connection.send(attempt(task, folder, threads, lambda done, _, task=task: connection.send(Event(task, done))))


def attempt(task: Task, folder: Path, threads: int, progress: Callable[[int, int], None]) -> Event:
    """Make a task's recording; a failure is an event, too."""
    try:
        return Event(task, task.frames, motion=task.make(folder, threads, progress))
    except InputError as error:
        return Event(task, error=str(error))
    except Exception as error:  # one broken task must not end the others
        line = (str(error).strip().splitlines() or [""])[0]
        return Event(task, error=f"{task.name}: internal error, {type(error).__name__}: {line}")


def _end_with_parent() -> None:
    """A parent that was killed cannot end its workers, which would go on writing."""
    multiprocessing.parent_process().join()
    sys.stderr.flush()
    os._exit(1)
