"""Files and folders that appear under their name only when complete."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from radarize.io.errors import FULL, DiskFull, InputError, disk_full, explained
from radarize.io.locks import hold


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path` to write to; it replaces `path` at the end of the block, or is deleted on
    error.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        with explained(f"{path}: cannot be written", OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            yield part
            os.replace(part, path)
    except BaseException as error:
        with contextlib.suppress(OSError):
            part.unlink()
        if isinstance(error, Exception) and not isinstance(error, InputError) and disk_full(error):
            raise DiskFull(f"{path}: cannot be written ({FULL})") from error  # libraries have errors of their own
        raise


@contextmanager
def new_folder(path: str | Path, what: str = "export") -> Iterator[Path]:
    """Yield a temporary folder to write to, which becomes `path` at the end of the block, and is deleted on error.

    Raises:
        InputError: the path exists and is not an empty folder, or cannot be written.
    """
    path = Path(path)
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise InputError(f"{path}: already exists, expected the name of a new folder for the {what}")
    with explained(f"{path}: cannot be written", OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f"{path.name}.part") as folder:
            part = Path(folder) / path.name
            yield part
            os.replace(part, path)


class Replacement:
    """Files that replace those in a folder together, or not at all.

    Args:
        folder: destination; created if needed.
        names: names of all possible files. The first is removed first and written last: if it exists, the others are
            complete and belong to it.

    Attributes:
        part: temporary folder to write the files to.

    Raises:
        InputError: the folder cannot be written, or another program writes it.
    """

    def __init__(self, folder: Path, names: Sequence[str]):
        self.folder, self.names, self.part = folder, names, folder / ".part"
        self._new = not folder.exists()
        with explained(f"{folder}: cannot be written", OSError):
            self.part.mkdir(parents=True, exist_ok=True)
            self._held: int | None = hold(self.part)
            for left in self.part.iterdir():  # of a process that died
                left.unlink()

    def place(self) -> None:
        """Move the files to their places; other files of `names` in the folder are deleted.

        Raises:
            InputError: a file cannot be moved.
        """
        with explained(f"{self.folder}: cannot be written", OSError):
            for name in self.names:
                (self.folder / name).unlink(missing_ok=True)
            for name in reversed(self.names):
                if (self.part / name).exists():
                    os.replace(self.part / name, self.folder / name)
            self._let_go()

    def discard(self) -> None:
        """Leave the folder as it was; does nothing after `place`."""
        if self._held is not None:
            self._let_go()
            if self._new:
                with contextlib.suppress(OSError):
                    self.folder.rmdir()

    def _let_go(self) -> None:
        assert self._held is not None  # only once, after `place` there is nothing to discard
        shutil.rmtree(self.part, ignore_errors=True)
        os.close(self._held)
        self._held = None


def write_whole(path: Path, text: str) -> Path:
    """Write a text file under a temporary name and rename it when complete. Bytes of file names that are not UTF-8 are
    written as ``\\udcff``.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8", errors="backslashreplace")
    return path
