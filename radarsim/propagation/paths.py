"""Table of propagation paths: geometry, amplitude, and interactions on the way.

A path's length is known for every antenna and time; its amplitude and visibility are evaluated once per frame, at the
centre of the burst. Three kinds of geometry give the length from a transmit antenna at tx to a receive antenna at rx:

    POINT    |tx - a| + |b - rx|: the target's images in the mirrors of the path out (a) and of the path back (b)
    IMAGE    |tx - M rx|: an isometry M of the receiver: the reflection in a plate, a half turn about its edge, an
             inversion in its corner (together the physical-optics integral over a plate), or a chain of mirrors
    CURVED   the shortest path over a curved surface (`curved.path_over`), plus a delay by slabs

Moving targets have their geometry at the three nodes of the burst (`burst.NODES`) as well: their track.
"""

from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Self

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int, UInt8
from numba import njit, prange
from numpy.typing import ArrayLike

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarsim.motion.trajectory import Motion
from radarsim.propagation.burst import BurstClock, parabola
from radarsim.propagation.curved import SHAPE, facing_point, path_over
from radarsim.propagation.fields import dot, length, minus, vec
from radarsim.propagation.isometry import image, inverse
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Passage
from radarsim.propagation.table import Table

#: Numbers of a path's geometry: a and b; matrix | offset by rows; those of a curved surface (`curved.SpecularPoints`)
#: and a delay, m.
GEOMETRY = SHAPE + 1
#: Largest number of mirrors on a path: two out and two back, or a chain of three.
MIRRORS = 4


class Kind(IntEnum):
    """Kind of geometry that determines a path's length."""

    POINT = 0
    IMAGE = 1
    CURVED = 2


