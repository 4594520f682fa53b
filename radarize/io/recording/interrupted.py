"""What an interrupt leaves behind of a recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording.reader import Recording


@contextmanager
def keeping(output: Path) -> Iterator[None]:
    """Turn an interrupt into a sentence that says what of `output`, a recording, was kept.

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
                pass  # not even its first frame was written
    return "nothing was written"
