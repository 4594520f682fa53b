"""Every propagation path above the noise: apparent position, power, path type and mechanism."""

import numpy as np

from radarize.io.recording import Stream
from radarsim.propagation.burst import BurstClock
from radarsim.propagation.path_types import PathType
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor

#: Columns of a path, in this order.
COLUMNS = (
    "range", "azimuth", "elevation", "closing_speed", "power_db", "type", "bounces", "through", "blocked", "level"
)  # fmt: skip
#: Power relative to that of the weakest paths that are found (`FrontEnd.weakest`): the noise of a burst.
_OVER_WEAKEST = 10.0


class TruePaths(Sensor):
    """Rows of `COLUMNS`: m, rad, rad, m/s, dB of received over transmitted power, and columns of `paths.Paths`."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        kinds = ", ".join(f"{kind} {kind.name.lower()}" for kind in PathType)
        about = f"{' '.join(COLUMNS)} of paths above the noise, apparent places in the sensor frame; types: {kinds}"
        self.streams = {
            "truth/path_frame": Stream((), "i4", "", "number of the frame that a path belongs to", "truth/path_frame"),
            "truth/paths": Stream((len(COLUMNS),), "f4", "m, rad, m/s, dB", about, "truth/path_frame"),
        }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Paths of all frames, one after another."""
        scenario, middles = self.scenario, frames.middles
        poses = scenario.motion.position(middles), scenario.motion.rotation(middles).as_matrix()
        half, least = BurstClock.of(scenario.config).half, scenario.board.weakest * np.sqrt(_OVER_WEAKEST)
        found = []
        for paths, lengths, types, position, rotation in zip(
            frames.paths, frames.lengths, frames.types, *poses, strict=True
        ):
            rows = np.abs(paths.amplitude) > least
            paths, lengths, types = paths[rows], lengths[rows], types[rows]
            middle = lengths[..., 0] - 2 * scenario.config.range_bias
            place = (scenario.path_types.apparent(paths, middle, position, rotation) - position) @ rotation
            x, y, z = place.T
            speed = -lengths[..., 1].mean(axis=1) / half / 2
            power = 20 * np.log10(np.maximum(np.abs(paths.amplitude), 1e-30))
            found.append(np.column_stack([
                middle.mean(axis=1) / 2, np.arctan2(y, x), np.arctan2(z, np.hypot(x, y)), speed, power, types,
                paths.bounces, paths.through, paths.blocked, paths.level,
            ]))  # fmt: skip
        numbers = np.repeat(np.arange(len(found)), [len(rows) for rows in found])
        return {"truth/path_frame": numbers.astype(np.int32), "truth/paths": np.concatenate(found).astype(np.float32)}