@dataclass(frozen=True)
class Paths(Table):
    """Propagation paths of one frame or of several.

    Attributes:
        frame: index within the batch.
        kind: a `Kind`.
        geometry: geometry of that kind, world frame, m, at the centre of the burst.
        amplitude: square root of received over transmitted power, with phase, as in the beat signal.
        bounces: number of mirrors on the path; the surface, body or plate that echoes does not count.
        through: whether it passes a slab: a wall, a pane, a door.
        blocked: fraction of the amplitude that opaque objects block.
        level: whether a floor or ceiling echoes.
        moving: whether anything on the path moves.
        mirrors: mirrors on the path, in order, as indices of the batch's flat reflectors: of a `POINT` two out and two
            back, of an `IMAGE` the plate that it is a part of, or the chain; -1: none.
        scatterer: index in the batch; -1: none.
        track: row of `tracks`; -1: no motion.
        tracks: geometry of moving paths at the burst's nodes.
    """

    frame: Int[np.ndarray, "path"]
    kind: UInt8[np.ndarray, "path"]
    geometry: Float[np.ndarray, "path 14"]
    amplitude: Complex[np.ndarray, "path"]
    bounces: UInt8[np.ndarray, "path"]
    through: Bool[np.ndarray, "path"]
    blocked: Float32[np.ndarray, "path"]
    level: Bool[np.ndarray, "path"]
    moving: Bool[np.ndarray, "path"]
    mirrors: Int[np.ndarray, "path 4"]
    scatterer: Int[np.ndarray, "path"]
    track: Int[np.ndarray, "path"]
    tracks: Float[np.ndarray, "moving 3 14"] = field(default_factory=lambda: np.zeros((0, 3, GEOMETRY)))

    SHARED = ("tracks",)

    @classmethod
    def of(
        cls, kind: Kind, geometry: Float[np.ndarray, "path *shape"], amplitude: Complex[np.ndarray, "path"],
        **columns: ArrayLike,
    ) -> Self:  # fmt: skip
        """Build paths of one kind; columns that are not given are zero, indices -1.

        Args:
            kind: kind of all paths.
            geometry: (path, 2, 3) of points, (path, 3, 4) of images, (path, 13) or (path, 14) of curved surfaces.
            amplitude: amplitude with phase.
            columns: others, arrays or one value for all.
        """
        found, size = replace(cls.zeros(len(amplitude)), amplitude=amplitude), int(np.prod(geometry.shape[1:]))
        found.geometry[:, :size] = geometry.reshape(-1, size)
        for name, value in ({"kind": kind, "mirrors": -1, "scatterer": -1, "track": -1} | columns).items():
            getattr(found, name)[:] = value
        return found

    def where(self, **columns: object) -> Self:
        """Select rows by values of columns: ``paths.where(bounces=1, moving=False)``."""
        rows = np.ones(len(self), bool)
        for name, value in columns.items():
            rows &= getattr(self, name) == value
        return self[rows]

    @property
    def points(self) -> Float[np.ndarray, "point 2 3"]:
        """a and b of the paths with point geometry, m."""
        return self.geometry[self.kind == Kind.POINT, :6].reshape(-1, 2, 3)

    @property
    def images(self) -> Float[np.ndarray, "image 3 4"]:
        """Isometries of the paths with image geometry."""
        return self.geometry[self.kind == Kind.IMAGE, :12].reshape(-1, 3, 4)

    def apparent(self, position: Float[np.ndarray, "3"]) -> Float[np.ndarray, "path 2 3"]:
        """Apparent places of the target, for the outgoing and for the returning wave.

        Args:
            position: position of the sensor, m.

        Returns:
            Places, m; the mean of their distances from the sensor is half the path's length.
        """
        places = self.geometry[:, :6].reshape(-1, 2, 3).copy()
        rows = self.kind == Kind.IMAGE
        there = self.images
        for end, isometry in enumerate((there, inverse(there))):
            places[rows, end] = (position + image(isometry, position)) / 2
        for row in np.flatnonzero(self.kind == Kind.CURVED):
            places[row] = facing_point(self.geometry[row], tuple(position))
        return places

    def behind(self, observation: Observation, passed: Passage) -> Self:
        """Apply the effect of obstacles; delays shift images and curved paths away."""
        amplitude = self.amplitude * passed.factor
        kept = np.abs(amplitude) > observation.threshold
        paths, passed = self[kept], passed[kept]
        geometry = paths.geometry
        rows, begin = paths.kind == Kind.IMAGE, observation.position[paths.frame]
        isometry = geometry[rows, :12].reshape(-1, 3, 4)
        away = image(isometry, begin[rows]) - begin[rows]
        isometry[:, :, 3] += (passed.delay[rows] / np.linalg.norm(away, axis=1))[:, None] * away
        geometry[rows, :12] = isometry.reshape(-1, 12)
        geometry[paths.kind == Kind.CURVED, SHAPE] = passed.delay[paths.kind == Kind.CURVED]
        blocked = passed.blocked.astype(np.float32)
        return replace(paths, geometry=geometry, amplitude=amplitude[kept], through=passed.through, blocked=blocked)

    def lengths(self, config: RadarConfig, motion: Motion, time: float) -> Float[np.ndarray, "path virtual 3"]:
        """Length of each path and virtual antenna over the burst of the frame that starts at `time`.

        Args:
            config: radar configuration.
            motion: motion of the sensor, with position(t) and rotation(t).
            time: time stamp of the frame, s.

        Returns:
            Parabolas in the burst's normalised time (`burst`), m.
        """
        times = time + BurstClock.of(config).nodes
        return self.lengths_from(motion.position(times), motion.rotation(times).as_matrix(), config)

    def lengths_from(
        self, position: Float[np.ndarray, "node 3"], rotation: Float[np.ndarray, "node 3 3"], config: RadarConfig
    ) -> Float[np.ndarray, "path virtual 3"]:
        """The same from the sensor's poses at the burst's nodes, m, sensor to world."""
        tx = position[:, None] + tx_positions(config) @ rotation.transpose(0, 2, 1)
        rx = position[:, None] + rx_positions(config) @ rotation.transpose(0, 2, 1)
        out = np.empty((len(self), tx.shape[1] * rx.shape[1], 3))
        _lengths((self.kind, self.geometry, self.track, self.tracks), tx, rx, out)
        return out


_POINT, _IMAGE = int(Kind.POINT), int(Kind.IMAGE)


@njit(parallel=True, cache=True)
def _lengths(paths, tx, rx, out):
    kind, geometry, track, tracks = paths
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    for e in prange(len(kind)):
        way = np.empty((nodes, n_tx, n_rx))
        there, back = np.empty(n_tx), np.empty(n_rx)
        for i in range(nodes):
            g = geometry[e] if track[e] < 0 else tracks[track[e], i]
            if kind[e] == _POINT:
                for k in range(n_tx):
                    there[k] = length(minus(vec(g), vec(tx[i, k])))
                for r in range(n_rx):
                    back[r] = length(minus(vec(g[3:]), vec(rx[i, r])))
            for r in range(n_rx):
                q = vec(rx[i, r])
                if kind[e] == _IMAGE:
                    q = dot(vec(g), q) + g[3], dot(vec(g[4:]), q) + g[7], dot(vec(g[8:]), q) + g[11]
                for k in range(n_tx):
                    if kind[e] == _POINT:
                        way[i, k, r] = there[k] + back[r]
                    elif kind[e] == _IMAGE:
                        way[i, k, r] = length(minus(vec(tx[i, k]), q))
                    else:
                        way[i, k, r] = path_over(g, vec(tx[i, k]), q) + g[SHAPE]
        for k in range(n_tx):
            for r in range(n_rx):
                fit = out[e, k * n_rx + r]
                fit[0], fit[1], fit[2] = parabola(way[0, k, r], way[1, k, r], way[2, k, r])
