"""Echoes of one frame: which paths there are, how strong, and why.

An echo is either a pair of legs to a scatterer (`legs`), straight, over mirrors, through slabs: two world points
(a, b), the scatterer as seen through the mirrors of its outgoing and of its returning leg, with the path length
|tx - a| + |b - rx|. Or it is an image, an isometry M of the receiver, with the path length |tx - M rx|: plates (the
reflection in the plane, a half turn about each edge, an inversion in each corner, which together are the
physical-optics integral over a rectangle) and chains of two and three mirrors (`chains`). Both stay exact for every
antenna and instant while amplitudes and visibility are taken once per frame, at the middle of the burst.
"""

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from jaxtyping import Complex, Float, UInt8
from numba import njit, prange

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarsim.propagation.burst import BurstClock, parabola
from radarsim.propagation.curved import SHAPE, path_over
from radarsim.propagation.fields import dot, length, minus
from radarsim.propagation.fields import vector as vec


class Provenance(IntEnum):
    """Why there is an echo."""

    DIRECT = 0  #: corners of two or three mirrors at right angles, too: they echo from where they stand
    FLOOR_CEILING = 1
    GHOST_1 = 2  #: over one mirror on the way out or back
    GHOST_2 = 3  #: over two mirrors, or by two mirrors alone that form no corner
    GHOST_3 = 4  #: by three mirrors alone that form no corner
    THROUGH_SLAB = 5  #: through a wall, pane or door, whatever else
    MOVING = 6  #: from something that moves, straight or over mirrors


@dataclass(frozen=True)
class Echoes:
    """The echoes of a frame, points first, then images; what moves is last among either, and before it round bodies'.

    Attributes:
        points: a and b of point echoes, world, m, at the middle of the burst.
        images: 3 x 4 isometries (matrix | offset) of the receiver, world.
        amplitude: square root of received over transmitted power, with phase, as in the beat signal.
        provenance: a `Provenance` each.
        moves: of the last points, how far a and b have moved at the burst's three nodes (`synthesis.NODES`), m.
        turns: of the last images, what they are at these nodes.
        shapes: of those before, the round bodies that these are of (`curved.Arcs`), and delays, m.
    """

    points: Float[np.ndarray, "point 2 3"]
    images: Float[np.ndarray, "image 3 4"]
    amplitude: Complex[np.ndarray, "echo"]
    provenance: UInt8[np.ndarray, "echo"]
    moves: Float[np.ndarray, "moving 2 3 3"] = field(default_factory=lambda: np.zeros((0, 2, 3, 3)))
    turns: Float[np.ndarray, "turning 3 3 4"] = field(default_factory=lambda: np.zeros((0, 3, 3, 4)))
    shapes: Float[np.ndarray, "round 14"] = field(default_factory=lambda: np.zeros((0, SHAPE + 1)))

    def __len__(self) -> int:
        return len(self.amplitude)

    def of(self, provenance: Provenance) -> "Echoes":
        """The echoes of one cause."""
        keep = self.provenance == provenance
        n, turning = len(self.points), len(self) - len(self.turns)
        return Echoes(
            self.points[keep[:n]],
            self.images[keep[n:]],
            self.amplitude[keep],
            self.provenance[keep],
            self.moves[keep[n - len(self.moves) : n]],
            self.turns[keep[turning:]],
            self.shapes[keep[turning - len(self.shapes) : turning]],
        )

    def lengths(self, config: RadarConfig, motion, time: float) -> Float[np.ndarray, "echo virtual 3"]:
        """Path length of each echo and virtual antenna over the burst of the frame that starts at `time`.

        Args:
            config: radar configuration.
            motion: has position(t) and rotation(t) of the sensor.
            time: the frame's stamp, s.

        Returns:
            parabolas in the burst's normalised time (see `synthesis`), m.
        """
        times = time + BurstClock.of(config).nodes
        position, rotation = motion.position(times), motion.rotation(times).as_matrix()
        tx = position[:, None] + tx_positions(config) @ rotation.transpose(0, 2, 1)
        rx = position[:, None] + rx_positions(config) @ rotation.transpose(0, 2, 1)
        out = np.empty((len(self), tx.shape[1] * rx.shape[1], 3))
        _point_lengths(self.points, self.moves, tx, rx, out)
        _image_lengths(self.images, self.turns, tx, rx, out[len(self.points) :])
        turning = len(self) - len(self.turns)
        _arc_lengths(self.shapes, tx, rx, out[turning - len(self.shapes) : turning])
        return out


@njit
def _distance(p, q, move):
    """From p + move to q."""
    x, y, z = p[0] + move[0] - q[0], p[1] + move[1] - q[1], p[2] + move[2] - q[2]
    return np.sqrt(x * x + y * y + z * z)


@njit(parallel=True, cache=True)
def _point_lengths(points, moves, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    still = len(points) - len(moves)
    for e in prange(len(points)):
        a, b = points[e]
        there, back = np.empty((nodes, n_tx)), np.empty((nodes, n_rx))
        for i in range(nodes):
            move_a, move_b = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            if e >= still:
                move_a, move_b = vec(moves[e - still, 0, i]), vec(moves[e - still, 1, i])
            for k in range(n_tx):
                there[i, k] = _distance(a, tx[i, k], move_a)
            for r in range(n_rx):
                back[i, r] = _distance(b, rx[i, r], move_b)
        for k in range(n_tx):
            for r in range(n_rx):
                low, mid, high = there[0, k] + back[0, r], there[1, k] + back[1, r], there[2, k] + back[2, r]
                fit = out[e, k * n_rx + r]
                fit[0], fit[1], fit[2] = parabola(low, mid, high)


@njit(cache=True)
def _image_lengths(images, turns, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    seen, way = np.empty((nodes, 3)), np.empty(nodes)
    still = len(images) - len(turns)
    for e in range(len(images)):
        for r in range(n_rx):
            for i in range(nodes):
                m = images[e] if e < still else turns[e - still, i]
                for d in range(3):
                    seen[i, d] = dot(vec(m[d]), vec(rx[i, r])) + m[d, 3]
            for k in range(n_tx):
                for i in range(nodes):
                    way[i] = length(minus(vec(tx[i, k]), vec(seen[i])))
                fit = out[e, k * n_rx + r]
                fit[0], fit[1], fit[2] = parabola(way[0], way[1], way[2])


@njit(cache=True)
def _arc_lengths(shapes, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    way = np.empty(nodes)
    for e in range(len(shapes)):
        for k in range(n_tx):
            for r in range(n_rx):
                for i in range(nodes):
                    way[i] = path_over(shapes[e], vec(tx[i, k]), vec(rx[i, r])) + shapes[e, SHAPE]
                fit = out[e, k * n_rx + r]
                fit[0], fit[1], fit[2] = parabola(way[0], way[1], way[2])
