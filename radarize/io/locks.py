"""Files and folders that one program writes at a time; what it holds goes with its process, however that ends."""

import fcntl
import os
from pathlib import Path

from radarize.io.errors import InputError, explained


def hold(path: Path, others: bool = False) -> int:
    """Hold a file or folder that is there; returns what `os.close` lets go of.

    Args:
        others: may hold it in the same way at once: a reader that keeps writers away.

    Raises:
        InputError: another program holds it, or it cannot be opened.
    """
    with explained(f"{path}: cannot be opened", OSError):
        handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, (fcntl.LOCK_SH if others else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise InputError(f"{path}: another program is writing there, expected to be alone") from None
    except OSError:
        pass  # a file system without locks
    return handle
