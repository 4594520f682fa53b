"""Lidar logs as occupancy grids: CARMEN logs with corrected poses, and scans with true poses.

A CARMEN line ``FLASER n r1 ... rn x y theta ...`` holds n ranges over 180 degrees and the pose of the laser;
``ROBOTLASER1 type start fov step max accuracy remission n r1 ... rn m ... x y theta ...`` contains its own angles
(CARMEN logger format, http://carmen.sourceforge.net/logger_playback.html). `NAME.scans.npz` holds ``ranges``,
``angle_min``, ``angle_increment`` and ``range_max``, the poses lie beside it in `NAME.truth.tum`.
"""

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numba import njit
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError, explained
from radarize.io.files import read_bytes
from radarize.io.npyfile import read_npz
from radarize.io.tum import read_tum
from radarsim.world.importers.occupancy import OccupancyGrid
from radarsim.world.importers.part import unreported

#: Larger readings mean no echo: SICK scanners report 32.767 or 81.83 m then.
USABLE = 30.0
#: Fraction of the beams reaching a cell that must end there for it to be occupied. Walls at grazing incidence are
#: passed by many beams in the same cell; people who walk past leave a smaller fraction.
OCCUPIED = 0.3
#: Smallest number of beams through a free cell.
SEEN = 2
_LARGEST = 20e6  # cells, of 8 bytes
#: Largest size of a log, unpacked, bytes.
_BYTES = 256 << 20
#: Largest size of the scans in an ``.npz``, bytes.
_FIELDS = ("ranges", "angle_min", "angle_increment", "range_max")


@dataclass(frozen=True)
class Scan:
    """One sweep: laser pose x, y (m), yaw (rad); ranges (m), and the bearing of each against the laser (rad)."""

    pose: tuple[float, float, float]
    ranges: Float[np.ndarray, "beam"]
    bearings: Float[np.ndarray, "beam"]


def grid(path: Path, resolution: float, progress: Callable[..., object] = unreported) -> OccupancyGrid:
    """Count the beams that end in each cell and those that pass it, and derive occupancy.

    Args:
        path: ``.log``, ``.log.gz`` or ``.scans.npz``.
        resolution: side of a cell, m.
        progress: called with a stage's name, scans done, total scans.

    Raises:
        InputError: unreadable, a malformed line (with its number), or no scans.
    """
    scans = scans_of(path)
    ends, starts = [], []
    for scan in scans:
        heading = scan.pose[2] + scan.bearings
        ends.append(np.array(scan.pose[:2]) + scan.ranges[:, None] * np.stack([np.cos(heading), np.sin(heading)], 1))
        starts.append(np.broadcast_to(scan.pose[:2], ends[-1].shape))
    usable = [(scan.ranges > 0.05) & (scan.ranges < USABLE) for scan in scans]
    seen = np.concatenate([end[ok] for end, ok in zip(ends, usable, strict=True)] + [np.zeros((0, 2))])
    if not len(seen):
        raise InputError(f"{path}: holds no range between 0.05 and {USABLE:g} m, expected a log of lidar scans")
    low = np.minimum(seen.min(axis=0), np.min([scan.pose[:2] for scan in scans], axis=0)) - 0.5
    high = np.maximum(seen.max(axis=0), np.max([scan.pose[:2] for scan in scans], axis=0)) + 0.5
    shape = np.ceil((high - low) / resolution)
    if not shape.prod() <= _LARGEST:
        raise InputError(
            f"{path}: spans {high[0] - low[0]:.0f} x {high[1] - low[1]:.0f} m, too much for cells of {resolution:g} m, "
            "expected corrected poses of one building"
        )
    hits, passes = np.zeros(shape.astype(int), np.int32), np.zeros(shape.astype(int), np.int32)
    for number, (start, end, ok) in enumerate(zip(starts, ends, usable, strict=True), 1):
        _cast((start[ok] - low) / resolution, (end[ok] - low) / resolution, hits, passes)
        if number % 16 == 0 or number == len(scans):
            progress("casting scans", number, len(scans))
    occupied = hits > OCCUPIED * (hits + passes)
    return OccupancyGrid(occupied, (passes >= SEEN) & ~occupied, resolution, (float(low[0]), float(low[1]), 0.0))


