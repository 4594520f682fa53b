"""Tracks of moving paths at the nodes of a burst: scatterers on movers, and moving plates as mirrors."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from radarize.radar.config import RadarConfig
from radarsim.propagation.burst import NODES, BurstClock
from radarsim.propagation.environment import View
from radarsim.propagation.isometry import after, image, inverse
from radarsim.propagation.paths import GEOMETRY, Kind, Paths
from radarsim.propagation.reflectors import Flat


def followed(view: View, config: RadarConfig, paths: Paths) -> Paths:
    """Add the tracks of moving paths."""
    flat = view.facing
    moving = paths.moving | (np.append(flat.plate, -1)[paths.mirrors] >= 0).any(axis=1)
    rows = np.flatnonzero(moving)
    if not len(rows):
        return paths
    some, track = paths[rows], np.full(len(paths), -1)
    track[rows] = np.arange(len(rows))
    tracks, moves = np.zeros((len(rows), 3, GEOMETRY)), view.obstacles.plates.moves(view.observation)
    points, images = some.kind == Kind.POINT, some.kind == Kind.IMAGE
    own = _own(view, config, some[points])
    for end in range(2):
        chain = _reflections(flat, some.mirrors[points, 2 * end : 2 * end + 2], moves)
        place = image(inverse(chain[:, 3]), some.points[:, end])  # the scatterer itself, not its image in the mirrors
        tracks[points, :, 3 * end : 3 * end + 3] = image(chain[:, :3], place[:, None] + own)
    # a plate's own echo moves with the plate, one over several mirrors by the product of their reflections
    mirrors, now = some.mirrors[images, :3], some.images[:, None]
    rigid = moves[flat.frame[mirrors[:, 0]], flat.plate[mirrors[:, 0]], :3]
    chain = _reflections(flat, mirrors, moves)
    by_chain = after(after(chain[:, :3], inverse(chain[:, 3:])), now)
    by_plate = after(after(rigid, now), inverse(rigid))
    turned = np.where((mirrors[:, 1] < 0)[:, None, None, None], by_plate, by_chain)
    tracks[images, :, :12] = turned.reshape(len(turned), 3, 12)
    return replace(paths, moving=moving, track=track, tracks=tracks)


def _reflections(
    flat: Flat, mirrors: Int[np.ndarray, "n mirror"], moves: Float[np.ndarray, "frame plate 4 3 4"]
) -> Float[np.ndarray, "n 4 3 4"]:
    """Products of the reflections in some mirrors (-1: none) at a burst's nodes and at its centre.

    Args:
        flat: all mirrors.
        mirrors: in order from the sensor on.
        moves: see `MovingPlates.moves`.
    """
    out = np.zeros((len(mirrors), 4, 3, 4))
    out[..., :3] = np.eye(3)
    for column in mirrors.T[::-1]:
        rows = np.flatnonzero(column >= 0)
        m = column[rows]
        rigid = moves[flat.frame[m], flat.plate[m]]
        normal = np.einsum("ntij,nj->nti", rigid[..., :3], flat.normal[m])
        along = np.einsum("nti,ntij->ntj", normal, out[rows])
        along[..., 3] -= np.einsum("nti,nti->nt", normal, image(rigid, flat.center[m, None]))
        out[rows] -= 2 * normal[..., None] * along[..., None, :]
    return out


def _own(view: View, config: RadarConfig, points: Paths) -> Float[np.ndarray, "point 3 3"]:
    """Displacement of scatterers on movers from the centre to the burst's nodes (point, node, axis), m."""
    moving, targets = view.environment.moving, view.targets
    offsets = BurstClock.of(config).half * np.append(NODES, 0.0)
    own = np.zeros((len(points), 3, 3))
    for frame in np.unique(points.frame):
        rows = np.flatnonzero((points.frame == frame) & (points.scatterer >= targets.still))
        which = (points.scatterer[rows] - targets.still) % max(len(moving), 1)
        places = moving.positions(view.observation.time[frame] + offsets)[:, which]
        own[rows] = (places[:3] - places[3]).transpose(1, 0, 2)
    return own
