"""Small and full disks."""

import errno
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def disk(folder: Path, size: int, image: Path | None = None) -> Iterator[Path]:
    """A file system of a given size in KiB, in a file or in memory, if root can mount one."""
    folder.mkdir()
    if image is None:
        mount = ["mount", "-t", "tmpfs", "-o", f"size={size}k", "tmpfs", folder]
    else:
        subprocess.run(["mkfs.ext4", "-q", "-m", "0", image, str(size)], check=True)
        mount = ["mount", "-o", "loop", image, folder]
    if os.geteuid() != 0 or subprocess.run(mount, stderr=subprocess.DEVNULL).returncode:
        pytest.skip("needs root and leave to mount a disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


def fill(path: Path) -> None:
    """Fill a disk with a file."""
    with path.open("wb", buffering=0) as file:
        size = 1 << 30
        while size >= 1 << 12:
            try:
                os.posix_fallocate(file.fileno(), file.seek(0, os.SEEK_END), size)
            except OSError as error:
                assert error.errno == errno.ENOSPC
                size >>= 1
