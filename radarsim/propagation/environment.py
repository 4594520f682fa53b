"""Environment of the radar, and its view from a batch of frames: the input of every mechanism in `mechanisms`."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from radarize.radar.config import RadarConfig
from radarsim.propagation import visible_mirrors
from radarsim.propagation.candidates import Candidates
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.reverberation import Detours
from radarsim.propagation.surface import Cluttered, Scattering
from radarsim.propagation.targets import Targets
from radarsim.propagation.visible_mirrors import Mirrors
from radarsim.world.scene import Scene


@dataclass(frozen=True, eq=False)
class Environment:
    """World of a radar.

    Attributes:
        scene: geometry for ray tests; None if there are no obstacles.
        surface: diffuse surface, or a given set of scatterers.
        reflectors: flat and curved reflectors; None: there are none.
        moving: moving objects.
        obstacles: obstacles on rays.
    """

    scene: Scene | None
    surface: Scattering
    reflectors: Reflectors | None
    moving: MovingTargets
    obstacles: Obstacles

    @classmethod
    def of(
        cls, scene: Scene | None, surface: Scattering, reflectors: Reflectors | None, config: RadarConfig,
        moving: MovingTargets | None = None,
    ) -> "Environment":  # fmt: skip
        """Build the environment of a radar's configuration."""
        moving = MovingTargets([], np.random.default_rng()) if moving is None else moving
        return cls(scene, surface, reflectors, moving, Obstacles.of(scene, moving, config))

    @property
    def detours(self) -> Detours:
        """Paths of waves that are scattered twice or more."""
        return self.surface.detours if isinstance(self.surface, Cluttered) else Detours.zeros(0)


@dataclass(frozen=True, eq=False)
class View:
    """View of an environment from the poses of a batch of frames.

    Attributes:
        environment, observation: the environment, and the poses.
    """

    environment: Environment
    observation: Observation

    @property
    def obstacles(self) -> Obstacles:
        """Obstacles on rays."""
        return self.environment.obstacles

    @cached_property
    def targets(self) -> Targets:
        """Scatterers in range of any frame."""
        return Targets.of(self.observation, self.environment.surface, self.environment.moving)

    @cached_property
    def candidates(self) -> Candidates:
        """Scatterers that may have an echo, by frame."""
        return Candidates.of(self.observation, self.targets)

    @cached_property
    def _reflectors(self) -> tuple[Flat, Flat]:
        reflectors, observation, plates = self.environment.reflectors, self.observation, self.obstacles.plates
        if reflectors is None:
            return Flat.zeros(0), Flat.zeros(0)
        flat, inner = reflectors.near(observation.position, observation.range)
        if len(plates):
            moving, hollow = plates.faces(observation)
            flat, inner = Flat.joined([flat, moving]), Flat.joined([inner, hollow])
        return flat, Flat.joined([flat, inner])

    @property
    def flat(self) -> Flat:
        """Flat reflectors in range of any frame, moving ones last."""
        return self._reflectors[0]

    @property
    def facing(self) -> Flat:
        """Flat reflectors, followed by the inner faces of hollow bodies, which are not used as mirrors."""
        return self._reflectors[1]

    @cached_property
    def mirrors(self) -> list[Mirrors]:
        """For each frame, the reflectors in `flat` that are visible to the radar, and which are visible over others."""
        if self.environment.reflectors is None:
            return [Mirrors.none()] * self.observation.frames
        return visible_mirrors.find(self.observation, self.flat, self.obstacles)