@njit(cache=True)
def _cast(starts, ends, hits, passes):
    """Count the cells along each beam (Amanatides and Woo 1987), with the last cell as a hit."""
    for beam in range(len(starts)):
        x, y = starts[beam]
        dx, dy = ends[beam, 0] - x, ends[beam, 1] - y
        i, j, last_i, last_j = int(x), int(y), int(ends[beam, 0]), int(ends[beam, 1])
        step_i, step_j = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        across_i = abs(1 / dx) if dx != 0 else np.inf
        across_j = abs(1 / dy) if dy != 0 else np.inf
        next_i = ((i + 1 - x) if dx > 0 else (x - i)) * across_i if dx != 0 else np.inf
        next_j = ((j + 1 - y) if dy > 0 else (y - j)) * across_j if dy != 0 else np.inf
        for _ in range(abs(last_i - i) + abs(last_j - j)):
            passes[i, j] += 1
            if next_i < next_j:
                i += step_i
                next_i += across_i
            else:
                j += step_j
                next_j += across_j
        hits[last_i, last_j] += 1


def scans_of(path: Path) -> list[Scan]:
    """All scans of a log.

    Raises:
        InputError: unreadable, a malformed line (with its number), or no scans.
    """
    if path.suffix == ".npz":
        return _numpy_scans(path)
    raw = read_bytes(path, "a log of lidar scans", _BYTES)
    if raw[:2] == b"\x1f\x8b":
        with explained(f"{path}: cannot be unpacked"):
            packed = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
            raw = packed.decompress(raw, _BYTES)
            if not packed.eof:
                raise ValueError(f"it is cut short, or makes more than {_BYTES} bytes")
    text = raw.decode("ascii", errors="replace")
    scans = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0] not in ("FLASER", "ROBOTLASER1"):
            continue
        try:
            scan = _front_laser(words) if words[0] == "FLASER" else _robot_laser(words)
        except (ValueError, IndexError):
            scan = None
        if scan is None or not np.all(np.isfinite([*scan.pose, *scan.ranges])):
            raise InputError(f"{path}: line {number} is no complete {words[0]} message, expected ranges and a pose")
        scans.append(scan)
    if not scans:
        raise InputError(f"{path}: holds no FLASER or ROBOTLASER1 line, expected a CARMEN log")
    return scans


def _front_laser(words: list[str]) -> Scan:
    count = int(words[1])
    values = np.array(words[2 : count + 5], float)
    if count < 2 or len(values) < count + 3:
        raise ValueError
    # 180 degrees: 181 or 361 beams include both ends, 180 beams are offset by half a step.
    step = np.pi / (count - count % 2)
    return Scan(tuple(values[count:]), values[:count], step * (np.arange(count) - (count - 1) / 2))


def _robot_laser(words: list[str]) -> Scan:
    start, step, farthest = float(words[2]), float(words[4]), float(words[5])
    count = int(words[8])
    ranges = np.array(words[9 : 9 + count], float)
    after = 9 + count + 1 + int(words[9 + count])
    pose = np.array(words[after : after + 3], float)
    if len(ranges) < count or len(pose) < 3:
        raise ValueError
    return Scan(tuple(pose), np.where(ranges < farthest, ranges, USABLE), start + step * np.arange(count))


def _numpy_scans(path: Path) -> list[Scan]:
    poses_file = path.with_name(path.name.removesuffix(".npz").removesuffix(".scans") + ".truth.tum")
    found = read_npz(path, str(path), _FIELDS, path.stat().st_size)
    for name in _FIELDS:
        if name not in found or found[name].ndim != (2 if name == "ranges" else 0):
            raise InputError(f"{path}: has no {name}, expected ranges (scan, beam) and one each of {_FIELDS[1:]}")
    ranges = found["ranges"].astype(float)
    bearings = float(found["angle_min"]) + float(found["angle_increment"]) * np.arange(ranges.shape[1])
    farthest = float(found["range_max"])
    if not np.isfinite(bearings).all():
        raise InputError(f"{path}: angle_increment is {found['angle_increment']}, expected finite angles")
    _, poses = read_tum(poses_file)
    if len(poses) != len(ranges):
        raise InputError(f"{poses_file}: holds {len(poses)} poses, expected {len(ranges)}, one for each scan")
    yaw = Rotation.from_quat(poses[:, 3:]).as_euler("ZYX")[:, 0]
    return [
        Scan((pose[0], pose[1], angle), np.where(row < farthest, row, USABLE), bearings)
        for pose, angle, row in zip(poses, yaw, ranges, strict=True)
    ]
