"""The files of a run, read for evaluation and reports."""

import json
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import yaml
from jaxtyping import Bool, Float, UInt8

from radarize.errors import InputError
from radarize.replacing import replacing


@dataclass(frozen=True)
class OccupancyMap:
    """A ROS map_server map (``map.pgm`` and ``map.yaml``).

    Attributes:
        pixels: (row, column) grey values, first row at the top (largest y), as in the file.
        resolution: m per cell.
        origin: (x, y, yaw) of the lower left corner in the map's frame, m and rad.
        occupied: (row, column) cells that count as occupied.
        free: (row, column) cells that count as free.
    """

    pixels: UInt8[np.ndarray, "row column"]
    resolution: float
    origin: tuple[float, float, float]
    occupied: Bool[np.ndarray, "row column"]
    free: Bool[np.ndarray, "row column"]

    def centers(self, cells: Bool[np.ndarray, "row column"]) -> Float[np.ndarray, "cell 2"]:
        """Middles of the chosen cells in the map's frame, m."""
        row, column = np.nonzero(cells)
        inside = np.column_stack([column + 0.5, len(self.pixels) - row - 0.5]) * self.resolution
        c, s = np.cos(self.origin[2]), np.sin(self.origin[2])
        return inside @ np.array([[c, s], [-s, c]]) + self.origin[:2]


def read_map(description: Path) -> OccupancyMap:
    """A map from its ``.yaml``.

    Raises:
        InputError: a file is missing or malformed; names file and field.
    """
    try:
        fields = yaml.safe_load(description.read_text())
        image = description.parent / fields["image"]
        resolution = float(fields["resolution"])
        origin = tuple(float(value) for value in fields["origin"])
        negate = bool(int(fields.get("negate", 0)))
        occupied, free = float(fields.get("occupied_thresh", 0.65)), float(fields.get("free_thresh", 0.196))
    except OSError as error:
        raise InputError(f"{description}: cannot be read ({error.strerror})") from error
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"{description}: is no map description ({' '.join(str(error).split())})") from error
    if len(origin) != 3 or not np.isfinite(origin).all() or not (np.isfinite(resolution) and resolution > 0):
        raise InputError(
            f"{description}: has resolution {resolution} and origin {origin}, expected metres and (x, y, yaw)"
        )
    pixels = read_pgm(image)
    chance = (pixels if negate else 255 - pixels.astype(float)) / 255
    return OccupancyMap(pixels, resolution, origin, chance > occupied, chance < free)


def read_pgm(path: Path) -> UInt8[np.ndarray, "row column"]:
    """Pixels of a binary 8-bit PGM (``P5``).

    Raises:
        InputError: not such a file, or cut short.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    words, at = [], 0
    while len(words) < 4 and at < len(content):
        if content[at : at + 1] == b"#":
            at = (content.find(b"\n", at) + 1) or len(content)
        elif content[at : at + 1].isspace():
            at += 1
        else:
            end = at
            while end < len(content) and not content[end : end + 1].isspace():
                end += 1
            words.append(content[at:end])
            at = end
    numbers = [int(word) for word in words[1:] if word.isdigit()]
    if len(numbers) != 3 or words[0] != b"P5" or numbers[2] != 255:
        raise InputError(f"{path}: starts with {content[:20]!r}, expected an 8-bit binary PGM (P5)")
    width, height, _ = numbers
    body = content[at + 1 : at + 1 + width * height]
    if len(body) != width * height:
        raise InputError(f"{path}: holds {len(body)} pixels, expected {width} x {height}")
    return np.frombuffer(body, np.uint8).reshape(height, width)


def read_scans(path: Path) -> dict[str, np.ndarray]:
    """All data sets of a run's ``scans.h5`` by path.

    Raises:
        InputError: unreadable, or without times, ranges and azimuths of matching lengths.
    """
    found: dict[str, np.ndarray] = {}
    try:
        with h5py.File(path, "r") as file:
            file.visititems(
                lambda name, item: found.__setitem__(name, item[()]) if isinstance(item, h5py.Dataset) else None
            )
    except OSError as error:
        raise InputError(f"{path}: is no readable HDF5 file ({str(error).splitlines()[0]})") from error
    for name in ("time", "ranges", "azimuths"):
        if name not in found:
            raise InputError(f"{path}: has no /{name}, expected /time, /ranges and /azimuths")
    shape = (len(found["time"]), len(found["azimuths"]))
    if found["ranges"].shape != shape:
        raise InputError(f"{path}: /ranges has shape {found['ranges'].shape}, expected {shape} (time, azimuth)")
    for name in ("velocity", "velocity_covariance", "truth/velocity", "truth/scan"):
        if name in found:
            # Truth that was written ahead of the last whole frame is cut.
            found[name] = found[name][: shape[0]]
            if len(found[name]) != shape[0]:
                raise InputError(f"{path}: /{name} has {len(found[name])} rows, expected {shape[0]} as /time")
    return found


def read_json(path: Path) -> dict:
    """A JSON object, empty if there is no such file.

    Raises:
        InputError: it is not JSON.
    """
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds a {type(content).__name__}, expected an object")
    return content


def write_whole(path: Path, text: str) -> Path:
    """Write a text file under a temporary name and rename it when it is whole.

    Raises:
        InputError: it cannot be written.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
    return path
