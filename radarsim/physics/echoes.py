"""Echoes of one frame: which paths there are, how strong, and why.

An echo is either a pair of legs to a scatterer (`legs`), straight, over mirrors, through slabs: two world points
(a, b), the scatterer as seen through the mirrors of its outgoing and of its returning leg, with the path length
|tx - a| + |b - rx|. Or it is an image, an isometry M of the receiver, with the path length |tx - M rx|: plates (the
reflection in the plane, a half turn about each edge, an inversion in each corner, which together are the
physical-optics integral over a rectangle) and chains of two and three mirrors (`chains`). Both stay exact for every
antenna and instant while amplitudes and visibility are taken once per frame, at the middle of the burst.
"""

from dataclasses import dataclass, field, fields, replace
from enum import IntEnum

import numpy as np
from jaxtyping import Complex, Float, UInt8
from numba import njit, prange

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarsim.physics import chains, plates
from radarsim.physics.antenna import gain_tables
from radarsim.physics.crowd import Crowd
from radarsim.physics.curved import Curved
from radarsim.physics.detail import details
from radarsim.physics.facets import Facets
from radarsim.physics.legs import Legs, pairs, straight_amplitudes
from radarsim.physics.mirrors import Mirrors
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.slabs import Slabs
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import NODES, BurstClock, parabolas
from radarsim.scene.scene import Scene

#: Visibility rays stop this far from both ends, m: surfaces are not obstacles to themselves.
CLEARANCE = 5e-3


class Provenance(IntEnum):
    """Why there is an echo."""

    DIRECT = 0
    FLOOR_CEILING = 1
    GHOST_1 = 2  #: over one mirror on the way out or back
    GHOST_2 = 3  #: over two mirrors, or by two mirrors alone
    GHOST_3 = 4  #: by three mirrors alone
    THROUGH_SLAB = 5  #: through a wall, pane or door, whatever else
    MOVING = 6


