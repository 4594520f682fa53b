"""Point clouds and scans of each method on a real walk, and their distances from the lidar's points."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from radarize.baselines.real.networks import Reader
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.point_cloud_distance import PointCloudDistance
from radarize.baselines.walks.poses import BEARINGS, scan, stamps
from radarize.baselines.walks.walks import FIRST, Walk
from radarize.signal import polar
from radarize.signal.points import Cfar, level_around

#: CFAR detector of the methods `cfar` (all detections) and `first-echo` (the first detection of each azimuth).
_CFAR = Cfar(window=8, guard=4, threshold=64.0)
_BEFORE = ("picture", "cfar")

Cells = Bool[np.ndarray, "range column"]
Ranges = Float[np.ndarray, "bearing"]


class Distances(NamedTuple):
    """Distances of a method's points of one frame from the lidar's, matched by frame index and by time; NaN where the
    lidar has no picture."""

    by_index: PointCloudDistance
    by_time: PointCloudDistance


class Judged(NamedTuple):
    """Results of all methods on a walk.

    Attributes:
        distances: by method, distances of the points of every evaluated frame from the lidar's.
        ranges: by method, scans on `BEARINGS`, m; `lidar`: those of the lidar at the same times.
        partner: the lidar's frame nearest in time to each radar frame; -1 if the lidar has none.
        clouds: the lidar's points of each of its frames, m.
        pictures: the radar's pictures.
    """

    distances: dict[str, list[Distances]]
    ranges: dict[str, Float[np.ndarray, "frame bearing"]]
    partner: Int[np.ndarray, "frame"]
    clouds: list[Float[np.ndarray, "point 2"]]
    pictures: UInt8[np.ndarray, "frame range azimuth"]


def judge(
    walk: Walk,
    clock: Clock,
    networks: dict[str, Reader],
    others: dict[str, dict[int, Float[np.ndarray, "point 2"]]],
    report: Callable[[float], None],
) -> Judged:
    """Run all methods on a walk; `report` takes the number of frames done."""
    partner = clock.partners(walk.frames)
    clouds = [polar.cartesian(walk.lidar(frame)) for frame in range(walk.frames)]
    found = Judged({}, {}, partner, clouds, np.empty((walk.frames, polar.ROWS, polar.COLUMNS), np.uint8))
    nothing = np.empty((0, 2))
    for frame, picture, cells, first in _methods(walk, networks):
        same = clouds[partner[frame]] if partner[frame] >= 0 else nothing
        found.pictures[frame] = picture
        points = {name: polar.cartesian(each) for name, each in cells.items()}
        points |= {name: known[frame] for name, known in others.items() if frame in known}
        for name, each in points.items():
            if frame >= FIRST:
                distances = Distances(PointCloudDistance.of(each, clouds[frame]), PointCloudDistance.of(each, same))
                found.distances.setdefault(name, []).append(distances)
        # Scans of the nearest points; pictures and CFAR have many points in front of a surface.
        scans = {name: scan(each) for name, each in (points | {"lidar": same}).items() if name not in _BEFORE}
        for name, each in (scans | first).items():
            if name not in found.ranges:
                found.ranges[name] = np.full((walk.frames, len(BEARINGS)), np.nan)
            found.ranges[name][frame] = each
        report(frame + 1)
    return found


def _methods(
    walk: Walk, networks: dict[str, Reader]
) -> Iterator[tuple[int, UInt8[np.ndarray, "range azimuth"], dict[str, Cells], dict[str, Ranges]]]:
    """Yield for each frame of a walk: frame index, picture, cells with points by method, and scans of those methods
    that estimate first surfaces themselves."""
    times = stamps(walk.frames)
    for frames, pictures in walk.batches():
        seen = {name: network.see(pictures, times[frames]) for name, network in networks.items()}
        for k, picture in enumerate(pictures):
            stands = picture > level_around(picture.astype(float), _CFAR, 0, False) + _CFAR.threshold
            nearest = stands & (np.cumsum(stands, axis=0) == 1)
            cells, first = {"picture": picture > 0, "cfar": stands, "first-echo": nearest}, {}
            for name, (points, ranges) in seen.items():
                cells[name] = points[k]
                if ranges is not None:
                    first[name] = ranges[k]
            yield frames.start + k, picture, cells, first
