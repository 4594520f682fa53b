"""Node of the pose graph: the rays of one or several consecutive scans, in the frame of one of them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32

from radarize.io.pose import between, transform
from radarize.slam.config import GridConfig, SlamConfig
from radarize.slam.matcher import thin


@dataclass(frozen=True)
class Scan:
    """A scan with the pose of odometry at its time.

    Attributes:
        time: s.
        odometry: pose in the odometry frame.
        azimuths: rad, positive to the left.
        ranges: m; inf: no echo; nan: unknown.
    """

    time: float
    odometry: Float[np.ndarray, "3"]
    azimuths: Float[np.ndarray, "beam"]
    ranges: Float[np.ndarray, "beam"]


class Rays(NamedTuple):
    """Rays of scans.

    Attributes:
        origins, ends: m.
        hits: False for rays without an echo up to their end.
    """

    origins: Float[np.ndarray, "ray 2"]
    ends: Float[np.ndarray, "ray 2"]
    hits: Bool[np.ndarray, "ray"]


@dataclass(frozen=True, slots=True)
class Node:
    """Scans in the frame of the reference scan, the one in their middle.

    All nodes stay in memory. So a node stores the ranges in single precision (1 um at 10 m), and computes rays and
    points, which take three times as much, on request.

    Attributes:
        time: of the reference scan, s.
        poses: of the scans.
        azimuths: of the beams of each scan, rad; scans share the arrays.
        ranges: of all beams, scan by scan, m.
        config: of the back end.
    """

    time: float
    poses: Float[np.ndarray, "scan 3"]
    azimuths: tuple[Float[np.ndarray, "_"], ...]
    ranges: Float32[np.ndarray, "beam"]
    config: SlamConfig

    @classmethod
    def gather(cls, scans: list[Scan], config: SlamConfig) -> "Node":
        """Return the node of some scans, joined by their odometry."""
        count = min(len(scans), config.node.scans)
        used = [scans[i] for i in np.unique(np.linspace(0, len(scans) - 1, count).round().astype(int))]
        reference = used[len(used) // 2]
        with np.errstate(over="ignore"):  # overflows to inf, beyond any range
            ranges = np.concatenate([scan.ranges for scan in used]).astype(np.float32)
        poses = between(reference.odometry, np.array([scan.odometry for scan in used]))
        return cls(reference.time, poses, tuple(scan.azimuths for scan in used), ranges, config)

    @property
    def rays(self) -> Rays:
        """Rays of all scans, in single precision."""
        origins, ends, hits = self._rays()
        return Rays(origins.astype(np.float32), ends.astype(np.float32), hits)

    @property
    def points(self) -> Float32[np.ndarray, "point 2"]:
        """Ends of hits, thinned for matching."""
        _, ends, hits = self._rays()
        return thin(ends[hits], self.config.matcher.spacing).astype(np.float32)

    @property
    def fronts(self) -> Float32[np.ndarray, "front 2"]:
        """Places at a distance of `LoopConfig.front` in front of the hits, thinned; empty if it is 0."""
        front = self.config.loop.front
        if not front:
            return np.zeros((0, 2), np.float32)
        origins, ends, hits = self._rays()
        end, ray = ends[hits], ends[hits] - origins[hits]
        share = front / np.maximum(np.linalg.norm(ray, axis=1), front + 1e-9)
        return thin(end - share[:, None] * ray, self.config.matcher.spacing).astype(np.float32)

    def _rays(self) -> Rays:
        starts = np.cumsum([len(each) for each in self.azimuths])[:-1]
        scans = zip(self.poses, self.azimuths, np.split(self.ranges.astype(float), starts), strict=True)
        rays = [_trace(pose, azimuths, ranges, self.config.grid) for pose, azimuths, ranges in scans]
        return Rays(*(np.concatenate(parts) for parts in zip(*rays, strict=True)))


def _trace(pose: np.ndarray, azimuths: np.ndarray, ranges: np.ndarray, grid: GridConfig) -> Rays:
    hits = (ranges >= grid.min_range) & (ranges <= grid.max_range)
    nothing = (ranges > grid.max_range) & (grid.free_range > 0)
    lengths = np.where(hits, ranges, min(grid.free_range, grid.max_range))
    used = hits | nothing
    lengths, azimuths = lengths[used], azimuths[used]
    ends = transform(pose, lengths[:, None] * np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1))
    return Rays(np.broadcast_to(pose[:2], ends.shape), ends, hits[used])
