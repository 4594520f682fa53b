"""True poses from a TUM trajectory file: ``time x y z qx qy qz qw`` a line."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.errors import InputError
from radarize.recording import Product


def read_tum(path: Path) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]]:
    """Times (s) and poses (position m, unit quaternion x y z w) of a TUM file.

    Raises:
        InputError: naming the line: not eight finite numbers, times that do not ascend, or no unit quaternion.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    rows = []
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
        if not np.isfinite(row).all():
            raise InputError(f"{path}, line {number}: holds {' '.join(words)[:80]}, expected finite numbers")
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


def pose_products(path: Path) -> dict[str, Product]:
    """The poses of a TUM file as data sets of a recording, at their own times."""
    times, poses = read_tum(path)
    return {
        "truth/time": Product(times, "s", f"stamps of the poses of {path.name}"),
        "truth/pose": Product(poses, "m; x y z qx qy qz qw", "sensor in the world"),
    }
