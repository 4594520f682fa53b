"""Tasks on a Ray cluster: one Ray task per recording, begun again by Ray where a worker or a node is lost.

The folder, and files that the specification names, must be visible on every node under the same path.
"""

import socket
from collections.abc import Iterator
from pathlib import Path

from radarize.errors import InputError
from radarsim.dataset.local import attempt
from radarsim.dataset.task import Event, Task

#: How often Ray begins a task again whose worker or node died.
RETRIES = 3
_POLL = 0.5  # s between looks at the progress


class _Board:
    """Frames done by task, kept where all workers reach it."""

    def __init__(self):
        self.frames: dict[str, int] = {}

    def put(self, name: str, frames: int) -> None:
        self.frames[name] = frames

    def read(self) -> dict[str, int]:
        return self.frames


def _make(task: Task, folder: Path, board) -> Event:
    return attempt(task, folder, 1, lambda done, _: board.put.remote(task.name, done))


def work(tasks: list[Task], folder: Path, address: str) -> Iterator[Event]:
    """Make recordings on a cluster, one core each.

    Args:
        tasks: what to make.
        folder: where, on every node.
        address: of the cluster's head, or ``auto``.

    Yields:
        progress, and how each task ended.

    Raises:
        InputError: Ray is not installed, or no cluster answers.
    """
    ray = _connect(address)
    board = ray.remote(num_cpus=0)(_Board).remote()
    make = ray.remote(num_cpus=1, max_retries=RETRIES)(_make)
    running = {make.remote(task, folder, board): task for task in tasks}
    by_name = {task.name: task for task in tasks}
    try:
        while running:
            ended, _ = ray.wait(list(running), timeout=_POLL)
            for reference in ended:
                task = running.pop(reference)
                try:
                    yield ray.get(reference)
                except ray.exceptions.RayError as error:
                    reason = str(error).strip().splitlines()[0]
                    yield Event(task, error=f"{task.name}: {reason} ({RETRIES + 1} attempts)")
            left = {task.name for task in running.values()}
            for name, frames in ray.get(board.read.remote()).items():
                if name in left:
                    yield Event(by_name[name], frames)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)
        ray.kill(board)


def _connect(address: str):
    try:
        import ray
    except ImportError:
        raise InputError("ray is not installed; type: pip install 'radarize[ray]'") from None
    _knock(address)
    if not ray.is_initialized():
        try:
            ray.init(address=address, log_to_driver=False, logging_level="ERROR")
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise InputError(f"--ray {address}: no cluster answers ({str(error).strip().splitlines()[0]})") from error
    return ray


def _knock(address: str) -> None:
    """Ray waits for minutes for an address where nobody is, and then ends the process."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host:
        return  # auto
    try:
        socket.create_connection((host, int(port)), timeout=5).close()
    except (OSError, ValueError) as error:
        raise InputError(f"--ray {address}: no cluster answers ({error})") from error
