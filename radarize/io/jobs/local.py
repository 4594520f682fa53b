"""Jobs on this machine: worker processes that run one job after another and share the cores."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection, wait

from radarize.io.jobs.job import Job, News, attempt

#: Number of times that a job is started whose worker dies.
ATTEMPTS = 2
_SPAWN = multiprocessing.get_context("spawn")


class _Worker:
    """A worker process and the name of its current job."""

    def __init__(self, threads: int):
        self.connection, theirs = _SPAWN.Pipe()
        self.process = _SPAWN.Process(target=_serve, args=(theirs, threads), daemon=True)
        self.process.start()
        theirs.close()
        self.busy: str | None = None

    def give(self, name: str, job: Job) -> None:
        self.busy = name
        with suppress(OSError):  # it died while idle, which `hear` detects
            self.connection.send((name, job))

    def hear(self) -> News | None:
        """Return the next report; None if the process died."""
        try:
            news = self.connection.recv()
        except (EOFError, OSError):
            return None
        if news.ended:
            self.busy = None
        return news

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.connection.close()


def perform(jobs: Mapping[str, Job], workers: int | None) -> Iterator[News]:
    """Run jobs with at most this number of processes, by default one per core."""
    cores = len(os.sched_getaffinity(0))
    count = min(workers or cores, len(jobs))
    threads = max(1, cores // count)
    todo, attempts = deque(jobs), dict.fromkeys(jobs, 0)
    crew: list[_Worker] = []
    try:
        while todo or any(worker.busy for worker in crew):
            while todo and len(crew) < count:
                crew.append(_Worker(threads))
            for worker in crew:
                if worker.busy is None and todo:
                    worker.give(name := todo.popleft(), jobs[name])
            ready = wait([w.connection for w in crew] + [w.process.sentinel for w in crew])
            for worker in list(crew):
                if worker.connection in ready and (news := worker.hear()):
                    yield news
                elif worker.process.sentinel in ready or worker.connection in ready:
                    crew.remove(worker)
                    worker.stop()
                    if lost := worker.busy:
                        attempts[lost] += 1
                        if attempts[lost] < ATTEMPTS:
                            todo.appendleft(lost)
                            yield News(lost)
                        else:
                            yield News(lost, ended=True, error=f"{lost}: its process {_end(worker.process.exitcode)}")
    finally:
        for worker in crew:
            worker.stop()


def _end(code: int | None) -> str:
    if code == -signal.SIGKILL:
        return "was killed twice; usually memory is short: use fewer --workers"
    return f"ended with code {code}, twice"


def _serve(connection: Connection, threads: int) -> None:
    """Run jobs in a worker process until the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches every process; the parent ends its workers
    threading.Thread(target=_end_with_parent, daemon=True).start()
    from radarize.io.jobs.threads import use_threads  # only workers need these libraries

    use_threads(threads)
    while True:
        try:
            name, job = connection.recv()
        except EOFError:
            return
        use_threads(threads)  # for libraries imported with the job
        connection.send(attempt(name, job, partial(_report, connection, name)))


def _report(connection: Connection, name: str, done: float) -> None:
    connection.send(News(name, done))


def _end_with_parent() -> None:
    """End the worker when its parent was killed; otherwise it would continue to write."""
    parent = multiprocessing.parent_process()
    assert parent is not None  # only workers run this
    parent.join()
    sys.stderr.flush()
    os._exit(1)
