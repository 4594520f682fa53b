"""Where the virtual radar's samples come from: a recording, or a walk through a scene simulated as it goes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from math import isclose
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import Int16

from radarize.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import encode
from radarize.radar.presets import load_config
from radarize.recording import Recording

#: What does not change the samples that the radar sends: corrections for whoever reads them.
NOT_IN_SAMPLES = {"board", "range_bias", "channel_calibration"}
_KEPT = 256 << 20  # bytes of a recording that, played in a loop, are unpacked once


class Source(Protocol):
    """Gives frames; sent to another process, which makes them ahead of time."""

    def expected(self) -> RadarConfig:
        """The configuration to make frames for before one has come over the UART."""

    def check(self, config: RadarConfig) -> None:
        """Refuse a configuration with an InputError."""

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """LVDS bytes of frame after frame."""


@dataclass(frozen=True)
class Playback:
    """The frames of a recording, as the radar that made it sent them.

    Attributes:
        path: of the recording.
        loop: begin again at the end.
    """

    path: Path
    loop: bool = False

    def expected(self) -> RadarConfig:
        """The recording's own."""
        with Recording(self.path) as recording:
            if not len(recording):
                raise InputError(f"{self.path}: holds no frame, expected at least one to play")
            recording.adc(0, 0)  # refuses recordings of heat maps
            return recording.config

    def check(self, config: RadarConfig) -> None:
        """Refuse any other configuration than the recording's.

        Raises:
            InputError: naming the first field that differs.
        """
        own = self.expected()
        for name in RadarConfig.model_fields:
            asked, recorded = getattr(config, name), getattr(own, name)
            if name not in NOT_IN_SAMPLES | {"iq_order"} and not _alike(asked, recorded):
                raise InputError(f"{name} is {asked}, expected {recorded} as in {self.path.name}, which is played")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """One at a time, packed as `config` says."""
        with Recording(self.path) as recording:
            numbers, kept = range(len(recording)), len(recording) * config.frame_bytes <= _KEPT
            frames = (
                _packed(recording.adc(number, number + 1), config)
                for number in (cycle(numbers) if self.loop and not kept else numbers)
            )
            if self.loop and kept:
                frames = cycle(frames)
            yield from frames


@dataclass(frozen=True)
class Walk:
    """A walk through a scene, at whatever configuration the radar gets; as `radarsim simulate` makes it.

    Attributes:
        scene, platform, duration, seed: as for `simulate`.
        radar: preset or configuration file expected over the UART.
        loop: walk again, from the start, at the end.
    """

    scene: str
    platform: str = "handheld"
    duration: float = 40.0
    seed: int = 0
    radar: str = "radarize"
    loop: bool = False

    def expected(self) -> RadarConfig:
        """The preset's, or the file's; refuses a scene that is not there."""
        from radarsim.scene.description import find

        find(self.scene)
        return load_config(self.radar)[0]

    def check(self, config: RadarConfig) -> None:
        """Takes all that the chip can do, if the walk is long enough for a frame.

        Raises:
            InputError: it is not.
        """
        if config.frames_within(self.duration) < 1:
            raise InputError(f"duration is {self.duration:g} s, expected at least one frame of {config.frame_period} s")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """Simulated in batches, as `simulate` does."""
        from radarsim.planner import plan_motion
        from radarsim.scene.scene import Scene
        from radarsim.simulate import BATCH, Simulator

        world = Scene.load(self.scene)
        while True:
            route, physics = np.random.default_rng(self.seed).spawn(2)
            motion = plan_motion(world, self.platform, self.duration, route).until(self.duration)
            simulator = Simulator(world, motion, config, physics)
            times = np.arange(config.frames_within(motion.duration)) * config.frame_period
            for first in range(0, len(times), BATCH):
                for frame in simulator.frames(times[first : first + BATCH])[0]:
                    yield _packed(frame[None], config)
            if not self.loop:
                return


def _packed(frame: Int16[np.ndarray, "1 loop tx rx sample 2"], config: RadarConfig) -> bytes:
    return encode(frame, config).astype("<i2", copy=False).tobytes()


def _alike(first: object, second: object) -> bool:
    if isinstance(first, tuple) and isinstance(second, tuple):
        return len(first) == len(second) and all(map(_alike, first, second))
    return isclose(first, second, rel_tol=1e-9)
