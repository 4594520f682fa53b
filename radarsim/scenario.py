"""Scenario (scene, motion, radar, seed) and its frames, computed step by step from paths to samples.

A frame depends only on the scenario and on the time at which it starts: all random numbers are keyed by the seed,
their purpose and that time (`keyed_rng`). So frames can be computed in any order and number, on any machine.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float, Int, Int16, UInt8

from radarize.io.errors import InputError
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.machine.rng import keyed_rng
from radarsim.machine.threads import one_blas_thread
from radarsim.motion.trajectory import Motion
from radarsim.propagation.antenna import gain_pattern
from radarsim.propagation.burst import BurstClock
from radarsim.propagation.clutter import Clutter
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.obstacles import Obstacles
from radarsim.propagation.path_types import PathTypes
from radarsim.propagation.paths import Paths
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.reverberation import Detours
from radarsim.propagation.surface import Cluttered, Surface
from radarsim.propagation.unevenness import Heights
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.receiver.interference import Interference
from radarsim.receiver.synthesis import Synthesizer
from radarsim.world.raycast import RayCaster
from radarsim.world.scene import Scene


@dataclass(frozen=True, eq=False)
class Scenario:
    """Radar that moves through a scene.

    Attributes:
        scene: the world.
        motion: motion of the radar.
        config: configuration of the radar.
        front_end: settings of its front end; default: those of the board's file.
        seed: seed of scatterers, noise, sensor errors, and variation from board to board.
        sensors: sensors beside the radar, names from `radarsim.sensors.suite.SENSORS`; none affects the radar's
            samples.
    """

    scene: Scene
    motion: Motion
    config: RadarConfig
    front_end: FrontEndConfig | None = None
    seed: int = 0
    sensors: tuple[str, ...] = ()

    def frames(self, times: Float[np.ndarray, "frame"], end: float | None = None) -> "Frames":
        """Frames that start at `times`, ascending, s; each step is computed on first use.

        Args:
            times: start times on the clock of the motion.
            end: start of the frame after the last one, s; default: a frame period later.
        """
        times = np.asarray(times, float)
        return Frames(self, times, times[-1] + self.config.frame_period if end is None else end)

    @property
    def times(self) -> Float[np.ndarray, "frame"]:
        """Start times of consecutive frames during the motion, s.

        Raises:
            InputError: the motion is shorter than a frame.
        """
        count = self.config.frames_within(self.motion.duration)
        if count < 1:
            raise InputError(
                f"duration is {self.motion.duration:g} s, expected at least one frame of {self.config.frame_period} s"
            )
        return np.arange(count) * self.config.frame_period

    def ticks(self, rate: float) -> Int[np.ndarray, "tick"]:
        """Indices of all ticks of a clock of `rate` Hz during the motion and until the end of its last frame."""
        return Frames(self, np.zeros(1), self.motion.duration + self.config.frame_period).ticks(rate)

    def rng(self, purpose: str, time: float | None = None) -> np.random.Generator:
        """Return the random generator of a purpose, or of a time (s) within it."""
        return keyed_rng(self.seed, purpose, time)

    # --- what frames are made with ------------------------------------------------------------------------------------
    @cached_property
    def board(self) -> FrontEnd:
        """Front end of this individual board."""
        return FrontEnd(self.config, self.front_end, self.rng("board"))

    @cached_property
    def finder(self) -> PathFinder:
        """Finder of the propagation paths at a pose."""
        weakest, antenna = self.board.weakest, self.board.settings.pattern
        reach = SPEED_OF_LIGHT * self.board.passband[1] / (2 * self.config.slope)
        surface, clutter = Surface(self.scene, self.rng("surface")), Clutter(self.scene, self.rng("clutter"))
        detours = Detours.of(self.scene, self.config, self.rng("reverberation"))
        scatterers = Cluttered(surface, clutter, detours)
        reflectors = Reflectors.of(self.scene, self.config, Heights.of(self.scene, self.rng("unevenness")))
        return PathFinder(self.scene, scatterers, reflectors, self.config, weakest, reach, antenna, self._moving)

    @cached_property
    def path_types(self) -> PathTypes:
        """Classifier of paths by type: direct, ghost, and others."""
        return PathTypes(self.scene, self.config, gain_pattern(self.board.settings.pattern))

    @cached_property
    def _moving(self) -> MovingTargets:
        return MovingTargets(self.scene.movers, self.rng("movers"))

    @cached_property
    def interference(self) -> Interference:
        """Model of the signals from the scene's other radars."""
        obstacles = Obstacles.of(self.scene, self._moving, self.config)
        return Interference(self.scene.interferers, self.board, obstacles)

    @cached_property
    def synthesize(self) -> Synthesizer:
        """Synthesizer of the beat signal from paths."""
        return Synthesizer(self.config)

    @cached_property
    def rays(self) -> RayCaster:
        """Ray caster for cameras and lidars: first surfaces, moving objects included."""
        return RayCaster(self.scene)


