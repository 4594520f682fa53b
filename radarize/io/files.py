"""Files from elsewhere: regular ones, and of no more bytes than their reader is made for."""

import os
from pathlib import Path

from radarize.io.errors import InputError, explained

#: Bytes of text that people write: a hundred thousand lines.
TEXT = 8 << 20
#: Bytes that deflate makes of one at most (zlib's technical details).
DEFLATE = 1032
#: Environment variable of processes in which files may name others anywhere.
OUTSIDE = "RADARIZE_ALLOW_OUTSIDE"


def regular(path: str | Path, expected: str) -> Path:
    """A file that is there and can be read to its end: no folder, no device, and no pipe, which would be waited for.

    Args:
        expected: what it should be, in words.

    Raises:
        InputError: it is none.
    """
    path = Path(path)
    with explained(f"{path}: cannot be read", OSError, ValueError):  # a NUL within its name
        if not path.exists():
            raise InputError(f"{path}: no such file, expected {expected}")
        if not path.is_file():
            raise InputError(f"{path}: is a folder, a device or a pipe, expected {expected} in a file")
    return path


def read_bytes(path: str | Path, expected: str, most: int = TEXT) -> bytes:
    """All of a file.

    Args:
        expected: what it should be, in words.
        most: bytes that it may have.

    Raises:
        InputError: it is none, cannot be read, or is larger.
    """
    path = regular(path, expected)
    with explained(f"{path}: cannot be read", OSError), path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InputError(f"{path}: has more than {most} bytes, expected at most as many of {expected}")
    return content


def read_text(path: str | Path, expected: str, most: int = TEXT) -> str:
    """All of a file of UTF-8 text, see `read_bytes`.

    Raises:
        InputError: as there, or it is no such text.
    """
    content = read_bytes(path, expected, most)
    with explained(f"{path}: cannot be read", UnicodeDecodeError):
        return content.decode()


def within(path: Path, source: str | Path, *folders: Path) -> Path:
    """A file that another one names, which lies in its folder or below, links followed; unless the user allows others.

    Args:
        path: as named, from its folder.
        source: what names it.
        folders: that it may lie in.

    Raises:
        InputError: it lies elsewhere.
    """
    if os.environ.get(OUTSIDE) or any(path.resolve().is_relative_to(folder.resolve()) for folder in folders):
        return path
    raise InputError(
        f"{source}: names {path}, which lies outside of {folders[0].resolve()}, expected a file within; "
        "--allow-outside permits it"
    )
