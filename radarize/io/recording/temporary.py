"""Recordings in temporary files."""

import shutil
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path

from radarize.io.recording.reader import Recording


def in_temporary_file(write: Callable[[Path], object], name: str = "recording.h5") -> Recording:
    """Return a recording that `write` writes to a path; its file is deleted with the object, or when the process
    ends."""
    folder = Path(tempfile.mkdtemp(prefix="radarize-"))
    try:
        write(folder / name)
        recording = Recording(folder / name)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    weakref.finalize(recording, shutil.rmtree, folder, ignore_errors=True)
    return recording
