"""What tells the things that a step is made of from those of an earlier one: sources, recordings, weights."""

import hashlib
import inspect
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import radarize

#: A file is told from others by its size and so many blocks spread over it, of so many bytes.
_BLOCKS, _BLOCK = 64, 1 << 16


@cache
def of_code(*makers: Callable) -> str:
    """Of this package's sources, and of the files that methods of one's own are in."""
    found = _package().copy()
    for maker in makers:
        try:
            own = inspect.getsourcefile(maker.func if isinstance(maker, partial) else maker)
        except TypeError:  # made in an interpreter
            continue
        if own and Path(own).is_file():
            found.update(Path(own).read_bytes())
    return found.hexdigest()[:16]


@cache
def _package() -> "hashlib._Hash":
    """Read once for all methods."""
    root = Path(radarize.__file__).parent
    paths = (path for path in sorted(root.rglob("*")) if path.suffix in (".py", ".yaml"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths))


def of_file(path: Path) -> str:
    """Of a recording or weights; ``none`` without such a file. Recordings differ everywhere, by their noise."""
    if not path.is_file():
        return "none"
    about = path.stat()
    return _of_file(path, about.st_size, about.st_mtime_ns)


@cache
def _of_file(path: Path, size: int, changed: int) -> str:
    del changed  # what is remembered of a file holds until it changes
    found = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for start in range(0, size, max(_BLOCK, size // _BLOCKS)):
            file.seek(start)
            found.update(file.read(_BLOCK))
    return found.hexdigest()[:16]
