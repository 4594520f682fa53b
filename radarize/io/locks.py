"""Locks on files and folders for a single writer; released when the process ends."""

import fcntl
import os
from pathlib import Path

from radarize.io.errors import InputError, explained


def hold(path: Path, others: bool = False) -> int:
    """Lock an existing file or folder; `os.close` of the returned descriptor releases it.

    Args:
        others: share the lock with others that do the same: readers that exclude writers.

    Raises:
        InputError: another program holds the lock, or the path cannot be opened.
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
