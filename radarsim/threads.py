"""How many threads libraries may use beside each other."""

from collections.abc import Callable
from functools import cache, wraps

from threadpoolctl import ThreadpoolController


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
