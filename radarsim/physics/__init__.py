"""From scene to samples: scatterers, reflectors, paths, echoes, synthesis, front end."""

import contextlib
from pathlib import Path


def _drop_stale_kernels() -> None:
    """Forget compiled kernels that are older than any source here.

    Numba notices a change in a kernel's own file only, but kernels inline functions of the other files.
    """
    here = Path(__file__).parent
    newest = max(file.stat().st_mtime for file in here.glob("*.py"))
    for index in (here / "__pycache__").glob("*.nbi"):
        with contextlib.suppress(OSError):  # another process may be doing the same, or the folder is not ours
            if index.stat().st_mtime < newest:
                index.unlink()


_drop_stale_kernels()
