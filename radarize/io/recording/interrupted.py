"""Message about the frames that are kept when a recording is interrupted."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording.reader import Recording


@contextmanager
def keeping(output: Path) -> Iterator[None]:
    """Turn an interrupt into a sentence on the frames that are kept in `output`, a recording.

    Raises:
        InputError: the user interrupted.
    """
    before = _written(output)
    try:
        yield
    except KeyboardInterrupt:
        raise InputError(f"stopped; {_kept(output, before)}") from None


def _written(path: Path) -> int | None:
    return path.stat().st_mtime_ns if path.is_file() else None


def _kept(output: Path, before: int | None) -> str:
    for path in (output, output.with_name(output.name + ".part")):
        if path.is_file() and not (path == output and _written(path) == before):
            try:
                with Recording(path) as recording:
                    return f"{len(recording)} whole frames are kept in {path}"
            except InputError:
                pass  # it has no frame
    return "nothing was written"
