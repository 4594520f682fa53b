"""Files that are whole or not there."""

import contextlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from radarize.errors import InputError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name beside `path` to write to; it takes the path's place when the block ends, and goes if it fails.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        os.replace(part, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            part.unlink()
        if isinstance(error, OSError):
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error
        raise


def write_whole(path: Path, text: str) -> Path:
    """Write a text file under a temporary name and rename it when it is whole.

    Raises:
        InputError: it cannot be written.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
    return path
