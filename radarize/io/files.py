"""Safe access to foreign files: regular files only, of a limited size."""

import os
from pathlib import Path

from radarize.io.errors import InputError, explained

#: Maximum bytes of text that people write: a hundred thousand lines.
TEXT = 8 << 20
#: Maximum compression ratio of deflate (zlib's technical details).
DEFLATE = 1032
#: Environment variable that allows files to name other files in any folder.
OUTSIDE = "RADARIZE_ALLOW_OUTSIDE"


def regular(path: str | Path, expected: str) -> Path:
    """Return the path of an existing regular file; folders, devices and pipes (which would block) are refused.

    Args:
        expected: description of the expected file.

    Raises:
        InputError: there is no such file.
    """
    path = Path(path)
    with explained(f"{path}: cannot be read", OSError, ValueError):  # a NUL within its name
        if not path.exists():
            raise InputError(f"{path}: no such file, expected {expected}")
        if not path.is_file():
            raise InputError(f"{path}: is a folder, a device or a pipe, expected {expected} in a file")
    return path


def read_bytes(path: str | Path, expected: str, most: int = TEXT) -> bytes:
    """Read a whole file.

    Args:
        expected: description of the expected file.
        most: maximum size, bytes.

    Raises:
        InputError: there is no such file, it cannot be read, or it is larger.
    """
    path = regular(path, expected)
    with explained(f"{path}: cannot be read", OSError), path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise InputError(f"{path}: has more than {most} bytes, expected at most as many of {expected}")
    return content


def read_text(path: str | Path, expected: str, most: int = TEXT) -> str:
    """Read a whole file of UTF-8 text, see `read_bytes`.

    Raises:
        InputError: as in `read_bytes`, or it is not UTF-8.
    """
    content = read_bytes(path, expected, most)
    with explained(f"{path}: cannot be read", UnicodeDecodeError):
        return content.decode()


def within(path: Path, source: str | Path, *folders: Path) -> Path:
    """Return a path that another file names, if it is in allowed folders (links followed) or the user allows any.

    Args:
        path: the path, relative to the folder of `source` resolved.
        source: file that names it.
        folders: allowed folders.

    Raises:
        InputError: the path is outside of these folders.
    """
    if os.environ.get(OUTSIDE) or any(path.resolve().is_relative_to(folder.resolve()) for folder in folders):
        return path
    raise InputError(
        f"{source}: names {path}, which lies outside of {folders[0].resolve()}, expected a file within; "
        "--allow-outside permits it"
    )
