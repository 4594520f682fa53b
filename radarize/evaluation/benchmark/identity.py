"""Fingerprints of the inputs of a step: source code, recordings, weights. A step is repeated if one has changed."""

import hashlib
import inspect
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import radarize

#: The fingerprint of a file is a hash of its size and of a number of blocks spread over it; number and size in bytes.
_BLOCKS, _BLOCK = 64, 1 << 16


@cache
def of_code(*makers: Callable) -> str:
    """Return the fingerprint of this package's source code and of the files of external methods."""
    found = _package().copy()
    for maker in makers:
        try:
            own = inspect.getsourcefile(maker.func if isinstance(maker, partial) else maker)
        except TypeError:  # defined in an interpreter
            continue
        if own and Path(own).is_file():
            found.update(Path(own).read_bytes())
    return found.hexdigest()[:16]


@cache
def _package() -> "hashlib._Hash":
    """Hash the package once for all methods."""
    root = Path(radarize.__file__).parent
    paths = (path for path in sorted(root.rglob("*")) if path.suffix in (".py", ".yaml"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths))


def of_file(path: Path) -> str:
    """Return the fingerprint of a recording or of weights; ``none`` without such a file. Blocks suffice, because
    recordings differ everywhere by their noise."""
    if not path.is_file():
        return "none"
    about = path.stat()
    return _of_file(path, about.st_size, about.st_mtime_ns)


@cache
def _of_file(path: Path, size: int, changed: int) -> str:
    del changed  # part of the cache key: the cached value is valid until the file changes
    found = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for start in range(0, size, max(_BLOCK, size // _BLOCKS)):
            file.seek(start)
            found.update(file.read(_BLOCK))
    return found.hexdigest()[:16]
