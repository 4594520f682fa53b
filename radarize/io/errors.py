"""The exception for unusable input, and reasons of other errors in words."""

import errno
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

#: Environment variable that makes processes print tracebacks.
DEBUG = "RADARIZE_DEBUG"
#: Result of `reason` for a full disk, whichever library reports it.
FULL = "no space left on the device"
#: Folder of shared memory (Linux), and free bytes below which it counts as full.
SHARED_MEMORY, _SHARED = "/dev/shm", 1 << 20
#: Maximum length of an error sentence, characters.
_LONGEST = 1000


class InputError(Exception):
    """Input that cannot be used.

    Its text is one sentence with the file or field, the value found and what was expected; the command lines print it
    and exit with code 2. Content of a file is shown as printable characters, and shortened.

    Example:
        >>> try:
        ...     rz.load("nowhere.h5")
        ... except rz.InputError as error:
        ...     print(error)
        nowhere.h5: no such file, expected a recording (.h5)
    """

    def __str__(self) -> str:
        text = super().__str__()
        text = text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
        return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def refuse_unknown(given: Mapping[str, object], options: type) -> None:
    """Refuse keywords that a `TypedDict` of options does not define.

    Raises:
        InputError: there are unknown keywords.
    """
    known = options.__annotations__
    if unknown := given.keys() - known.keys():
        raise InputError(f"{min(unknown)} is given, expected some of {', '.join(known)}")


class DiskFull(InputError):
    """There is no space left on the disk that should be written."""


def of_system(error: OSError) -> str:
    """Return the system's message and the file; shared memory has no file name and is named if it is full."""
    if not error.filename and error.errno == errno.ENOSPC and os.path.isdir(SHARED_MEMORY):
        if shutil.disk_usage(SHARED_MEMORY).free < _SHARED:
            return f"{SHARED_MEMORY}: {FULL}, expected room for what processes exchange: free some of it"
    return f"{error.filename}: {reason(error)}" if error.filename else reason(error)


def first_line(error: BaseException) -> str:
    """Return the first line of an error's message, or its type if it has none."""
    return str(error).strip().split("\n", 1)[0] or type(error).__name__


def disk_full(error: BaseException | None) -> bool:
    """Return whether an error, or one of its causes, is that of a full disk."""
    while error is not None:
        if isinstance(error, DiskFull) or _no_space(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def _no_space(error: BaseException) -> bool:
    """Return whether there was no disk space; libraries in C, such as HDF5, state the error number in their text
    only."""
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno == errno.ENOSPC
    words = rf"no space left on device|errno = {errno.ENOSPC}\b"
    return not isinstance(error, InputError) and re.search(words, str(error), re.IGNORECASE) is not None


def reason(error: Exception) -> str:
    """Return the reason of a file error, as a library or the system states it, in a few printable words."""
    text = str(error)
    if _no_space(error):
        return FULL
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return line[:120] or type(error).__name__


@contextmanager
def explained(message: str, *kinds: type[Exception]) -> Iterator[None]:
    """Turn errors, by default of any kind, into an InputError of `message` and the reason, or DiskFull for a full disk.

    On damaged files, libraries raise errors of any kind.
    """
    expected = kinds or (Exception,)
    try:
        yield
    except InputError:
        raise
    except expected as error:
        kind = DiskFull if disk_full(error) else InputError
        raise kind(f"{message} ({reason(error)})") from error
