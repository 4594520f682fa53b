"""Files from elsewhere: regular ones, and of no more bytes than their reader is made for."""

from pathlib import Path

from radarize.errors import InputError, explained

#: Bytes of text that people write: a hundred thousand lines.
TEXT = 8 << 20


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