@dataclass(frozen=True, eq=False)
class Frames:
    """Frames of a scenario; each step from paths to samples is computed on first use.

    Attributes:
        scenario: their scenario.
        times: start of each frame's first chirp, ascending, s.
        end: start of the frame after the last, s.
    """

    scenario: Scenario
    times: Float[np.ndarray, "frame"]
    end: float

    def __len__(self) -> int:
        return len(self.times)

    @property
    def middles(self) -> Float[np.ndarray, "frame"]:
        """Centre time of each burst, s."""
        return self.times + self.scenario.config.burst_center

    @cached_property
    @one_blas_thread
    def paths(self) -> list[Paths]:
        """Propagation paths of each frame at the centre of its burst."""
        motion, middles = self.scenario.motion, self.middles
        return self.scenario.finder.batch(motion.position(middles), motion.rotation(middles).as_matrix(), middles)

    @cached_property
    def lengths(self) -> list[Float[np.ndarray, "path virtual 3"]]:
        """Path lengths of each frame's paths, see `Paths.lengths`."""
        config, motion = self.scenario.config, self.scenario.motion
        times = np.ravel(self.times[:, None] + BurstClock.of(config).nodes)
        poses = motion.position(times).reshape(-1, 3, 3), motion.rotation(times).as_matrix().reshape(-1, 3, 3, 3)
        found = [p.lengths_from(*pose, config) for p, *pose in zip(self.paths, *poses, strict=True)]
        for each in found:
            each[..., 0] += 2 * config.range_bias  # the board's delay, which the pipeline subtracts
        return found

    @cached_property
    def received(self) -> list[Complex[np.ndarray, "path"]]:
        """Amplitudes of each frame's paths after the IF filters."""
        response = self.scenario.board.if_response
        pairs = zip(self.lengths, self.paths, strict=True)
        return [p.amplitude * response(length[:, 0, 0]) for length, p in pairs]

    @cached_property
    @one_blas_thread
    def types(self) -> list[UInt8[np.ndarray, "path"]]:
        """Path type of each frame's paths."""
        motion, middles = self.scenario.motion, self.middles
        lengths = [each[..., 0] - 2 * self.scenario.config.range_bias for each in self.lengths]
        poses = motion.position(middles), motion.rotation(middles).as_matrix()
        return self.scenario.path_types(self.paths, lengths, *poses)

    @cached_property
    @one_blas_thread
    def interference(self) -> list[Complex[np.ndarray, "loop tx rx sample"]]:
        """Signal of the scene's other radars in each frame, after the IF filters."""
        return [self.scenario.interference(self.scenario.motion, t) for t in self.times]

    @cached_property
    @one_blas_thread
    def samples(self) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """I/Q samples after the analogue-to-digital converter."""
        board, rng = self.scenario.board, self.scenario.rng
        signals = map(self.scenario.synthesize, self.lengths, self.received)
        if self.scenario.scene.interferers:
            signals = map(np.add, signals, self.interference)
        return np.stack([board.digitize(s, rng("noise", t)) for t, s in zip(self.times, signals, strict=True)])

    def ticks(self, rate: float) -> Int[np.ndarray, "tick"]:
        """Indices of the ticks of a clock of `rate` Hz, which starts at 0, from the first frame to the end."""
        first, last = np.ceil(np.array([self.times[0], self.end]) * rate - 1e-6).astype(int)
        return np.arange(first, last)
