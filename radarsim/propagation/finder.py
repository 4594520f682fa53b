"""Propagation paths of a batch of frames: each mechanism's paths, then the motion of targets during the burst.

A new mechanism is a file in `mechanisms` with `find(view) -> Paths`, and its name in `MECHANISMS`.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from radarize.radar.config import RadarConfig
from radarsim.propagation import tracks
from radarsim.propagation.antenna import Antenna, gain_pattern
from radarsim.propagation.environment import Environment, View
from radarsim.propagation.mechanisms import curved_ghosts, diffuse, diffuse_multipath, image_chains, specular
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.paths import Paths
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.surface import Scattering
from radarsim.world import plugins
from radarsim.world.scene import Scene

#: Propagation mechanisms; plug-ins append theirs.
MECHANISMS: list[Callable[[View], Paths]] = [
    diffuse.find, specular.find, image_chains.find, curved_ghosts.find, diffuse_multipath.find,
]  # fmt: skip


class PathFinder:
    """Find the propagation paths of a radar in a world.

    Args:
        scene: geometry for ray tests; None if there are no obstacles.
        surface: diffuse surface, or a given set of scatterers.
        reflectors: flat and curved reflectors; None: there are none.
        config: radar configuration.
        threshold: echoes below this amplitude are left out.
        range: maximum one-way range, m; default: 5 % beyond the radar's maximum.
        antenna: pattern of the elements; default: the board's.
        moving: moving objects.
    """

    def __init__(
        self,
        scene: Scene | None,
        surface: Scattering,
        reflectors: Reflectors | None,
        config: RadarConfig,
        threshold: float = 0.0,
        range: float | None = None,
        antenna: Antenna | None = None,
        moving: MovingTargets | None = None,
    ):
        plugins.load()
        self.config, self.threshold = config, threshold
        self.environment = Environment.of(scene, surface, reflectors, config, moving)
        self.range = 1.05 * config.max_range if range is None else range
        self._pattern = gain_pattern(antenna or Antenna.of(config.board))

    def __call__(
        self, position: Float[np.ndarray, "3"], rotation: Float[np.ndarray, "3 3"], time: float = 0.0
    ) -> Paths:
        """Find the paths for one sensor pose (rotation: sensor to world) at the centre of a burst, `time` (s)."""
        return self.batch(np.asarray(position)[None], np.asarray(rotation)[None], np.array([time]))[0]

    def view(
        self,
        positions: Float[np.ndarray, "frame 3"],
        rotations: Float[np.ndarray, "frame 3 3"],
        times: Float[np.ndarray, "frame"],
    ) -> View:
        """View of the environment from the poses of some frames; arguments as for `batch`."""
        position, rotation, time = (np.ascontiguousarray(each, float) for each in (positions, rotations, times))
        observation = Observation(
            position, rotation, time, self.range, self.config.wavelength, self.threshold, *self._pattern
        )
        return View(self.environment, observation)

    def batch(
        self,
        positions: Float[np.ndarray, "frame 3"],
        rotations: Float[np.ndarray, "frame 3 3"],
        times: Float[np.ndarray, "frame"],
    ) -> list[Paths]:
        """Find the paths of several frames together: ray tests and loops over scatterers are faster in large numbers.

        Args:
            positions, rotations, times: sensor poses at the centre of each burst; m, sensor to world, s.
        """
        view = self.view(positions, rotations, times)
        paths = Paths.joined([find(view) for find in MECHANISMS])
        order = np.argsort(paths.frame.astype(np.uint16), kind="stable")  # NumPy sorts 16 bits in linear time
        paths = tracks.followed(view, self.config, paths[order])
        edges = np.searchsorted(paths.frame, np.arange(view.observation.frames + 1))
        return [paths[begin:end] for begin, end in zip(edges, edges[1:], strict=False)]
