"""Obstacles on rays: opaque objects and movers block them, slabs and doors attenuate and delay them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from radarize.radar.config import RadarConfig
from radarsim.propagation.movingplates import MovingPlates
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table
from radarsim.propagation.transmission import Transmission
from radarsim.world.scene import Scene

#: Distance of visibility rays from both of their ends, m: surfaces do not obstruct themselves.
CLEARANCE = 5e-3


@dataclass(frozen=True)
class Passage(Table):
    """Effect of obstacles on waves.

    Attributes:
        factor: factor on the amplitude; 0 behind an opaque object.
        delay: delay by slabs, m.
        through: whether a slab is passed.
        blocked: fraction of the amplitude that opaque objects block.
    """

    factor: Complex[np.ndarray, "way"]
    delay: Float[np.ndarray, "way"]
    through: Bool[np.ndarray, "way"]
    blocked: Float[np.ndarray, "way"]

    def after_one_another(self, first: Int[np.ndarray, "whole"]) -> "Passage":
        """Combine consecutive rows to whole paths, each from its first row to before the next one's."""
        factor, delay = np.multiply.reduceat(self.factor, first), np.add.reduceat(self.delay, first)
        clear = np.multiply.reduceat(1 - self.blocked, first)
        return Passage(factor, delay, np.logical_or.reduceat(self.through, first), 1 - clear)


class Obstacles:
    """Obstacles of a scene.

    Args:
        scene: geometry; None: there are no obstacles.
        transmission: its thin objects.
        moving: moving objects.
        plates: moving plates that transmit waves.
    """

    def __init__(
        self, scene: Scene | None, transmission: Transmission | None, moving: MovingTargets, plates: MovingPlates
    ):
        self.scene, self.transmission, self.moving, self.plates = scene, transmission, moving, plates

    @classmethod
    def of(cls, scene: Scene | None, moving: MovingTargets, config: RadarConfig) -> "Obstacles":
        """Obstacles of a scene for a radar's configuration."""
        transmission = None if scene is None else Transmission(scene, config, CLEARANCE)
        return cls(scene, transmission, moving, MovingPlates(moving, config, CLEARANCE))

    def clear(
        self, observation: Observation, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"], through: Bool[np.ndarray, "ray"] | None = None,
    ) -> Bool[np.ndarray, "ray"]:  # fmt: skip
        """Whether rays are unobstructed; frames and ends as for `passage`.

        Args:
            observation, frame, begin, end: see `passage`.
            through: rays for which slabs of the scene are no obstacles; None: they are obstacles for all.
        """
        blocked = np.zeros(len(frame), bool) if self.scene is None else self.scene.occluded(begin, end, CLEARANCE)
        if through is not None and self.transmission is not None and self.transmission.opaque is not None:
            rows = np.flatnonzero(blocked & through)
            blocked[rows] = self.transmission.opaque.occluded(begin[rows], end[rows], CLEARANCE)
        rows = np.flatnonzero(~blocked)
        blocked[rows] = self._by_movers(observation, frame[rows], begin[rows], end[rows])
        if len(self.plates):
            blocked |= self.plates.passage(observation, frame, begin, end, np.zeros(len(frame), bool))[0] == 0
        return ~blocked

    def passage(
        self, observation: Observation, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"], allowed: Bool[np.ndarray, "ray"],
    ) -> Passage:  # fmt: skip
        """Factor and delay of waves between points.

        Args:
            observation, frame: frame of each ray.
            begin, end: m.
            allowed: rays through slabs that are evaluated; for the others slabs are opaque.
        """
        factor, delay = np.ones(len(frame), complex), np.zeros(len(frame))
        if self.scene is not None and self.transmission is not None and len(frame):
            blocked = self.scene.occluded(begin, end, margin=CLEARANCE)
            factor[blocked] = 0
            through, opaque = np.flatnonzero(blocked & allowed), self.transmission.opaque
            if opaque is not None:  # this test takes a tenth of the time of counting slabs
                through = through[~opaque.occluded(begin[through], end[through], margin=CLEARANCE)]
            if len(through):
                up = observation.rotation[frame[through], :, 2]
                factor[through], delay[through] = self.transmission.passage(begin[through], end[through], up)
        rows = np.flatnonzero(factor)
        factor[rows[self._by_movers(observation, frame[rows], begin[rows], end[rows])]] = 0
        if len(self.plates):
            passed, late = self.plates.passage(observation, frame, begin, end, allowed & (factor != 0))
            factor, delay = factor * passed, delay + late
        opaque = factor == 0
        return Passage(factor, delay, ~opaque & (factor != 1), opaque.astype(float))

    def _by_movers(
        self, observation: Observation, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"],
    ) -> Bool[np.ndarray, "ray"]:  # fmt: skip
        """Whether an opaque part of a mover obstructs a ray."""
        return self.moving.occluded(begin, end, observation.time[frame], parts=self.moving.opaque)

    def way(
        self, observation: Observation, frame: Int[np.ndarray, "way"], stops: Float[np.ndarray, "way stop 3"],
        segments: Int[np.ndarray, "way"], allowed: Bool[np.ndarray, "way"],
    ) -> Passage:  # fmt: skip
        """The same for paths of several segments from the sensor over stops.

        Args:
            stops: m; unused stops may follow the last one of a path.
            segments: number of segments of each path.
        """
        first = np.cumsum(segments) - segments
        way = np.repeat(np.arange(len(segments)), segments)
        stop = np.arange(len(way)) - first[way]
        end = stops[way, stop]
        begin = np.roll(end, 1, axis=0)
        begin[first] = observation.position[frame]
        passed = self.passage(observation, frame[way], begin, end, allowed[way])
        return passed.after_one_another(first)
