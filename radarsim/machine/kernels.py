"""Compiled kernels of other sources than those that are here."""

import os
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path


def drop_stale(package: Path) -> None:
    """Forget a package's compiled kernels where any of its sources is another one than when this was last called.

    Numba notices a change in a kernel's own file only, but kernels inline functions of the other files. Which of a
    source and a kernel is newer does not matter: a version may be built before, and installed after, kernels of an
    earlier one were compiled.
    """
    cache = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(cache) if cache else package / "__pycache__"
    stamp, sources = folder / f"{package.name}.sources", sha256(repr(sorted(_sources(package))).encode()).hexdigest()
    with suppress(OSError):
        if stamp.read_text() == sources:
            return
    for index in (Path(cache) if cache else package).rglob("*.nbi"):
        with suppress(OSError):  # another process may be doing the same, or the folder is not ours
            index.unlink()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        stamp.write_text(sources)


def _sources(package: Path, within: str = "") -> Iterator[tuple[str, int, int]]:
    """Path, time of change (s) and size of each source."""
    for entry in os.scandir(package / within):
        name = f"{within}{entry.name}"
        if entry.is_dir() and entry.name != "__pycache__":
            yield from _sources(package, f"{name}/")
        elif name.endswith(".py"):
            found = entry.stat()
            yield name, int(found.st_mtime), found.st_size
