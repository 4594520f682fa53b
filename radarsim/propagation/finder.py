"""Finds the echoes of a frame: scatterers in sight, paths over mirrors and through slabs, flashes, chains of mirrors.

Start reading at `EchoFinder.batch`.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from radarize.radar.config import RadarConfig
from radarsim.propagation import movingplates, visible_mirrors
from radarsim.propagation.antenna import Antenna, gain_pattern
from radarsim.propagation.burst import NODES, BurstClock
from radarsim.propagation.candidates import Candidates
from radarsim.propagation.echoes import Echoes, Provenance
from radarsim.propagation.fresnelzone import LEAST_LOSS
from radarsim.propagation.mechanisms import curved_ghosts, images
from radarsim.propagation.mechanisms.images import Images
from radarsim.propagation.mechanisms.mirrored_paths import SpecularCandidates
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles
from radarsim.propagation.paths import OneWay, TwoWay
from radarsim.propagation.pointechoes import PointEchoes
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Surface
from radarsim.propagation.targets import Targets
from radarsim.propagation.visible_mirrors import Mirrors
from radarsim.world.scene import Scene

#: Paths to scatterers over two mirrors are looked for over those of this area and more, m^2: at 2 m a Fresnel zone
#: takes 0.02. There are many more pairs with smaller ones, which show little of the world.
LEAST_TWICE = 0.05


class EchoFinder:
    """Finds the echoes of a frame.

    Args:
        scene: ray tests run on its geometry; None where nothing can stand in the way.
        surface: the diffuse surface, or a given set of scatterers.
        reflectors: flat and round mirrors.
        config: radar configuration.
        threshold: echoes below this amplitude are left out.
        range: largest one-way range of interest, m; default: 5 % beyond the radar's maximum.
        antenna: the elements' pattern; default: the IWR1843BOOST's.
        moving: what moves by itself.
    """

    def __init__(
        self,
        scene: Scene | None,
        surface: Surface | Scatterers,
        reflectors: Reflectors | None,
        config: RadarConfig,
        threshold: float = 0.0,
        range: float | None = None,
        antenna: Antenna | None = None,
        moving: MovingTargets | None = None,
    ):
        self.scene, self.surface, self.reflectors, self.config = scene, surface, reflectors, config
        self.threshold = threshold
        self.moving = MovingTargets([], np.random.default_rng()) if moving is None else moving
        self.range = 1.05 * config.max_range if range is None else range
        self.obstacles = Obstacles.of(scene, self.moving, config)
        self.plates = self.obstacles.plates
        self._pattern = gain_pattern(antenna)

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
        poses = (np.ascontiguousarray(each, float) for each in (positions, rotations, times))
        observation = Observation(*poses, self.range, self.config.wavelength, self.threshold, *self._pattern)
        targets = Targets.of(observation, self.surface, self.moving)
        candidates = Candidates.of(observation, targets)
        flat, facing, mirrors = self._mirrors(observation)
        straight = self._straight(observation, targets, candidates)
        over_mirrors = self._over_mirrors(observation, targets, candidates, straight, flat, mirrors)
        one_way = OneWay.joined([straight, over_mirrors])
        two_way = TwoWay.of(observation, targets, candidates, one_way)
        points, found = PointEchoes.of(candidates, one_way, two_way), Images.none()
        if self.reflectors is not None:
            found = Images.joined([
                images.flashes(observation, facing, self.reflectors, self.obstacles),
                images.by_chains(observation, flat, mirrors, self.obstacles),
            ])  # fmt: skip
            ghosts = curved_ghosts.seen(observation, flat, mirrors, self.reflectors, self.obstacles)
            points = PointEchoes.joined([ghosts, points])
        return self._echoes(observation, targets, facing, points, found)

    def _mirrors(self, observation: Observation) -> tuple[Flat, Flat, list[Mirrors]]:
        """Flat reflectors in range of any frame, those and inner ones, and which play a part in each."""
        if self.reflectors is None:
            return Flat.none(), Flat.none(), [Mirrors.none()] * observation.frames
        flat = self.reflectors.near(observation.position, observation.range)
        inner = self.reflectors.inner_near(observation.position, observation.range)
        if len(self.plates):
            moving, hollow = self.plates.faces(observation)
            flat, inner = Flat.joined([flat, moving]), Flat.joined([inner, hollow])
        return flat, Flat.joined([flat, inner]), visible_mirrors.find(observation, flat, self.obstacles)

    def _straight(self, observation: Observation, targets: Targets, candidates: Candidates) -> OneWay:
        """Straight paths worth an echo, through slabs last."""
        paths = OneWay.straight(
            observation, targets, candidates, np.flatnonzero(candidates.echo > observation.threshold)
        )
        allowed = candidates.echo[paths.candidate] > LEAST_LOSS * observation.threshold
        allowed &= targets.weights[candidates.scatterer[paths.candidate], 1] > 0
        paths = self._unhindered(observation, candidates, paths, paths.virtual[:, None], allowed)
        return OneWay.joined([paths[~paths.slab], paths[paths.slab]])

    def _over_mirrors(
        self, observation: Observation, targets: Targets, candidates: Candidates, straight: OneWay, flat: Flat,
        mirrors: list[Mirrors],
    ) -> OneWay:  # fmt: skip
        """Paths over one mirror and over two."""
        specular, free = SpecularCandidates(), np.zeros(len(candidates), bool)
        free[straight.candidate[~straight.slab]] = True
        once, twice = targets.weights[candidates.scatterer, 1:].T > 0
        # Hidden scatterers are seen over mirrors out and back, which is of second order: fewer of them do.
        rows = np.flatnonzero(np.where(free, once, twice))
        distance = candidates.distance[rows]
        # No longer than leaves room for the way back, nor so weak that the way back cannot make up for it.
        longest = np.where(free[rows], 2 * observation.range - distance, observation.range)
        weakest = observation.threshold * distance / (observation.peak_gain * candidates.most[rows])
        # How a virtual point moves is known of one mirror (`OneWay.turn`): moving targets have no paths over two.
        double = (free & twice & (candidates.scatterer < targets.still))[rows]
        edges = np.searchsorted(candidates.frame[rows], np.arange(observation.frames + 1))
        for frame, (seen, pairs) in enumerate(mirrors):
            one = np.arange(edges[frame], edges[frame + 1])
            single = np.stack([seen, np.full(len(seen), -1)], axis=1)
            large = pairs[(flat.half[pairs].prod(axis=2) > LEAST_TWICE / 4).all(axis=1)]
            for chains, some in ((single, one), (large, one[double[one]])):
                specular.add(frame, chains, rows[some], longest[some], weakest[some])
        paths, stops = specular.paths(observation, targets, candidates, flat)
        strength = _strongest_echoes(candidates, straight, paths)
        worth = strength > observation.threshold
        paths, stops, strength = paths[worth], stops[worth], strength[worth]
        allowed = twice[paths.candidate] & (paths.bounces == 1) & (strength > LEAST_LOSS * observation.threshold)
        return self._unhindered(observation, candidates, paths, stops, allowed)

    def _unhindered(self, observation: Observation, candidates: Candidates, paths: OneWay, stops, allowed) -> OneWay:
        """Those paths that get through from stop to stop, weakened and delayed where they pass slabs."""
        frame = candidates.frame[paths.candidate]
        factor, delay = self.obstacles.way(observation, frame, stops, 1 + paths.bounces, allowed)
        through = np.flatnonzero(factor)
        paths, factor, delay = paths[through], factor[through], delay[through]
        paths = replace(paths, amplitude=paths.amplitude * factor, slab=factor != 1)
        late = np.flatnonzero(paths.slab)  # a delay moves the virtual point away
        offset = paths.virtual[late] - observation.position[candidates.frame[paths.candidate[late]]]
        paths.virtual[late] += offset * (delay[late] / np.linalg.norm(offset, axis=1))[:, None]
        return paths

    def _echoes(
        self, observation: Observation, targets: Targets, flat: Flat, points: PointEchoes, found: Images
    ) -> list[Echoes]:
        """Echoes by frame, what moves last among points and among images."""
        moves = self.plates.moves(observation)
        if len(self.plates):
            points.cause[movingplates.carried(flat, points.mirrors.reshape(-1, 4))] = Provenance.MOVING
        carried = movingplates.carried(flat, found.mirrors)
        found.cause[carried] = Provenance.MOVING
        points = points[np.lexsort((points.cause == Provenance.MOVING, points.frame))]
        arcs = found.shape[:, 0] > 0
        order = np.lexsort((arcs + 2 * carried, found.frame))
        found, carried, arcs = found[order], carried[order], arcs[order]
        moving, turning = points.cause == Provenance.MOVING, found[carried]
        offsets = self._moves(observation, targets, flat, points[moving], moves)
        turns = movingplates.turned(flat, turning.isometry, turning.mirrors, moves)
        frames = range(observation.frames + 1)
        round_ = found[arcs]
        owners = points.frame, points.frame[moving], found.frame, turning.frame, round_.frame
        edges = [np.searchsorted(of, frames) for of in owners]
        spans = zip(*([slice(a, b) for a, b in zip(e, e[1:], strict=False)] for e in edges), strict=True)
        return [
            Echoes(
                points.points[p], found.isometry[i], np.concatenate([points.amplitude[p], found.amplitude[i]]),
                np.concatenate([points.cause[p], found.cause[i]]), offsets[m], turns[t], round_.shape[a],
            )
            for p, m, i, t, a in spans
        ]  # fmt: skip

    def _moves(
        self, observation: Observation, targets: Targets, flat: Flat, points: PointEchoes,
        moves: Float[np.ndarray, "frame plate 4 3 4"],
    ) -> Float[np.ndarray, "moving 2 3 3"]:  # fmt: skip
        """How far the virtual points of echoes that move have moved from the middle to the burst's nodes."""
        offsets = BurstClock.of(self.config).half * np.append(NODES, 0.0)
        own = np.zeros((len(points), 3, 3))  # echo, node, axis
        for frame in np.unique(points.frame):
            rows = np.flatnonzero((points.frame == frame) & (points.scatterer >= targets.still))
            which = (points.scatterer[rows] - targets.still) % max(len(self.moving), 1)
            places = self.moving.positions(observation.time[frame] + offsets)[:, which]
            own[rows] = (places[:3] - places[3]).transpose(1, 0, 2)
        ways = [movingplates.moved(flat, points.points[:, k], own, points.mirrors[:, k], moves) for k in (0, 1)]
        return np.stack(ways, axis=1)


def _strongest_echoes(candidates: Candidates, straight: OneWay, paths: OneWay) -> Float[np.ndarray, "path"]:
    """Amplitude that no echo which each path over mirrors can be part of exceeds."""
    size, best = np.abs(paths.amplitude), np.zeros(len(candidates))
    best[straight.candidate] = np.abs(straight.amplitude)
    np.maximum.at(best, paths.candidate, size)
    return candidates.most[paths.candidate] * size * best[paths.candidate]
