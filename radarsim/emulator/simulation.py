"""A walk through a scene as what the virtual radar sees, simulated as it goes."""

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
    """A walk through a scene, at whatever configuration the radar gets; as `radarsim simulate` makes it.

    Attributes:
        scene, seed: as for `simulate`.
        walk: how the radar goes.
        radar: preset or configuration file expected over the UART.
        loop: walk again, from the start, at the end.
    """

    scene: str
    walk: Walk = Walk()
    seed: int = 0
    radar: str = "radarize"
    loop: bool = False

    def expected(self) -> RadarConfig:
        """The preset's, or the file's; refuses a scene that is not there."""
        find(self.scene)
        return load_config(self.radar)[0]

    def check(self, config: RadarConfig) -> None:
        """Takes all that the chip can do, if the walk is long enough for a frame.

        Raises:
            InputError: it is not.
        """
        duration = self.walk.duration
        if duration is not None and config.frames_within(duration) < 1:
            raise InputError(f"duration is {duration:g} s, expected at least one frame of {config.frame_period} s")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """Simulated some at a time, as `simulate` does."""
        # Commands name no board, only a band: of its chip, the board is the one that was asked for.
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
