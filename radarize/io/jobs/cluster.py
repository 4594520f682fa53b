"""Jobs on a Ray cluster, one Ray task per job; Ray restarts a task whose worker or node is lost."""

import logging
import os
import socket
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from radarize.io.errors import InputError, explained, first_line
from radarize.io.jobs.job import Job, News, Report, attempt

#: Number of times that Ray restarts a job whose worker or node died.
RETRIES = 3
_POLL = 0.5  # s between queries of the progress


class _Board:
    """Progress of all jobs, in a Ray actor that all workers reach."""

    def __init__(self):
        self.done: dict[str, float] = {}

    def put(self, name: str, done: float) -> None:
        self.done[name] = done

    def read(self) -> dict[str, float]:
        return self.done


@dataclass(frozen=True)
class _Order:
    """A job as sent to a node, with the working folder and the number of threads."""

    name: str
    job: Job
    folder: Path
    threads: int

    def __call__(self, report: Report) -> object:
        from radarize.io.jobs.threads import use_threads

        try:
            os.chdir(self.folder)
        except OSError as error:
            raise InputError(f"{self.folder}: is not on {socket.gethostname()}, expected it on every node") from error
        use_threads(self.threads)
        return self.job(report)


def _do(order: _Order, board: Any) -> News:  # what Ray makes of a `_Board`
    return attempt(order.name, order, lambda done: board.put.remote(order.name, done))


def perform(jobs: Mapping[str, Job], address: str, alone: bool) -> Iterator[News]:
    """Run jobs on the cluster at an address, with one core each, or with all cores of the largest node."""
    ray = _connect(address)
    share = _largest_node(ray) if alone else {"num_cpus": 1}
    board = ray.remote(num_cpus=0)(_Board).remote()
    do = ray.remote(max_retries=RETRIES, **share)(_do)
    threads, here = int(share["num_cpus"]), Path.cwd()
    running = {do.remote(_Order(name, job, here, threads), board): name for name, job in jobs.items()}
    try:
        while running:
            ended, _ = ray.wait(list(running), timeout=_POLL)
            for reference in ended:
                name = running.pop(reference)
                try:
                    yield ray.get(reference)
                except ray.exceptions.RayError as error:
                    yield News(name, ended=True, error=f"{name}: {first_line(error)} ({RETRIES + 1} attempts)")
            left = set(running.values())
            for name, done in ray.get(board.read.remote()).items():
                if name in left:
                    yield News(name, done)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.kill(board)


def _largest_node(ray: ModuleType) -> dict[str, float]:
    """Return cores and GPUs of the node with the most."""
    nodes = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    gpus, cpus = max((node.get("GPU", 0), node.get("CPU", 1)) for node in nodes)
    return {"num_cpus": cpus, "num_gpus": gpus}


def _connect(address: str) -> ModuleType:
    import ray

    _knock(address)
    if not ray.is_initialized():
        with explained(f"--ray {address}: no cluster answers", ConnectionError, ValueError, RuntimeError):
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    return ray


def _knock(address: str) -> None:
    """Refuse an address at which no cluster answers; Ray itself would wait for minutes and then end the process."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host:
        return  # auto
    with explained(f"--ray {address}: no cluster answers", OSError, ValueError):
        socket.create_connection((host, int(port)), timeout=5).close()
