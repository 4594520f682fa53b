"""Removal of cached numba kernels that were compiled from other versions of the sources."""

import os
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path


def drop_stale(package: Path) -> None:
    """Delete a package's compiled kernels if any of its sources has changed since the last call.

    Numba detects changes of a kernel's own file only, but kernels inline functions of other files. Time stamps of
    sources and kernels cannot be compared: a version may be built before, and installed after, the kernels of an
    earlier one were compiled.
    """
    cache = os.environ.get("NUMBA_CACHE_DIR")
    folder = Path(cache) if cache else package / "__pycache__"
    stamp, sources = folder / f"{package.name}.sources", sha256(repr(sorted(_sources(package))).encode()).hexdigest()
    with suppress(OSError):
        if stamp.read_text() == sources:
            return
    for index in (Path(cache) if cache else package).rglob("*.nbi"):
        with suppress(OSError):  # another process does the same, or the folder is read-only
            index.unlink()
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        stamp.write_text(sources)


def _sources(package: Path, within: str = "") -> Iterator[tuple[str, int, int]]:
    """Path, modification time (s) and size of each source."""
    for entry in os.scandir(package / within):
        name = f"{within}{entry.name}"
        if entry.is_dir() and entry.name != "__pycache__":
            yield from _sources(package, f"{name}/")
        elif name.endswith(".py"):
            found = entry.stat()
            yield name, int(found.st_mtime), found.st_size
