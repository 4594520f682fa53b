"""Number of threads of a process."""

import os
import sys

import numba
from threadpoolctl import threadpool_limits

#: Variables read by libraries that are not imported yet. Numba's own is left out, since numba warns if it changes.
_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def use_threads(count: int) -> None:
    """Limit numba, torch and BLAS to this number of threads in this process, whether imported or not.

    Each library is limited by its own function, since environment variables have no effect after import.
    """
    most: int = numba.config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # numba sets it while it is imported
    numba.set_num_threads(min(count, most))
    threadpool_limits(count)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(count)
    os.environ |= dict.fromkeys(_VARIABLES, str(count))
