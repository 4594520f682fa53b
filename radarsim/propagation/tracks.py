"""Where the paths of what moves are at the nodes of a burst: scatterers on movers, and moving plates as mirrors."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from radarize.radar.config import RadarConfig
from radarsim.propagation import movingplates
from radarsim.propagation.burst import NODES, BurstClock
from radarsim.propagation.environment import View
from radarsim.propagation.paths import GEOMETRY, Kind, Paths


def followed(view: View, config: RadarConfig, paths: Paths) -> Paths:
    """Paths with tracks of those that move."""
    flat = view.facing
    moving = paths.moving | movingplates.carried(flat, paths.mirrors)
    rows = np.flatnonzero(moving)
    if not len(rows):
        return paths
    some, track = paths[rows], np.full(len(paths), -1)
    track[rows] = np.arange(len(rows))
    found, moves = np.zeros((len(rows), 3, GEOMETRY)), view.obstacles.plates.moves(view.observation)
    point, image = some.kind == Kind.POINT, some.kind == Kind.IMAGE
    own, points = _own(view, config, some[point]), some.points
    for end in range(2):
        mirrors = some.mirrors[point, 2 * end : 2 * end + 2]
        found[point, :, 3 * end : 3 * end + 3] = movingplates.moved(flat, points[:, end], own, mirrors, moves)
    turned = movingplates.turned(flat, some.images, some.mirrors[image, :3], moves)
    found[image, :, :12] = turned.reshape(len(turned), 3, 12)
    return replace(paths, moving=moving, track=track, tracks=found)


def _own(view: View, config: RadarConfig, points: Paths) -> Float[np.ndarray, "point 3 3"]:
    """How far scatterers on movers have moved from the middle to the burst's nodes (point, node, axis), m."""
    moving, targets = view.environment.moving, view.targets
    offsets = BurstClock.of(config).half * np.append(NODES, 0.0)
    own = np.zeros((len(points), 3, 3))
    for frame in np.unique(points.frame):
        rows = np.flatnonzero((points.frame == frame) & (points.scatterer >= targets.still))
        which = (points.scatterer[rows] - targets.still) % max(len(moving), 1)
        places = moving.positions(view.observation.time[frame] + offsets)[:, which]
        own[rows] = (places[:3] - places[3]).transpose(1, 0, 2)
    return own
