"""Number of simulating processes, and of threads that libraries may use."""

import os
from collections.abc import Callable
from functools import cache, wraps

import numba
import psutil
from threadpoolctl import ThreadpoolController

from radarsim.machine import llvm

#: Peak memory of a simulating process, bytes (measured by benchmarks/dataset_speed.py).
MEMORY = 1.5e9


def default_workers() -> int:
    """One process per core, limited by memory: two processes of one thread are faster than one of two."""
    return max(1, min(len(os.sched_getaffinity(0)), int(psutil.virtual_memory().available / MEMORY)))


def share_with_drjit() -> None:
    """Give Dr.Jit as many threads as Numba has: this process's share of the cores (`radarize.io.jobs`)."""
    llvm.require()
    import drjit

    drjit.set_thread_count(numba.get_num_threads())


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()  # covers the libraries loaded at the first call


def one_blas_thread(function: Callable) -> Callable:
    """Limit BLAS to one thread: its threads would compete with Numba's and Mitsuba's spinning ones, which costs a
    third."""

    @wraps(function)
    def limited(*arguments, **named):
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*arguments, **named)

    return limited
