"""How many processes simulate beside each other, and how many threads libraries may use."""

import os
from collections.abc import Callable
from functools import cache, wraps

import numba
import psutil
from threadpoolctl import ThreadpoolController

from radarsim.machine import llvm

#: A simulating process's memory at its peak, bytes (benchmarks/dataset_speed.py measures it).
MEMORY = 1.5e9


def default_workers() -> int:
    """One per core, as far as memory goes: processes share no locks, so two of one thread outrun one of two."""
    return max(1, min(len(os.sched_getaffinity(0)), int(psutil.virtual_memory().available / MEMORY)))


def share_with_drjit() -> None:
    """Give Dr.Jit as many threads as Numba has here, this process's share of the cores (`radarize.io.jobs`)."""
    llvm.require()
    import drjit

    drjit.set_thread_count(numba.get_num_threads())


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()  # of what is loaded at the first call


def one_blas_thread(function: Callable) -> Callable:
    """Numba's and Mitsuba's threads spin for work; a BLAS that wakes threads of its own beside them costs a third."""

    @wraps(function)
    def limited(*arguments, **named):
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*arguments, **named)

    return limited
