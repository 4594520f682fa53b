"""Finds the echoes of a frame: scatterers in sight, legs over mirrors and through slabs, plates, chains of mirrors."""

from dataclasses import fields, replace

import numpy as np
from jaxtyping import Float

from radarize.radar.config import RadarConfig
from radarsim.physics import chains, plates
from radarsim.physics.antenna import Antenna, gain_tables
from radarsim.physics.crowd import Crowd
from radarsim.physics.curved import Curved
from radarsim.physics.echoes import Echoes, Provenance
from radarsim.physics.facets import Facets
from radarsim.physics.legs import Legs, pairs, straight_amplitudes
from radarsim.physics.mirrors import Mirrors
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.slabs import Slabs
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import NODES, BurstClock
from radarsim.physics.view import View
from radarsim.scene.scene import Scene

#: Visibility rays stop this far from both ends, m: surfaces are not obstacles to themselves.
CLEARANCE = 5e-3
#: Slabs are looked for in the way of echoes that are at least this much stronger than the weakest of interest.
LEAST_LOSS = 4.0


class EchoFinder:
    """Finds the echoes of a frame.

    Args:
        scene: ray tests run on its geometry; None where nothing can stand in the way.
        surface: the diffuse surface, or a given set of scatterers.
        facets: mirrors and plates.
        config: radar configuration.
        weakest: echoes below this amplitude are left out.
        reach: largest one-way range of interest, m; default: 5 % beyond the radar's maximum.
        antenna: the elements' pattern; default: the IWR1843BOOST's.
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
        antenna: Antenna | None = None,
        curved: Curved | None = None,
        crowd: Crowd | None = None,
    ):
        self.scene, self.surface, self.facets, self.config = scene, surface, facets, config
        self.weakest, self.curved, self.crowd = weakest, curved, crowd
        self.reach = 1.05 * config.max_range if reach is None else reach
        self.mirrors = None if facets is None else Mirrors.of(facets, scene, self.reach)
        self.slabs = None if scene is None else Slabs(scene, config, CLEARANCE)
        self._tables = gain_tables(antenna)

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
        # of power in echoes with 0, 1, and 2 or more mirrors on the way; slabs, however many, are one more
        self._weights = np.stack([np.ones(len(s)), s.bounces, s.bounces_twice], axis=1)
        self._mirrored = np.flatnonzero(s.bounces)
        near = self._mirrors_in_sight(positions, rotations)
        straight, hidden, nearby = self._straight(positions, rotations)
        legs = Legs.joined([straight, hidden, self._over_mirrors(positions, rotations, straight, near, nearby)])
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

    def _moves(self, legs: Legs, ends, scatterer) -> Float[np.ndarray, "moving 2 3 3"]:
        """How far the virtual points of movers' echoes are from where they are in the middle, at the burst's nodes."""
        owner, carried = self._owner[scatterer], (scatterer - self._still) % max(len(self.crowd or ()), 1)
        offsets = BurstClock.of(self.config).half * NODES
        out = np.empty((len(ends), 2, 3, 3))
        for frame in np.unique(owner):
            rows = np.flatnonzero(owner == frame)
            places = self.crowd.positions(self._times[frame] + np.append(offsets, 0.0))[:, carried[rows]]
            moved = (places[:3] - places[3]).transpose(1, 0, 2)  # echo, node, axis
            for way in (0, 1):
                turn = legs[ends[rows, way]].turn(places[3])
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
        factor[self._shadowed(origins, targets, frame)] = 0
        return factor, delay

    def _shadowed(self, origins, targets, frame) -> np.ndarray:
        """Whether a mover stands in the way."""
        hidden = np.zeros(len(targets), bool)
        if self.crowd is not None and len(self.crowd):
            for k in np.unique(frame):
                now = frame == k
                hidden[now] = self.crowd.occluded(origins[now], targets[now], self._times[k])
        return hidden

    def _unhindered(self, legs: Legs, stops, positions, rotations, allowed) -> Legs:
        """Those legs that get through from stop to stop, weakened and delayed where they pass slabs."""
        kept, delay = np.arange(len(legs)), np.zeros(len(legs))
        amplitude, begin = legs.amplitude.copy(), positions[legs.frame]
        for k in range(1 + legs.bounces.max(initial=0)):
            now = kept[legs.bounces[kept] >= k]
            end = stops[now, k]
            factor, extra = self._passages(begin[now], end, legs.frame[now], rotations, allowed[now])
            amplitude[now] *= factor
            delay[now] += extra
            begin[now] = end
            kept = kept[amplitude[kept] != 0]
        slab = amplitude != legs.amplitude
        legs, delay = replace(legs, amplitude=amplitude, slab=slab)[kept], delay[kept]
        late = np.flatnonzero(legs.slab)  # a delay moves the virtual point away
        offset = legs.virtual[late] - positions[legs.frame[late]]
        legs.virtual[late] += offset * (delay[late] / np.linalg.norm(offset, axis=1))[:, None]
        return legs

    def _straight(self, positions, rotations) -> tuple[Legs, Legs, list[tuple[np.ndarray, np.ndarray]]]:
        """Straight legs worth an echo: those that are free, and those that pass slabs.

        Then, per frame, which scatterers within reach may be seen over mirrors, and their distances.
        """
        s, parts, strong, nearby = self.scatterers, [], [], []
        leg, echo, distance = np.empty((3, len(s)))
        self._shown = np.empty((len(positions), len(s)))  # amplitude factor by level of detail
        for frame, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            straight_amplitudes(
                s.position, s.normal, s.sigma, s.two_sided, s.lobe, s.rank, position, rotation, self.reach,
                self.config.wavelength, *self._tables, leg, echo, distance, self._shown[frame],
            )  # fmt: skip
            meant = (self._owner < 0) | (self._owner == frame)
            index = np.flatnonzero((echo > self.weakest) & meant)
            parts.append(Legs.straight(frame, index, leg[index], s.position[index], position))
            strong.append(echo[index] > LEAST_LOSS * self.weakest)
            within = self._mirrored[(distance[self._mirrored] < self.reach) & meant[self._mirrored]]
            nearby.append((within, distance[within]))
        legs = Legs.joined(parts)
        allowed = np.concatenate(strong) & (self._weights[legs.scatterer, 1] > 0)
        legs = self._unhindered(legs, legs.virtual[:, None], positions, rotations, allowed)
        return legs[~legs.slab], legs[legs.slab], nearby

    def _mirrors_in_sight(self, positions, rotations) -> list[np.ndarray]:
        """Per frame, the mirrors of which something can be seen, and the small plates of corners within reach."""
        if self.mirrors is None:
            return [np.zeros(0, int)] * len(positions)
        found = [self.mirrors.near(p, r[:, 0], self.reach) for p, r in zip(positions, rotations, strict=True)]
        if self.scene is None:
            return found
        index, frame = np.concatenate(found), np.repeat(np.arange(len(found)), [len(f) for f in found])
        small = ~self.mirrors.large[index]
        points = self.mirrors.spread(index[~small], positions[frame[~small]], self.reach)
        origins = np.repeat(positions[frame[~small]], points.shape[1], axis=0)
        clear = ~self.scene.occluded(origins, points.reshape(-1, 3), margin=CLEARANCE)
        small[~small] = clear.reshape(points.shape[:2]).any(axis=1)
        return [index[(frame == k) & small] for k in range(len(positions))]

    def _over_mirrors(self, positions, rotations, straight: Legs, near, nearby) -> Legs:
        """Legs over one mirror and over two."""
        s, parts = self.scatterers, [(straight[:0], np.zeros((0, 3, 3)))]
        edges = np.searchsorted(straight.frame, np.arange(len(positions) + 1))
        scale = self.config.wavelength / (4 * np.pi) ** 1.5
        for frame, (position, rotation) in enumerate(zip(positions, rotations, strict=True)):
            mirrors = near[frame][self.mirrors.large[near[frame]]] if self.mirrors is not None else []
            if not len(mirrors):
                continue
            index, distance = nearby[frame]
            seen = slice(edges[frame], edges[frame + 1])
            other = np.zeros(len(s))
            other[straight.scatterer[seen]] = straight.amplitude[seen].real
            # Hidden scatterers are seen over mirrors out and back, which is of second order: fewer of them do.
            keep = (other[index] > 0) | (self._weights[index, 2] > 0)
            index, distance = index[keep], distance[keep]
            free = other[index] > 0
            best = 3.4 / distance  # the other leg of an echo is weaker: 3.4 is above the peak gain
            shown = self._shown[frame, index] * np.sqrt(s.sigma[index] * s.lobe[index, :3].sum(axis=1))
            weakest = self.weakest / np.maximum(scale * shown * best, 1e-300)
            longest = np.where(free, 2 * self.reach - distance, self.reach)
            # How a virtual point moves is known of one mirror (`Legs.turn`): movers have no legs over two.
            double = free & (self._weights[index, 2] > 0) & (index < self._still)
            pose = position, rotation, self.config.wavelength, self._tables
            single = np.stack([mirrors, np.full(len(mirrors), -1)], axis=1)
            bounds = longest[double], weakest[double]
            parts += [
                Legs.over_mirrors(frame, self.mirrors, single, s, index, longest, weakest, *pose),
                Legs.over_mirrors(
                    frame, self.mirrors, self.mirrors.pairs(mirrors, position), s, index[double], *bounds, *pose
                ),
            ]
        legs, stops = Legs.joined([legs for legs, _ in parts]), np.concatenate([stops for _, stops in parts])
        strength = self._strongest_echoes(straight, legs)
        worth = strength > self.weakest
        legs, stops, strength = legs[worth], stops[worth], strength[worth]
        allowed = (self._weights[legs.scatterer, 2] > 0) & (legs.bounces == 1)
        allowed &= strength > LEAST_LOSS * self.weakest
        return self._unhindered(legs, stops, positions, rotations, allowed)

    def _strongest_echoes(self, straight: Legs, legs: Legs) -> np.ndarray:
        """Amplitude that no echo which each leg over mirrors can be part of exceeds."""
        s = self.scatterers
        both = Legs.joined([straight, legs])
        size = np.abs(both.amplitude)
        key = both.frame * len(s) + both.scatterer
        order = np.argsort(key, kind="stable")
        first = np.flatnonzero(np.diff(key[order], prepend=-1))
        best = np.empty(len(both))
        best[order] = np.repeat(np.maximum.reduceat(size[order], first), np.diff(np.append(first, len(key))))
        scale = self.config.wavelength / (4 * np.pi) ** 1.5
        n = len(straight)
        surface = self._shown[legs.frame, legs.scatterer] ** 2 * (s.sigma * s.lobe[:, :3].sum(axis=1))[legs.scatterer]
        return scale * np.sqrt(surface) * size[n:] * best[n:]

    def _images(self, positions, rotations, near) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Per frame isometries, amplitudes and causes of plates and of chains of mirrors."""
        if self.mirrors is None:
            return [(np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, int))] * len(positions)
        plate = self._plates(positions, rotations)
        chain = self._chains(positions, rotations, near)
        frame, *columns = (np.concatenate(pair) for pair in zip(plate, chain, strict=True))
        return [tuple(column[frame == k] for column in columns) for k in range(len(positions))]

    def _views(self, positions, rotations) -> list[View]:
        limits = self.reach, self.config.wavelength, self.weakest, self._tables
        return [View(p, r, *limits) for p, r in zip(positions, rotations, strict=True)]

    def _plates(self, positions, rotations) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Flashes: frame, isometry, amplitude, cause."""
        facets, found = self.facets.near(positions, self.reach), []
        for view in self._views(positions, rotations):
            facet, *flat = plates.parts(facets, view)
            cause = np.where(facets.horizontal[facet], Provenance.FLOOR_CEILING, Provenance.DIRECT)
            found.append((*flat, cause))
            if self.curved is not None:
                round_ = self.curved.parts(view)
                bent = (*round_, np.full(len(round_[0]), Provenance.DIRECT))
                found[-1] = tuple(np.concatenate(pair) for pair in zip(found[-1], bent, strict=True))
        frame = np.repeat(np.arange(len(found)), [len(f[0]) for f in found])
        aim, isometry, amplitude, cause = (np.concatenate(column) for column in zip(*found, strict=True))
        begin = positions[frame]
        worth = np.abs(amplitude) > LEAST_LOSS * self.weakest
        factor, delay = self._passages(begin, aim, frame, rotations, worth)
        cause[factor != 1] = Provenance.THROUGH_SLAB
        amplitude = amplitude * factor**2  # there and back
        # A delay moves the receiver's image away.
        away = np.einsum("pij,pj->pi", isometry[:, :, :3], begin) + isometry[:, :, 3] - begin
        isometry[:, :, 3] += (2 * delay / np.linalg.norm(away, axis=1))[:, None] * away
        keep = np.abs(amplitude) > self.weakest
        return frame[keep], isometry[keep], amplitude[keep], cause[keep]

    def _chains(self, positions, rotations, near) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Chains of mirrors, either way round: frame, isometry, amplitude, cause."""
        views = self._views(positions, rotations)
        found = [chains.images(self.mirrors, n, view) for n, view in zip(near, views, strict=True)]
        frame = np.repeat(np.arange(len(found)), [len(f[0]) for f in found])
        chain, isometry, amplitude, stops = (np.concatenate(column) for column in zip(*found, strict=True))
        place = [positions[frame], *stops.transpose(1, 0, 2), positions[frame]]
        begins, ends = np.concatenate(place[:-1]), np.concatenate(place[1:])
        blocked = self._shadowed(begins, ends, np.tile(frame, 4))
        if self.scene is not None and len(frame):
            blocked |= self.scene.occluded(begins, ends, margin=CLEARANCE)
        free = np.flatnonzero(~blocked.reshape(4, -1).any(axis=0))
        both = free[chain[free, 0] != chain[free, 2]]
        two = chain[:, 1] == chain[:, 2]
        a, b, c = self.mirrors.normal[chain].transpose(1, 0, 2)
        slant = np.abs(np.einsum("cd,cd->c", a, b)) + np.abs(np.einsum("cd,cd->c", a, c))
        slant += np.where(two, 0, np.abs(np.einsum("cd,cd->c", b, c)))
        cause = np.where(two, Provenance.GHOST_2, Provenance.GHOST_3)
        cause[slant < 1e-3] = Provenance.DIRECT
        isometry = np.concatenate([isometry[free], chains.reverse(isometry[both])])
        free = np.concatenate([free, both])
        return frame[free], isometry, amplitude[free], cause[free]

    def _echoes(self, positions, legs: Legs, images) -> list[Echoes]:
        """Joins legs to echoes and adds the images."""
        s = self.scatterers
        legs = legs[np.lexsort((legs.scatterer, legs.frame))]
        lengths = np.linalg.norm(legs.virtual - positions[legs.frame], axis=1)
        limits = self.reach, self.config.wavelength, self.weakest
        ends, amplitude = pairs(legs, lengths, self._shown[legs.frame, legs.scatterer], s, self._weights, *limits)
        scatterer = legs.scatterer[ends[:, 0]]
        amplitude = amplitude * np.exp(1j * s.phase[scatterer])
        order = legs.bounces[ends].sum(axis=1)
        cause = np.where(s.horizontal[scatterer], Provenance.FLOOR_CEILING, Provenance.DIRECT)
        cause = np.where(order > 0, Provenance.GHOST_1 - 1 + order, cause)
        cause = np.where(legs.slab[ends].any(axis=1), Provenance.THROUGH_SLAB, cause)
        moving = scatterer >= self._still
        cause = np.where(moving, Provenance.MOVING, cause)
        points, moves = legs.virtual[ends], self._moves(legs, ends[moving], scatterer[moving])
        first = np.concatenate([[0], np.cumsum(moving)])
        edges = np.searchsorted(legs.frame[ends[:, 0]], np.arange(len(positions) + 1))
        return [
            Echoes(
                points[i:j], isometry, np.concatenate([amplitude[i:j], flashes]),
                np.concatenate([cause[i:j], why]).astype(np.uint8), moves[first[i] : first[j]],
            )
            for i, j, (isometry, flashes, why) in zip(edges, edges[1:], images, strict=False)
        ]  # fmt: skip
