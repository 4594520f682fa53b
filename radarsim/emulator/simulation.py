"""Source of a virtual radar's samples: a walk through a scene, simulated while it is sent."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from radarize.io.errors import InputError
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig
from radarize.radar.presets import load_config
from radarsim.emulator.source import packed
from radarsim.motion.walk import Walk
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.world.description import find
from radarsim.world.scene import Scene


@dataclass(frozen=True)
class Simulation:
    """Walk through a scene, simulated at the configuration that the radar receives; as `radarsim simulate` makes it.

    Attributes:
        scene, seed: as for `simulate`.
        walk: motion of the radar.
        radar: preset or configuration file expected over the UART.
        loop: restart the walk at its end.
    """

    scene: str
    walk: Walk = Walk()
    seed: int = 0
    radar: str = "radarize"
    loop: bool = False

    def expected(self) -> RadarConfig:
        """Configuration of the preset or file; InputError if the scene does not exist."""
        find(self.scene)
        return load_config(self.radar)[0]

    def check(self, config: RadarConfig) -> None:
        """Accept every configuration of the chip for which the walk has at least one frame.

        Raises:
            InputError: the walk is shorter than a frame.
        """
        duration = self.walk.duration
        if duration is not None and config.frames_within(duration) < 1:
            raise InputError(f"duration is {duration:g} s, expected at least one frame of {config.frame_period} s")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """Yield frames, simulated in batches."""
        # Commands name no board, only a band; use the requested board if its chip has that band.
        board = self.expected().board
        if load_board(board).chip == load_board(config.board).chip:
            config = config.changed("radar", board=board)
        world = Scene.load(self.scene)
        scenario = Scenario(world, self.walk.through(world, self.seed), config, seed=self.seed)
        while True:
            for times in np.split(scenario.times, range(TOGETHER, len(scenario.times), TOGETHER)):
                for frame in scenario.frames(times).samples:
                    yield packed(frame[None], config)
            if not self.loop:
                return
