"""What methods see in a real walk's pictures, frame by frame, and how far from the lidar's points that is."""

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

#: What stands in every picture, by name: all cells; the first one of each azimuth that stands out; all that do.
_CFAR = Cfar(window=8, guard=4, threshold=64.0)
_BEFORE = ("picture", "cfar")

Cells = Bool[np.ndarray, "range column"]
Ranges = Float[np.ndarray, "bearing"]


class Distances(NamedTuple):
    """How far a method's points of one frame are from the lidar's: of the same number, and of the same instant, nan
    where the lidar has no picture of it."""

    number: PointCloudDistance
    instant: PointCloudDistance


class Judged(NamedTuple):
    """A walk.

    Attributes:
        apart: of each method, for every frame that is judged.
        ranges: scans of each method, and of the lidar at the same instants.
        partner: the lidar's frame of each frame's instant; -1: it has none.
        clouds: the lidar's points, by its own frames.
        pictures: the radar's.
    """

    apart: dict[str, list[Distances]]
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
    """Go through a walk's frames once; `report` takes how many are done."""
    partner = clock.partners(walk.frames)
    clouds = [polar.cartesian(walk.lidar(frame)) for frame in range(walk.frames)]
    found = Judged({}, {}, partner, clouds, np.empty((walk.frames, polar.ROWS, polar.COLUMNS), np.uint8))
    nothing = np.empty((0, 2))
    for frame, picture, cells, first in _methods(walk, networks):
        same = clouds[partner[frame]] if partner[frame] >= 0 else nothing
        found.pictures[frame] = picture
        told = {name: polar.cartesian(each) for name, each in cells.items()}
        told |= {name: known[frame] for name, known in others.items() if frame in known}
        for name, each in told.items():
            if frame >= FIRST:
                apart = Distances(PointCloudDistance.of(each, clouds[frame]), PointCloudDistance.of(each, same))
                found.apart.setdefault(name, []).append(apart)
        # The nearest points; pictures and CFAR have many that stand before a surface.
        scans = {name: scan(each) for name, each in (told | {"lidar": same}).items() if name not in _BEFORE}
        for name, each in (scans | first).items():
            if name not in found.ranges:
                found.ranges[name] = np.full((walk.frames, len(BEARINGS)), np.nan)
            found.ranges[name][frame] = each
        report(frame + 1)
    return found


def _methods(
    walk: Walk, networks: dict[str, Reader]
) -> Iterator[tuple[int, UInt8[np.ndarray, "range azimuth"], dict[str, Cells], dict[str, Ranges]]]:
    """A walk's pictures, frame by frame, where each method sees something in them, and scans of those that tell first
    surfaces themselves."""
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
