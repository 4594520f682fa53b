"""Compiled kernels that are older than the sources they were compiled from."""

import contextlib
import os
from pathlib import Path


def drop_stale(package: Path) -> None:
    """Forget compiled kernels that are older than any source of a package.

    Numba notices a change in a kernel's own file only, but kernels inline functions of the other files.
    """
    newest = max(file.stat().st_mtime for file in package.rglob("*.py"))
    cache = os.environ.get("NUMBA_CACHE_DIR")
    for index in (Path(cache) if cache else package).rglob("*.nbi"):
        with contextlib.suppress(OSError):  # another process may be doing the same, or the folder is not ours
            if index.stat().st_mtime < newest:
                index.unlink()
