"""Finds the echoes of a frame: scatterers in sight, legs over mirrors and through slabs, plates, chains of mirrors.

Start reading at `EchoFinder.batch`.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from radarize.radar.config import RadarConfig
from radarsim.physics.antenna import Antenna, gain_tables
from radarsim.physics.batch import Batch
from radarsim.physics.bounces import Ways
from radarsim.physics.candidates import Candidates
from radarsim.physics.crowd import Crowd
from radarsim.physics.curved import Curved
from radarsim.physics.echoes import Echoes, Provenance
from radarsim.physics.facets import Facets
from radarsim.physics.images import LEAST_LOSS, Images
from radarsim.physics.legs import Legs, Pairs
from radarsim.physics.mirrors import Mirrors
from radarsim.physics.obstacles import CLEARANCE, Obstacles
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.slabs import Slabs
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import NODES, BurstClock
from radarsim.physics.unevenness import Heights
from radarsim.physics.view import View
from radarsim.scene.scene import Scene

#: Above the antenna's gain one way, as an amplitude.
PEAK_GAIN = 3.4


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
        heights: how uneven walls are; default: flat.
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
        heights: Heights | None = None,
    ):
        self.scene, self.surface, self.facets, self.config = scene, surface, facets, config
        self.weakest, self.curved, self.crowd, self.heights = weakest, curved, crowd, heights
        self.reach = 1.05 * config.max_range if reach is None else reach
        self.mirrors = None if facets is None else Mirrors.of(facets, scene, self.reach)
        self.obstacles = Obstacles(scene, None if scene is None else Slabs(scene, config, CLEARANCE), crowd)
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
        """Echoes of several frames together: ray tests and loops over scatterers are quicker in large numbers.

        Args:
            positions, rotations, times: of the sensor in the middle of each burst; m, sensor to world, s.
        """
        positions, rotations = np.asarray(positions, float), np.asarray(rotations, float)
        batch = Batch.of(positions, rotations, times, self.surface, self.crowd, self.reach)
        candidates = Candidates.of(batch, self.reach, self.config.wavelength, self.weakest, self._tables)
        near = self._mirrors_in_sight(batch)
        straight = self._straight(batch, candidates)
        legs = Legs.joined([straight, self._over_mirrors(batch, candidates, straight, near)])
        pairs = Pairs.of(batch, candidates, legs, self.reach, self.weakest)
        images = None
        if self.mirrors is not None:
            limits = self.reach, self.config.wavelength, self.weakest, self._tables
            views = [View(p, r, *limits) for p, r in zip(positions, rotations, strict=True)]
            images = Images.of(batch, self.facets, self.curved, self.mirrors, near, self.obstacles, views, self.heights)
        return self._echoes(batch, candidates, legs, pairs, images)

    def _straight(self, batch: Batch, candidates: Candidates) -> Legs:
        """Straight legs worth an echo, through slabs last."""
        legs = Legs.straight(batch, candidates, np.flatnonzero(candidates.echo > self.weakest))
        allowed = candidates.echo[legs.candidate] > LEAST_LOSS * self.weakest
        allowed &= batch.weights[candidates.scatterer[legs.candidate], 1] > 0
        legs = self._unhindered(batch, candidates, legs, legs.virtual[:, None], allowed)
        return Legs.joined([legs[~legs.slab], legs[legs.slab]])

    def _mirrors_in_sight(self, batch: Batch) -> list[np.ndarray]:
        """Per frame, the mirrors of which something can be seen, and the small plates of corners within reach."""
        if self.mirrors is None:
            return [np.zeros(0, int)] * len(batch)
        poses = zip(batch.position, batch.rotation, strict=True)
        found = [self.mirrors.near(p, r[:, 0], self.reach) for p, r in poses]
        if self.scene is None:
            return found
        index, frame = np.concatenate(found), np.repeat(np.arange(len(found)), [len(f) for f in found])
        seen = ~self.mirrors.large[index]
        large = np.flatnonzero(~seen)
        points = self.mirrors.spread(index[large], batch.position[frame[large]], self.reach)
        origins = np.repeat(batch.position[frame[large]], points.shape[1], axis=0)
        clear = ~self.scene.occluded(origins, points.reshape(-1, 3), margin=CLEARANCE)
        seen[large] = clear.reshape(points.shape[:2]).any(axis=1)
        return [index[(frame == k) & seen] for k in range(len(batch))]

    def _over_mirrors(self, batch: Batch, candidates: Candidates, straight: Legs, near: list[np.ndarray]) -> Legs:
        """Legs over one mirror and over two."""
        ways, free = Ways(), np.zeros(len(candidates), bool)
        free[straight.candidate[~straight.slab]] = True
        once, twice = batch.weights[candidates.scatterer, 1:].T > 0
        # Hidden scatterers are seen over mirrors out and back, which is of second order: fewer of them do.
        rows = np.flatnonzero(np.where(free, once, twice))
        distance = candidates.distance[rows]
        # No longer than leaves room for the other leg, nor so weak that the other leg cannot make up for it.
        longest = np.where(free[rows], 2 * self.reach - distance, self.reach)
        weakest = self.weakest * distance / (PEAK_GAIN * candidates.most[rows])
        # How a virtual point moves is known of one mirror (`Legs.turn`): movers have no legs over two.
        double = (free & twice & (candidates.scatterer < batch.still))[rows]
        edges = np.searchsorted(candidates.frame[rows], np.arange(len(batch) + 1))
        for frame, found in enumerate(near):
            large = found[self.mirrors.large[found]] if len(found) else found
            if len(large):
                one = np.arange(edges[frame], edges[frame + 1])
                single = np.stack([large, np.full(len(large), -1)], axis=1)
                pairs = self.mirrors.pairs(large, batch.position[frame])
                for chains, some in ((single, one), (pairs, one[double[one]])):
                    ways.add(frame, chains, rows[some], longest[some], weakest[some])
        legs, stops = ways.legs(batch, candidates, self.mirrors, self.config.wavelength, self._tables)
        strength = _strongest_echoes(candidates, straight, legs)
        worth = strength > self.weakest
        legs, stops, strength = legs[worth], stops[worth], strength[worth]
        allowed = twice[legs.candidate] & (legs.bounces == 1) & (strength > LEAST_LOSS * self.weakest)
        return self._unhindered(batch, candidates, legs, stops, allowed)

    def _unhindered(self, batch: Batch, candidates: Candidates, legs: Legs, stops, allowed) -> Legs:
        """Those legs that get through from stop to stop, weakened and delayed where they pass slabs."""
        frame = candidates.frame[legs.candidate]
        factor, delay = self.obstacles.way(batch, frame, stops, 1 + legs.bounces, allowed)
        through = np.flatnonzero(factor)
        legs, factor, delay = legs[through], factor[through], delay[through]
        legs = replace(legs, amplitude=legs.amplitude * factor, slab=factor != 1)
        late = np.flatnonzero(legs.slab)  # a delay moves the virtual point away
        offset = legs.virtual[late] - batch.position[candidates.frame[legs.candidate[late]]]
        legs.virtual[late] += offset * (delay[late] / np.linalg.norm(offset, axis=1))[:, None]
        return legs

    def _echoes(
        self, batch: Batch, candidates: Candidates, legs: Legs, pairs: Pairs, images: Images | None
    ) -> list[Echoes]:
        """Pairs of legs and images, by frame."""
        first = legs.candidate[pairs.legs[:, 0]]
        points, moving = np.take(legs.virtual, pairs.legs, axis=0), pairs.cause == Provenance.MOVING
        moves = self._moves(batch, candidates, legs, pairs.legs[moving])
        frames = np.arange(len(batch) + 1)
        edges = np.searchsorted(candidates.frame[first], frames)
        moved = np.concatenate([[0], np.cumsum(moving)])[edges]
        if images is None:
            images = Images(np.zeros(0, int), np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, np.uint8))
        flashes = np.searchsorted(images.frame, frames)
        return [
            Echoes(
                points[i:j], images.isometry[k:m],
                np.concatenate([pairs.amplitude[i:j], images.amplitude[k:m]]),
                np.concatenate([pairs.cause[i:j], images.cause[k:m]]), moves[a:b],
            )
            for i, j, k, m, a, b in zip(edges, edges[1:], flashes, flashes[1:], moved, moved[1:], strict=False)
        ]  # fmt: skip

    def _moves(self, batch: Batch, candidates: Candidates, legs: Legs, ends) -> Float[np.ndarray, "moving 2 3 3"]:
        """How far the virtual points of movers' echoes are from where they are in the middle, at the burst's nodes."""
        first = legs.candidate[ends[:, 0]]
        owner = candidates.frame[first]
        carried = (candidates.scatterer[first] - batch.still) % max(len(self.crowd or ()), 1)
        offsets = BurstClock.of(self.config).half * NODES
        out = np.empty((len(ends), 2, 3, 3))
        for frame in np.unique(owner):
            rows = np.flatnonzero(owner == frame)
            places = self.crowd.positions(batch.time[frame] + np.append(offsets, 0.0))[:, carried[rows]]
            moved = (places[:3] - places[3]).transpose(1, 0, 2)  # echo, node, axis
            for way in (0, 1):
                turn = legs[ends[rows, way]].turn(places[3])
                out[rows, way] = np.einsum("eij,enj->eni", turn, moved)
        return out


def _strongest_echoes(candidates: Candidates, straight: Legs, legs: Legs) -> Float[np.ndarray, "leg"]:
    """Amplitude that no echo which each leg over mirrors can be part of exceeds."""
    size, best = np.abs(legs.amplitude), np.zeros(len(candidates))
    best[straight.candidate] = np.abs(straight.amplitude)
    np.maximum.at(best, legs.candidate, size)
    return candidates.most[legs.candidate] * size * best[legs.candidate]