@dataclass(frozen=True)
class Echoes:
    """The echoes of a frame, points first, those of movers last among them, then images.

    Attributes:
        points: a and b of point echoes, world, m, at the middle of the burst.
        moves: of the last points, how far a and b have moved at the burst's three nodes (`synthesis.NODES`), m.
        images: 3 x 4 isometries (matrix | offset) of the receiver, world.
        amplitude: square root of received over transmitted power, with phase, as in the beat signal.
        provenance: a `Provenance` each.
    """

    points: Float[np.ndarray, "point 2 3"]
    images: Float[np.ndarray, "image 3 4"]
    amplitude: Complex[np.ndarray, "echo"]
    provenance: UInt8[np.ndarray, "echo"]
    moves: Float[np.ndarray, "moving 2 3 3"] = field(default_factory=lambda: np.zeros((0, 2, 3, 3)))

    def __len__(self) -> int:
        return len(self.amplitude)

    def of(self, provenance: Provenance) -> "Echoes":
        """The echoes of one cause."""
        keep = self.provenance == provenance
        n = len(self.points)
        return Echoes(
            self.points[keep[:n]],
            self.images[keep[n:]],
            self.amplitude[keep],
            self.provenance[keep],
            self.moves[keep[n - len(self.moves) : n]],
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
        values = np.empty((len(self), tx.shape[1] * rx.shape[1], 3))
        _point_lengths(self.points, self.moves, tx, rx, values)
        _image_lengths(self.images, tx, rx, values[len(self.points) :])
        return parabolas(values)


@njit(parallel=True, cache=True)
def _point_lengths(points, moves, tx, rx, out):
    nodes, n_tx, _ = tx.shape
    n_rx = rx.shape[1]
    still = len(points) - len(moves)
    for e in prange(len(points)):
        back = np.empty(n_rx)
        a, b = points[e, 0].copy(), points[e, 1].copy()
        for i in range(nodes):
            if e >= still:
                a, b = points[e, 0] + moves[e - still, 0, i], points[e, 1] + moves[e - still, 1, i]
            for r in range(n_rx):
                d = b - rx[i, r]
                back[r] = np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
            for k in range(n_tx):
                d = a - tx[i, k]
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
        surface: the diffuse surface, or a given set of scatterers.
        facets: mirrors and plates.
        config: radar configuration.
        weakest: echoes below this amplitude are left out.
        reach: largest one-way range of interest, m; default: 5 % beyond the radar's maximum.
        curved: round bodies.
        crowd: what moves by itself.
    """

    def __init__(
        self,
        scene: Scene | None,
        surface: Surface | Scatterers,
        facets: Facets | None,
        config: RadarConfig,
        weakest: float = 0.0,
        reach: float | None = None,
        curved: Curved | None = None,
        crowd: Crowd | None = None,
    ):
        self.scene, self.surface, self.facets, self.config = scene, surface, facets, config
        self.weakest, self.curved, self.crowd = weakest, curved, crowd
        self.reach = 1.05 * config.max_range if reach is None else reach
        self.mirrors = None if facets is None or not len(facets) else Mirrors.of(facets, scene, self.reach)
        self.slabs = None if scene is None else Slabs(scene, config, CLEARANCE)
        self._tables = gain_tables()

    def __call__(
        self, position: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"], time: float = 0.0
    ) -> Echoes:
        """Echoes for one sensor pose (rotation: sensor to world) in the middle of a burst at `time`, s."""
        return self.batch(np.asarray(position)[None], np.asarray(rotation)[None], np.array([time]))[0]

    def batch(
        self,
        positions: Float[np.ndarray, "frame 3"],
        rotations: Float[np.ndarray, "frame 3 3"],
        times: Float[np.ndarray, "frame"],
    ) -> list[Echoes]:
        """Echoes of several frames: one after the other, but for the ray tests, which are quicker in large numbers.

        Args:
            positions, rotations, times: of the sensor in the middle of each burst; m, sensor to world, s.
        """
        positions, rotations = np.asarray(positions, float), np.asarray(rotations, float)
        s = self.scatterers = self._with_movers(self.surface.near(positions, self.reach), times)
        # of power in echoes with 0, 1, and 2 or more mirrors and slabs on the way
        self._weights = np.stack([np.ones(len(s)), s.bounces, s.bounces_twice], axis=1)
        near = self._mirrors_in_sight(positions)
        straight, hidden = self._straight(positions, rotations)
        legs = Legs.joined([straight, hidden, self._over_mirrors(positions, rotations, straight, near)])
        return self._echoes(positions, legs, self._images(positions, rotations, near))

    def _with_movers(self, surface: Scatterers, times) -> Scatterers:
        """The surface's scatterers and, once per frame, those of the movers where they are then."""
        self._times, self._still = times, len(surface)
        self._owner = np.full(len(surface), -1)  # the frame that a scatterer is for; -1: all
        if self.crowd is None or not len(self.crowd):
            return surface
        self._owner = np.concatenate([self._owner, np.repeat(np.arange(len(times)), len(self.crowd))])
        parts = [surface, *(self.crowd.scatterers(t) for t in times)]
        return Scatterers(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Scatterers)))

    def _meant_for(self, frame: int) -> np.ndarray:
        return (self._owner < 0) | (self._owner == frame)

    def _moves(self, legs: Legs, ends, scatterer, positions) -> Float[np.ndarray, "moving 2 3 3"]:
        """How far the virtual points of movers' echoes are from where they are in the middle, at the burst's nodes."""
        owner, carried = self._owner[scatterer], (scatterer - self._still) % max(len(self.crowd or ()), 1)
        offsets = BurstClock.of(self.config).half * NODES
        out = np.empty((len(ends), 2, 3, 3))
        for frame in np.unique(owner):
            rows = np.flatnonzero(owner == frame)
            places = self.crowd.positions(self._times[frame] + np.append(offsets, 0.0))[:, carried[rows]]
            moved = (places[:3] - places[3]).transpose(1, 0, 2)  # echo, node, axis
            for way in (0, 1):
                turn = legs[ends[rows, way]].turn(positions)
                out[rows, way] = np.einsum("eij,enj->eni", turn, moved)
        return out

    def _passages(self, origins, targets, frame, rotations, allowed) -> tuple[np.ndarray, np.ndarray]:
        """What is left of waves between points, and their delay (m); slabs are looked for where `allowed`."""
        factor, delay = np.ones(len(targets), complex), np.zeros(len(targets))
        if self.scene is not None and len(targets):
            blocked = self.scene.occluded(origins, targets, margin=CLEARANCE)
            factor[blocked] = 0
            through = np.flatnonzero(blocked & allowed)
            if len(through):
                up = rotations[frame[through], :, 2]
                factor[through], delay[through] = self.slabs.passage(origins[through], targets[through], up)
        if self.crowd is not None and len(self.crowd):
            for k in np.unique(frame):
                open_ = np.flatnonzero((frame == k) & (factor != 0))
                factor[open_[self.crowd.occluded(origins[open_], targets[open_], self._times[k])]] = 0
        return factor, delay

    def _unhindered(self, legs: Legs, positions, rotations, allowed) -> Legs:
        """Those legs that get through, weakened and delayed where they pass slabs."""
        kept, delay = np.arange(len(legs)), np.zeros(len(legs))
        amplitude, begin = legs.amplitude.copy(), positions[legs.frame]
        for k in range(1 + legs.bounces.max(initial=0)):
            now = kept[legs.bounces[kept] >= k]
            end = legs.stops[now, k]
            factor, extra = self._passages(begin[now], end, legs.frame[now], rotations, allowed[now])
            amplitude[now] *= factor
            delay[now] += extra
            begin[now] = end
            kept = kept[amplitude[kept] != 0]
        # A delay moves the virtual point away.
        offset = legs.virtual - positions[legs.frame]
        virtual = legs.virtual + offset * (delay / np.linalg.norm(offset, axis=1))[:, None]
        return replace(legs, amplitude=amplitude, virtual=virtual, slab=amplitude != legs.amplitude)[kept]

    def _straight(self, positions, rotations) -> tuple[Legs, Legs]:
        """Straight legs worth an echo: those that are free, and of one scatterer in many those that pass slabs."""
        s, parts = self.scatterers, []
        leg, echo = np.empty(len(s)), np.empty(len(s))
        for frame, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            straight_amplitudes(
                s.position, s.normal, s.sigma, s.two_sided, s.lobe, s.rank, position, rotation, self.reach,
                self.config.wavelength, *self._tables, leg, echo,
            )  # fmt: skip
            index = np.flatnonzero((echo > self.weakest) & self._meant_for(frame))
            parts.append(Legs.straight(frame, index, leg[index], s.position[index], position))
        legs = Legs.joined(parts)
        legs = self._unhindered(legs, positions, rotations, self._weights[legs.scatterer, 2] > 0)
        return legs[~legs.slab], legs[legs.slab]

    def _mirrors_in_sight(self, positions) -> list[np.ndarray]:
        """Per frame, the mirrors of which something can be seen, and the small plates of corners within reach."""
        if self.mirrors is None:
            return [np.zeros(0, int)] * len(positions)
        found = [self.mirrors.near(p, self.reach) for p in positions]
        if self.scene is None:
            return found
        index, frame = np.concatenate(found), np.repeat(np.arange(len(found)), [len(f) for f in found])
        small = ~self.mirrors.large[index]
        points = self.mirrors.spread(index[~small], positions[frame[~small]], self.reach)
        origins = np.repeat(positions[frame[~small]], points.shape[1], axis=0)
        clear = ~self.scene.occluded(origins, points.reshape(-1, 3), margin=CLEARANCE)
        small[~small] = clear.reshape(points.shape[:2]).any(axis=1)
        return [index[(frame == k) & small] for k in range(len(positions))]

    def _over_mirrors(self, positions, rotations, straight: Legs, near: list[np.ndarray]) -> Legs:
        """Legs over one mirror and over two."""
        s, parts = self.scatterers, [straight[:0]]
        thinned = np.flatnonzero(self._weights[:, 1])
        scale = self.config.wavelength / (4 * np.pi) ** 1.5
        for frame, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            mirrors = near[frame][self.mirrors.large[near[frame]]] if self.mirrors is not None else []
            if not len(mirrors):
                continue
            seen = straight[straight.frame == frame]
            other = np.zeros(len(s))  # the strongest leg that one over a mirror can be joined with
            other[seen.scatterer] = np.abs(seen.amplitude)
            distance = np.linalg.norm(s.position[thinned] - position, axis=1)
            near_by = (distance < self.reach) & self._meant_for(frame)[thinned]
            index, distance = thinned[near_by], distance[near_by]
            # Hidden scatterers are seen over mirrors out and back, which is of second order: fewer of them do.
            keep = (other[index] > 0) | (self._weights[index, 2] > 0)
            index, distance = index[keep], distance[keep]
            free = other[index] > 0
            best = np.maximum(other[index], 3.35 / distance)  # 3.35: the peak gain
            # Behind a weak leg there may be a stronger one over a mirror, so the bound is the larger of the two.
            shown = details(s.rank[index], distance) * np.sqrt(s.sigma[index] * s.lobe[index, :3].sum(axis=1))
            weakest = self.weakest / np.maximum(scale * shown * best, 1e-300)
            longest = np.where(free, 2 * self.reach - distance, self.reach)
            double = free & (self._weights[index, 2] > 0)
            pairs = np.concatenate([
                np.stack([np.full(n, m), self.mirrors.following[i : i + n]], axis=1)
                for m, i, n in zip(mirrors, self.mirrors.first[mirrors],
                                   self.mirrors.first[mirrors + 1] - self.mirrors.first[mirrors], strict=True)
            ])  # fmt: skip
            pairs = pairs[self.mirrors.large[pairs[:, 1]]]
            pose = position, rotation, self.config.wavelength, self._tables
            single = np.stack([mirrors, np.full(len(mirrors), -1)], axis=1)
            parts += [
                Legs.over_mirrors(
                    frame, self.mirrors, single, index, s.position[index], longest, weakest, *pose
                ),
                Legs.over_mirrors(
                    frame, self.mirrors, pairs, index[double], s.position[index[double]], longest[double],
                    weakest[double], *pose,
                ),
            ]  # fmt: skip
        legs = Legs.joined(parts)
        allowed = (self._weights[legs.scatterer, 2] > 0) & (legs.bounces == 1)
        return self._unhindered(legs, positions, rotations, allowed)

    def _images(self, positions, rotations, near) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Per frame isometries, amplitudes and provenance of plates and of chains of mirrors."""
        if self.mirrors is None:
            return [(np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, int))] * len(positions)
        frames, isometries, amplitudes, stops, causes = [], [], [], [], []
        facets = self.facets.near(positions, self.reach)
        limits = self.reach, self.config.wavelength, self.weakest, self._tables
        for frame, (p, r) in enumerate(zip(positions, rotations, strict=True)):
            facet, aim, isometry, amplitude = plates.parts(facets, p, r, *limits)
            cause = np.where(facets.horizontal[facet], Provenance.FLOOR_CEILING, Provenance.DIRECT)
            chain, images, strength, course = chains.images(self.mirrors, near[frame], p, r, *limits)
            if self.curved is not None:
                flat = aim, isometry, amplitude, cause
                bent = *self.curved.parts(p, r, *limits), []
                aim, isometry, amplitude, cause = map(np.concatenate, zip(flat, bent, strict=True))
                cause = np.pad(cause, (0, len(amplitude) - len(cause)), constant_values=Provenance.DIRECT).astype(int)
            isometries += [isometry, images]
            amplitudes += [amplitude, strength]
            stops += [np.repeat(aim[:, None], 3, axis=1), course]
            causes += [cause, np.where(chain[:, 2] < 0, Provenance.GHOST_2, Provenance.GHOST_3)]
            frames += [np.full(len(amplitude) + len(strength), frame)]
        frame, isometry, amplitude, stops, cause = map(np.concatenate, (frames, isometries, amplitudes, stops, causes))
        begin = positions[frame]
        single = cause <= Provenance.FLOOR_CEILING
        reached, delay = self._passages(
            begin, stops[:, 0], frame, rotations, single & (np.abs(amplitude) > 10 * self.weakest)
        )
        slab = single & (reached != 1) & (reached != 0)
        amplitude[single] *= reached[single] ** 2  # there and back
        amplitude[~single] *= reached[~single]
        cause[slab] = Provenance.THROUGH_SLAB
        for a, b in ((stops[:, 0], stops[:, 1]), (stops[:, 1], stops[:, 2]), (stops[:, 2], begin)):
            rest = np.flatnonzero(~single & (amplitude != 0))
            amplitude[rest] *= self._passages(a[rest], b[rest], frame[rest], rotations, np.zeros(len(rest), bool))[0]
        # A delay moves the receiver's image away.
        away = np.einsum("pij,pj->pi", isometry[:, :, :3], begin) + isometry[:, :, 3] - begin
        isometry[slab, :, 3] += (2 * delay[:, None] * away / np.linalg.norm(away, axis=1, keepdims=True))[slab]
        keep = np.abs(amplitude) > self.weakest
        return [(isometry[k], amplitude[k], cause[k]) for k in (keep & (frame == n) for n in range(len(positions)))]

    def _echoes(self, positions, legs: Legs, images) -> list[Echoes]:
        """Joins legs to echoes and adds the images."""
        s = self.scatterers
        legs = legs[np.lexsort((legs.scatterer, legs.frame))]
        lengths = np.linalg.norm(legs.virtual - positions[legs.frame], axis=1)
        away = np.linalg.norm(legs.stops[:, 2] - positions[legs.frame], axis=1)
        limits = self.reach, self.config.wavelength, self.weakest
        ends, amplitude = pairs(legs, lengths, away, s, self._weights, *limits)
        scatterer = legs.scatterer[ends[:, 0]]
        amplitude = amplitude * np.exp(1j * s.phase[scatterer])
        order = legs.bounces[ends].sum(axis=1)
        cause = np.where(s.horizontal[scatterer], Provenance.FLOOR_CEILING, Provenance.DIRECT)
        cause = np.where(order > 0, Provenance.GHOST_1 - 1 + order, cause)
        cause = np.where(legs.slab[ends].any(axis=1), Provenance.THROUGH_SLAB, cause)
        moving = scatterer >= self._still
        cause = np.where(moving, Provenance.MOVING, cause)
        points, moves = legs.virtual[ends], self._moves(legs, ends[moving], scatterer[moving], positions)
        first = np.concatenate([[0], np.cumsum(moving)])
        edges = np.searchsorted(legs.frame[ends[:, 0]], np.arange(len(positions) + 1))
        return [
            Echoes(
                points[i:j], isometry, np.concatenate([amplitude[i:j], flashes]),
                np.concatenate([cause[i:j], why]).astype(np.uint8), moves[first[i] : first[j]],
            )
            for i, j, (isometry, flashes, why) in zip(edges, edges[1:], images, strict=False)
        ]  # fmt: skip
