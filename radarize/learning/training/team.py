"""Processes that train one network together, started by torch's launcher (`torchrun`), or a single one."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from radarize.io.errors import InputError


@dataclass(frozen=True)
class Team:
    """A process among those that train together.

    Attributes:
        rank: 0 to size - 1; rank 0 reports and writes.
        size: number of processes.
        device: device of this process.
    """

    rank: int
    size: int
    device: torch.device

    def share(self, net: nn.Module) -> nn.Module:
        """Return the network with gradients averaged over all processes."""
        if self.size == 1:
            return net
        return DistributedDataParallel(net, device_ids=[self.device] if self.device.type == "cuda" else None)

    def agree(self, net: nn.Module) -> None:
        """Copy the statistics of batch normalisation, which each process has its own of, from the first process to
        all."""
        if self.size > 1:
            for values in net.buffers():
                dist.broadcast(values, 0)

    def sum(self, values: Tensor) -> Tensor:
        """Sum over all processes."""
        values = values.detach().to(self.device, torch.float64)
        if self.size > 1:
            dist.all_reduce(values)
        return values.cpu()

    def wait(self) -> None:
        """Wait until all processes get here."""
        if self.size > 1:
            dist.barrier()


@contextmanager
def team(device: str | None = None) -> Iterator[Team]:
    """Join the processes started by `torchrun`, if any.

    Args:
        device: ``cpu`` or ``cuda``; None: a GPU if available.

    Raises:
        InputError: a GPU is requested and missing, or there are fewer GPUs than processes.
    """
    rank, size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    local = int(os.environ.get("LOCAL_RANK", 0))
    gpus = torch.cuda.device_count() if torch.cuda.is_available() else 0
    kind = device or ("cuda" if gpus else "cpu")
    if kind not in ("cpu", "cuda"):
        raise InputError(f"device is {kind!r}, expected cpu or cuda")
    if kind == "cuda" and local >= gpus:
        raise InputError(f"device is cuda for process {local} of this machine, which has {gpus} GPUs; use cpu")
    place = torch.device("cuda", local) if kind == "cuda" else torch.device("cpu")
    if size == 1:
        yield Team(0, 1, place)
        return
    if kind == "cuda":
        torch.cuda.set_device(place)
    dist.init_process_group("nccl" if kind == "cuda" else "gloo")
    try:
        yield Team(rank, size, place)
    finally:
        dist.destroy_process_group()
