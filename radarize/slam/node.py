"""A node of the graph: the rays of one or several consecutive scans, seen from one place."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from radarize.pose import between, transform
from radarize.slam.config import SlamConfig
from radarize.slam.matcher import thin


@dataclass(frozen=True)
class Scan:
    """One scan as it came, with the odometry pose of its instant.

    Attributes:
        time: s.
        odometry: pose in the odometry frame.
        azimuths: rad, positive to the left.
        ranges: m; inf: nothing seen; nan: not known.
    """

    time: float
    odometry: Float[np.ndarray, "3"]
    azimuths: Float[np.ndarray, "beam"]
    ranges: Float[np.ndarray, "beam"]


@dataclass(frozen=True)
class Node:
    """Rays in the frame of the node's reference scan.

    Attributes:
        time: of the reference scan, s.
        origins, ends: of the rays, m.
        hits: False for rays that saw nothing as far as their end.
        points: ends of hits, thinned for matching.
        fronts: places `LoopConfig.front` before the ends of hits, thinned.
    """

    time: float
    origins: Float[np.ndarray, "ray 2"]
    ends: Float[np.ndarray, "ray 2"]
    hits: Bool[np.ndarray, "ray"]
    points: Float[np.ndarray, "point 2"]
    fronts: Float[np.ndarray, "front 2"]

    @classmethod
    def gather(cls, scans: list[Scan], config: SlamConfig) -> "Node":
        """Join scans by their odometry; the one in the middle gives the frame."""
        count = min(len(scans), config.node.scans)
        used = [scans[i] for i in np.unique(np.linspace(0, len(scans) - 1, count).round().astype(int))]
        reference = used[len(used) // 2]
        rays = [_rays(scan, between(reference.odometry, scan.odometry), config) for scan in used]
        origins, ends, hits = (np.concatenate(parts) for parts in zip(*rays, strict=True))
        echo, way = ends[hits], ends[hits] - origins[hits]
        share = config.loop.front / np.maximum(np.linalg.norm(way, axis=1), config.loop.front + 1e-9)
        before = echo - share[:, None] * way if config.loop.front else echo[:0]
        # Rays are half of what a session keeps in memory: single precision is 1 um at 10 m.
        return cls(
            reference.time,
            origins.astype(np.float32),
            ends.astype(np.float32),
            hits,
            thin(echo, config.matcher.spacing).astype(np.float32),
            thin(before, config.matcher.spacing).astype(np.float32),
        )


def _rays(scan: Scan, pose: np.ndarray, config: SlamConfig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    grid = config.grid
    hits = (scan.ranges >= grid.min_range) & (scan.ranges <= grid.max_range)
    nothing = (scan.ranges > grid.max_range) & (grid.free_range > 0)
    lengths = np.where(hits, scan.ranges, min(grid.free_range, grid.max_range))
    used = hits | nothing
    lengths, azimuths = lengths[used], scan.azimuths[used]
    ends = transform(pose, lengths[:, None] * np.stack([np.cos(azimuths), np.sin(azimuths)], axis=-1))
    return np.broadcast_to(pose[:2], ends.shape), ends, hits[used]
