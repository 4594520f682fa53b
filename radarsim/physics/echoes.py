"""Echoes of one frame: which paths there are, how strong, and why.

An echo is either a pair of world points (a, b), the scatterer as seen through the mirrors of its outgoing and of its
returning leg, with the path length |tx - a| + |b - rx|; or an image, an isometry M of the receiver, with the path
length |tx - M rx|. Points carry the diffuse surface (a = b) and its ghosts (a = s, b = s mirrored, and the
reciprocal). Images carry plates: the reflection in the plane, a half turn about each edge, an inversion in each corner,
which together are the physical-optics integral over a rectangle. Both stay exact for every antenna and instant while
amplitudes and visibility are taken once per frame, at the middle of the burst.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Complex, Float, UInt8
from numba import njit, prange

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarsim.physics import plates
from radarsim.physics.amplitudes import direct_amplitudes, ghost_amplitudes
from radarsim.physics.antenna import Antenna, gain_tables
from radarsim.physics.facets import Facets
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.synthesis import BurstClock, parabolas
from radarsim.scene.scene import Scene

#: Visibility rays stop this far from both ends, m: surfaces are not obstacles to themselves.
CLEARANCE = 5e-3


class Provenance(IntEnum):
    """Why there is an echo."""

    DIRECT = 0
    FLOOR_CEILING = 1
    GHOST = 2


@dataclass(frozen=True)
class Echoes:
    """The echoes of a frame, points first, then images.

    Attributes:
        points: a and b of point echoes, world, m.
        images: 3 x 4 isometries (matrix | offset) of the receiver, world.
        amplitude: square root of received over transmitted power, with phase, as in the beat signal.
        provenance: a `Provenance` each.
    """

    points: Float[np.ndarray, "point 2 3"]
    images: Float[np.ndarray, "image 3 4"]
    amplitude: Complex[np.ndarray, "echo"]
    provenance: UInt8[np.ndarray, "echo"]

    def __len__(self) -> int:
        return len(self.amplitude)

    def of(self, provenance: Provenance) -> "Echoes":
        """The echoes of one cause."""
        keep = self.provenance == provenance
        n = len(self.points)
        return Echoes(self.points[keep[:n]], self.images[keep[n:]], self.amplitude[keep], self.provenance[keep])

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
        values = np.empty((len(self), tx.shape[1] * rx.shape[1], 3))
        _point_lengths(self.points, tx, rx, values)
        _image_lengths(self.images, tx, rx, values[len(self.points) :])
        return parabolas(values)


@njit(parallel=True, cache=True)
def _point_lengths(points, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    for e in prange(len(points)):
        back = np.empty(n_rx)
        for i in range(nodes):
            for r in range(n_rx):
                d = points[e, 1] - rx[i, r]
                back[r] = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            for k in range(n_tx):
                d = points[e, 0] - tx[i, k]
                there = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                for r in range(n_rx):
                    out[e, k * n_rx + r, i] = there + back[r]


@njit(cache=True)
def _image_lengths(images, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    for e in range(len(images)):
        m = images[e]
        for i in range(nodes):
            for r in range(n_rx):
                q = rx[i, r]
                x = m[0, 0] * q[0] + m[0, 1] * q[1] + m[0, 2] * q[2] + m[0, 3]
                y = m[1, 0] * q[0] + m[1, 1] * q[1] + m[1, 2] * q[2] + m[1, 3]
                z = m[2, 0] * q[0] + m[2, 1] * q[1] + m[2, 2] * q[2] + m[2, 3]
                for k in range(n_tx):
                    p = tx[i, k]
                    out[e, k * n_rx + r, i] = np.sqrt((p[0] - x) ** 2 + (p[1] - y) ** 2 + (p[2] - z) ** 2)


class EchoFinder:
    """Finds the echoes of a frame.

    Args:
        scene: ray tests run on its geometry; None where nothing can stand in the way.
        scatterers: the diffuse surface.
        facets: mirrors and plates.
        config: radar configuration.
        weakest: echoes below this amplitude are left out.
        reach: largest one-way range of interest, m; default: 5 % beyond the radar's maximum.
        antenna: the elements' pattern; default: the IWR1843BOOST's.
    """

    def __init__(
        self,
        scene: Scene | None,
        scatterers: Scatterers,
        facets: Facets | None,
        config: RadarConfig,
        weakest: float = 0.0,
        reach: float | None = None,
        antenna: Antenna | None = None,
    ):
        self.scene, self.scatterers, self.facets, self.config = scene, scatterers, facets, config
        self.weakest = weakest
        self.reach = 1.05 * config.max_range if reach is None else reach
        self._tables = gain_tables(antenna)
        self._phasor = np.exp(1j * scatterers.phase)

    def __call__(self, position: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"]) -> Echoes:
        """Echoes for one sensor pose (rotation: sensor to world)."""
        return self.batch(np.asarray(position)[None], np.asarray(rotation)[None])[0]

    def batch(
        self, positions: Float[np.ndarray, "frame 3"], rotations: Float[np.ndarray, "frame 3 3"]
    ) -> list[Echoes]:
        """Echoes of several frames: one after the other, but for the ray tests, which are quicker in large numbers."""
        poses = list(zip(np.asarray(positions, float), np.asarray(rotations, float), strict=True))
        points = self._points(poses)
        images = self._images(poses)
        echoes = []
        for (index, amplitude), ghosts, (transforms, flashes, horizontal) in zip(
            points, self._ghosts(poses, points), images, strict=True
        ):
            s = self.scatterers
            place = s.position[index]
            mirrored, bounced, ghost_amplitude = ghosts
            echoes.append(
                Echoes(
                    np.concatenate([
                        np.stack([place, place], axis=1),
                        np.stack([bounced, mirrored], axis=1),
                        np.stack([mirrored, bounced], axis=1),
                    ]),
                    transforms,
                    np.concatenate([amplitude * self._phasor[index], ghost_amplitude, ghost_amplitude, flashes]),
                    np.concatenate([
                        np.where(s.horizontal[index], Provenance.FLOOR_CEILING, Provenance.DIRECT),
                        np.full(2 * len(mirrored), Provenance.GHOST),
                        np.where(horizontal, Provenance.FLOOR_CEILING, Provenance.DIRECT),
                    ]).astype(np.uint8),
                )
            )  # fmt: skip
        return echoes

    def _seen(self, segments: list[tuple[np.ndarray, np.ndarray]]) -> list[np.ndarray]:
        """Per frame, which segments (origins, targets) nothing stands in."""
        counts = np.cumsum([len(targets) for _, targets in segments])
        if self.scene is None or not counts[-1]:
            return [np.ones(len(targets), bool) for _, targets in segments]
        origins = np.concatenate([np.broadcast_to(o, t.shape) for o, t in segments])
        targets = np.concatenate([t for _, t in segments])
        return np.split(~self.scene.occluded(origins, targets, margin=CLEARANCE), counts[:-1])

    def _points(self, poses) -> list[tuple[np.ndarray, np.ndarray]]:
        """Visible scatterers and their amplitudes."""
        s = self.scatterers
        candidates = []
        for position, rotation in poses:
            amplitude = np.zeros(len(s))
            direct_amplitudes(
                s.position, s.normal, s.sigma, s.two_sided, position, rotation, self.reach, self.config.wavelength,
                *self._tables, amplitude,
            )  # fmt: skip
            index = np.flatnonzero(amplitude > self.weakest)
            candidates.append((index, amplitude[index]))
        seen = self._seen([(p, s.position[i]) for (p, _), (i, _) in zip(poses, candidates, strict=True)])
        return [(i[v], a[v]) for (i, a), v in zip(candidates, seen, strict=True)]

    def _ghosts(self, poses, points) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Mirrored scatterers, the scatterers themselves and the amplitude of either way round."""
        s, f = self.scatterers, self.facets
        if f is None or not len(f):
            return [(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0, complex))] * len(poses)
        found = []
        for (position, rotation), (index, _) in zip(poses, points, strict=True):
            candidates = index[s.bounces[index] > 0]
            height = np.einsum("md,md->m", position - f.center, f.normal)
            away = np.linalg.norm(position - f.center, axis=1) - np.linalg.norm(f.half, axis=1)
            mirrors = np.flatnonzero(f.mirror & (away < self.reach) & (f.two_sided | (height > 0)))
            amplitude = np.zeros((len(mirrors), len(candidates)), complex)
            ghost_amplitudes(
                s.position[candidates], s.normal[candidates], s.sigma[candidates], s.two_sided[candidates],
                f.center[mirrors], f.normal[mirrors], f.u[mirrors], f.v[mirrors], f.half[mirrors],
                f.two_sided[mirrors], f.reflection[mirrors], position, rotation, self.reach, self.config.wavelength,
                self.weakest, *self._tables, amplitude,
            )  # fmt: skip
            m, c = np.nonzero(amplitude)
            ghost, mirror = candidates[c], mirrors[m]
            place, normal = s.position[ghost], f.normal[mirror]
            h = height[mirror, None]
            hs = np.einsum("ed,ed->e", place - f.center[mirror], normal)[:, None]
            image_of_sensor = position - 2 * h * normal
            bounce = image_of_sensor + (place - image_of_sensor) * h / (h + hs)
            strength = amplitude[m, c] * np.sqrt(s.bounces[ghost]) * self._phasor[ghost]
            found.append((bounce, place, place - 2 * hs * normal, strength))
        first = self._seen([(p, bounce) for (p, _), (bounce, *_) in zip(poses, found, strict=True)])
        found = [tuple(column[v] for column in row) for row, v in zip(found, first, strict=True)]
        second = self._seen([(bounce, place) for bounce, place, *_ in found])
        return [(image[v], place[v], a[v]) for (_, place, image, a), v in zip(found, second, strict=True)]

    def _images(self, poses) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Visible parts of plates: isometry, amplitude, whether of a floor or ceiling."""
        if self.facets is None:
            return [(np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, bool))] * len(poses)
        found = [
            plates.parts(self.facets, p, r, self.reach, self.config.wavelength, self.weakest, self._tables)
            for p, r in poses
        ]
        seen = self._seen([(p, row[1]) for (p, _), row in zip(poses, found, strict=True)])
        return [
            (images[v], amplitude[v], self.facets.horizontal[facet[v]])
            for (facet, _, images, amplitude), v in zip(found, seen, strict=True)
        ]
