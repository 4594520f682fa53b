"""A process's share of the cores."""

import os
import sys

import numba
from threadpoolctl import threadpool_limits

#: What libraries that are yet to be loaded read. Numba's own is not among them: it complains if that changes.
_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def use_threads(count: int) -> None:
    """Let numba, torch and BLAS use so many threads in this process, whether they are loaded or not.

    Each is told by its own call: once a library is there, environment variables come too late.
    """
    most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # numba sets it while it is imported
    numba.set_num_threads(min(count, most))
    threadpool_limits(count)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(count)
    os.environ |= dict.fromkeys(_VARIABLES, str(count))
