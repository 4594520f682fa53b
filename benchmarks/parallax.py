"""How the strong echoes of real walks move: as posts, by their whole parallax, or as walls' flashes, by none of it.

`radarize.odometry.bearings` takes every echo for one or the other, and has seen simulated walks alone. Here strong
cells of RadarHD's training pictures are followed from frame to frame, and their bearings in the world, by the lidar's
poses, are fitted by their parallax: the slope is the share of it by which they move.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import convolve1d, maximum_filter

from benchmarks.results import CLONE, POSES, Page, radarhd, script, tracked
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.poses import by_instant, poses_of
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.evaluation.benchmark.choices import TRAINING
from radarize.io.pose import wrap
from radarize.signal.polar import AZIMUTHS, LEAKAGE, RANGES

#: Least value of a strong cell (255: the strongest of a frame), so many of a frame at most, and m that a radar's
#: picture reads too far.
_STRONG, _MOST, _FAR = 150, 8, 0.25
#: m and rad by which an echo may be off in the next frame, and frames for which it may be missing.
_RANGE, _BEARING, _MISSING = 0.1, np.radians(8.0), 4
#: Frames and rad of parallax that a fit needs.
_FRAMES, _PARALLAX = 8, np.radians(12.0)
#: Frames over which the lidar's positions are averaged before they tell velocities.
_SMOOTH = 5
#: Edges between the shares of a table's columns.
EDGES = (-0.2, 0.2, 0.5, 0.75, 1.25)


@dataclass
class Followed:
    """A strong cell that is followed: range now (m), the last frame that had it, its bearing in the world in those that
    did (rad), its parallax since the first one, now and in those."""

    range: float
    last: int
    bearings: list[float]
    parallax: float = 0.0
    parallaxes: list[float] = field(default_factory=lambda: [0.0])

    def share(self) -> float:
        """Of its parallax by which it moves; nan where that is too small to tell."""
        if len(self.bearings) < _FRAMES or np.ptp(self.parallaxes) < _PARALLAX:
            return np.nan
        return float(np.polyfit(self.parallaxes, self.bearings, 1)[0])


def strong(picture: UInt8[np.ndarray, "range azimuth"]) -> Float[np.ndarray, "cell 2"]:
    """Range (m) and bearing (rad) of a picture's strongest cells, between pixels."""
    level = picture.astype(float)
    peaks = (level == maximum_filter(level, 3)) & (level >= _STRONG)
    peaks[: LEAKAGE + 2] = peaks[-1] = peaks[:, :3] = peaks[:, -3:] = False
    rows, columns = np.nonzero(peaks)
    order = np.argsort(-level[rows, columns], kind="stable")[:_MOST]
    rows, columns = rows[order], columns[order]
    left, middle, right = (level[rows, columns + k] for k in (-1, 0, 1))
    bend = np.minimum(left - 2 * middle + right, -1e-9)
    between = np.clip((left - right) / bend / 2, -1, 1)
    return np.stack([RANGES[rows] - _FAR, AZIMUTHS[columns] + between * (AZIMUTHS[1] - AZIMUTHS[0])], axis=1)


def followed(
    pictures: Iterator[UInt8[np.ndarray, "range azimuth"]], poses: Float[np.ndarray, "frame 3"]
) -> Iterator[Followed]:
    """Strong cells of pictures at poses (x, y, yaw; nan: not known), one every `PERIOD`."""
    place = convolve1d(poses[:, :2], np.full(_SMOOTH, 1 / _SMOOTH), axis=0, mode="nearest")
    velocity = np.gradient(place, PERIOD, axis=0)
    kept: list[Followed] = []
    for frame, (picture, (x, y), yaw) in enumerate(zip(pictures, velocity, poses[:, 2], strict=True)):
        if not np.isfinite([x, y, yaw]).all():
            continue
        new = [tuple(cell) for cell in strong(picture) if cell[0] > 0]
        for each in kept:
            cos, sin = np.cos(each.bearings[-1]), np.sin(each.bearings[-1])
            each.range -= PERIOD * (x * cos + y * sin)
            each.parallax -= PERIOD * (y * cos - x * sin) / max(each.range, 0.2)
            bearing, near = each.bearings[-1], [cell for cell in new if abs(cell[0] - each.range) < _RANGE]
            off = {cell: float(wrap(cell[1] + yaw - bearing)) for cell in near}
            cell = min(off, key=lambda cell: abs(off[cell]), default=None)
            if cell is not None and abs(off[cell]) <= _BEARING:
                new.remove(cell)
                each.range, each.last = cell[0], frame
                each.bearings.append(bearing + off[cell])
                each.parallaxes.append(each.parallax)
        yield from (each for each in kept if frame - each.last > _MISSING)
        kept = [each for each in kept if frame - each.last <= _MISSING]
        kept += [Followed(cell[0], frame, [cell[1] + yaw]) for cell in new]
    yield from kept


def row(name: str, found: list[Followed]) -> dict[str, object]:
    """Of all frames of echoes that tell their share, how many have which."""
    shares = np.array([each.share() for each in found])
    frames = np.array([len(each.bearings) for each in found])[np.isfinite(shares)]
    shares = shares[np.isfinite(shares)]
    parts = np.bincount(np.digitize(shares, EDGES), frames, minlength=len(EDGES) + 1) / frames.sum()
    names = [f"below {EDGES[0]:g}", *(f"{a:g} to {b:g}" for a, b in pairwise(EDGES)), f"above {EDGES[-1]:g}"]
    return {"walks": name, "echoes": len(shares), "frames": int(frames.sum())} | {
        f"{each}, %": 100 * part for each, part in zip(names, parts, strict=True)
    }


@script("How strong echoes of real walks move", data=CLONE, poses=POSES)
def main(options: argparse.Namespace) -> Page:
    """Of the training walks."""
    walks, found = [Walk.find(options.data, number) for number in TRAINING], []
    for walk in tracked(walks, "walks"):
        poses = by_instant(poses_of(walk, options.poses), Clock.of(walk))
        found += followed(map(walk.radar, range(walk.frames)), poses)
    return Page(
        [row("RadarHD, train", found)],
        data=radarhd("RadarHD's walks", walks),
        notes=[
            "Share of its parallax by which an echo's bearing in the world moves, of echoes that are followed over "
            f"{np.degrees(_PARALLAX):.0f} deg of parallax: 1 for posts, 0 for walls' flashes; % of their frames. The "
            "pictures have the beam of four antennas, 25 deg wide.",
        ],
    )
