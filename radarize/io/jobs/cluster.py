"""Jobs on a Ray cluster: one Ray task a job, begun again by Ray where a worker or a node is lost."""

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

#: How often Ray begins a job again whose worker or node died.
RETRIES = 3
_POLL = 0.5  # s between looks at the progress


class _Board:
    """How far jobs are, kept where all workers reach it."""

    def __init__(self):
        self.done: dict[str, float] = {}

    def put(self, name: str, done: float) -> None:
        self.done[name] = done

    def read(self) -> dict[str, float]:
        return self.done


@dataclass(frozen=True)
class _Order:
    """A job as a node gets it: with the folder that paths are relative to, and threads."""

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
    """Do jobs on the cluster of that address, with one core each, or with all that the largest node has."""
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
    """Cores and GPUs of the node that has most."""
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
    """Ray waits for minutes for an address where nobody is, and then ends the process."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host:
        return  # auto
    with explained(f"--ray {address}: no cluster answers", OSError, ValueError):
        socket.create_connection((host, int(port)), timeout=5).close()
