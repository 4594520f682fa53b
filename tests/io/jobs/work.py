"""Jobs for tests of parallel execution."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from radarize.io.errors import InputError


@dataclass(frozen=True)
class Sleep:
    """Writes its process number to a file, and sleeps."""

    path: Path
    seconds: float = 600.0

    def __call__(self, report) -> int:
        self.path.write_text(str(os.getpid()))
        report(0.5)
        time.sleep(self.seconds)
        return os.getpid()


@dataclass(frozen=True)
class Wait:
    """Reports a progress of one half until a file exists."""

    path: Path

    def __call__(self, report) -> str:
        deadline = time.monotonic() + 120
        while not self.path.exists() and time.monotonic() < deadline:
            report(0.5)
            time.sleep(0.1)
        return os.getcwd()


@dataclass(frozen=True)
class Fall:
    """Kills its process, as many times as given."""

    folder: Path
    times: int

    def __call__(self, report) -> str:
        tried = len(list(self.folder.iterdir()))
        (self.folder / str(tried)).touch()
        report(1.0)
        if tried < self.times:
            os.kill(os.getpid(), signal.SIGKILL)
        return "stands"


def refuse(report) -> None:
    raise InputError("a.h5: is not there")


def stumble(report) -> None:
    raise ZeroDivisionError("odd")


@numba.njit(parallel=True)
def _warm(count):
    found = np.zeros(count, np.int64)
    for k in numba.prange(count):
        found[k] = numba.get_thread_id()
    return found


@dataclass(frozen=True)
class Threads:
    """Number of running threads of each library.

    Attributes:
        early: what the job needs was loaded before it came.
    """

    early: bool

    def __call__(self, report) -> dict[str, int]:
        if self.early:
            import scipy.linalg  # noqa: F401
            import torch  # noqa: F401
        first = set(_warm(1000))  # launches threads

        @numba.njit(parallel=True)  # so this is compiled after them, which a changed NUMBA_NUM_THREADS forbids
        def again(count):
            found = np.zeros(count, np.int64)
            for k in numba.prange(count):
                found[k] = numba.get_thread_id()
            return found

        second = set(again(1000))
        import scipy.linalg  # noqa: F401, F811
        import torch
        from threadpoolctl import threadpool_info

        blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
        return {
            "numba": max(len(first), len(second)),
            "asked of numba": numba.get_num_threads(),
            "torch": torch.get_num_threads(),
            "blas": max(blas),
        }
