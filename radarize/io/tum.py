"""TUM trajectory files: lines of ``time x y z qx qy qz qw``, ``#`` comments."""

from pathlib import Path
from typing import TextIO

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.files import read_bytes
from radarize.io.replacing import replacing

#: Number of poses written at a time.
_ROWS = 1024
#: Maximum bytes of a file: a day at 20 Hz.
_LARGEST = 256 << 20
#: s and m, largest stamp (for stamps that count from 1970 too) and position.
_LATEST, _FARTHEST = 1e11, 1e6


def read_tum(path: str | Path) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]]:
    """Read times (s) and poses (position m, unit quaternion x y z w) from a TUM file.

    Raises:
        InputError: a line without eight finite numbers, times that do not ascend, or no unit quaternion; names the
            line.
    """
    lines = read_bytes(path, "poses (TUM)", _LARGEST).decode(errors="replace").splitlines()
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 8:
            raise InputError(
                f"{path}, line {number}: is {line.strip()[:60]!r}, expected eight numbers: time x y z qx qy qz qw"
            )
        if not np.abs(row).max() <= _LATEST or np.abs(row[1:4]).max() > _FARTHEST:  # true for NaN too
            raise InputError(
                f"{path}, line {number}: holds {' '.join(words)[:80]}, expected finite numbers, "
                f"seconds within {_LATEST:g} and metres within {_FARTHEST:g}"
            )
        if rows and row[0] <= rows[-1][0]:
            raise InputError(
                f"{path}, line {number}: has time {words[0]} after {rows[-1][0]:.6f}, expected ascending times"
            )
        if abs((norm := np.linalg.norm(row[4:])) - 1) > 1e-2:
            raise InputError(f"{path}, line {number}: has a quaternion of length {norm:.4f}, expected 1")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: holds no poses, expected lines of time x y z qx qy qz qw")
    table = np.asarray(rows)
    table[:, 4:] /= np.linalg.norm(table[:, 4:], axis=1, keepdims=True)
    return table[:, 0], table[:, 1:]


def write_tum(path: str | Path, times: Float[np.ndarray, "pose"], poses: Float[np.ndarray, "pose 7"]) -> Path:
    """Write times (s) and poses (position m, quaternion x y z w) to a TUM file, which appears when complete.

    Raises:
        InputError: the file cannot be written.
    """
    with replacing(path) as part, part.open("w") as file:
        write_poses(file, times, poses)
    return Path(path)


def write_poses(file: TextIO, times: Float[np.ndarray, "pose"], poses: Float[np.ndarray, "pose 7"]) -> None:
    """Append lines to an open TUM file, see `write_tum`."""
    for start in range(0, len(times), _ROWS):
        rows = slice(start, start + _ROWS)
        np.savetxt(file, np.column_stack([times[rows], poses[rows]]), fmt="%.9f")


def planar(poses: Float[np.ndarray, "pose 7"]) -> Float[np.ndarray, "pose 3"]:
    """Project poses to x, y, yaw (m, rad): yaw is the direction of the x axis, the boresight, on the floor."""
    x, y, z, w = poses[:, 3:].T
    return np.column_stack([poses[:, :2], np.arctan2(2 * (x * y + w * z), 1 - 2 * (y * y + z * z))])


def planar_poses(poses: Float[np.ndarray, "pose 3"]) -> Float[np.ndarray, "pose 7"]:
    """Convert poses x, y, yaw (m, rad) to position and quaternion, z = 0."""
    poses = np.asarray(poses, float)
    zero = np.zeros(len(poses))
    half = poses[:, 2] / 2
    return np.column_stack([poses[:, 0], poses[:, 1], zero, zero, zero, np.sin(half), np.cos(half)])
