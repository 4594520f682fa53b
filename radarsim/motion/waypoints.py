"""Way-points read from a file."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from radarize.io.errors import InputError
from radarize.io.files import read_text
from radarize.io.tum import read_tum
from radarize.io.yamlfile import read_yaml

_APART = 0.5  # m between way-points taken from a trajectory


def read_waypoints(path: str | Path) -> Float[np.ndarray, "n 2"]:
    """Read way-points x y in m.

    Args:
        path: a YAML list of [x, y] (``.yaml``, alone or under the key ``waypoints``), a trajectory (``.tum``, sampled
            every half metre), or lines of x and y, separated by commas or blanks, with an optional header line.

    Raises:
        InputError: missing or malformed file, a value that is not finite, fewer than two way-points.
    """
    path = Path(path)
    if path.suffix == ".tum":
        rows: Sequence[ArrayLike] = _thinned(read_tum(path)[1][:, :2])
    else:
        rows = _listed(path) if path.suffix in (".yaml", ".yml") else _lines(path)
    if len(rows) < 2:
        raise InputError(f"{path}: holds {len(rows)} way-points, expected at least 2")
    return np.array(rows, float)


def _listed(path: Path) -> list[list[float]]:
    data = read_yaml(path)
    if isinstance(data, dict) and set(data) == {"waypoints"}:
        data = data["waypoints"]
    if not isinstance(data, list):
        raise InputError(f"{path}: holds {type(data).__name__}, expected a list of [x, y], or one named waypoints")
    return [_place(f"{path}, way-point {number}", item) for number, item in enumerate(data, 1)]


def _lines(path: Path) -> list[list[float]]:
    rows: list[list[float]] = []
    for number, line in enumerate(read_text(path, "way-points").splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if words and not (not rows and all(word[0].isalpha() for word in words) and number == 1):
            rows.append(_place(f"{path}, line {number}", words))
    return rows


def _place(where: str, item: object) -> list[float]:
    try:
        x, y = map(float, item if isinstance(item, list) else ())
        if np.isfinite([x, y]).all():
            return [x, y]
    except (TypeError, ValueError, OverflowError):
        pass
    found = " ".join(map(str, item)) if isinstance(item, list) else item
    raise InputError(f"{where}: is {str(found)[:60]!r}, expected two finite numbers: x y in m")


def _thinned(places: Float[np.ndarray, "n 2"]) -> list[Float[np.ndarray, "2"]]:
    kept = [places[0]]
    for place in places[1:]:
        if np.linalg.norm(place - kept[-1]) >= _APART:
            kept.append(place)
    return kept
