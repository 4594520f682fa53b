"""A walk through a synthetic world, whose radar and lidar count frames from 0 but have different clocks."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from radarize.baselines.walks.walks import Walk
from radarize.io.pose import inverse, transform
from radarize.signal import polar

#: Points of the world, m.
POINTS = np.random.default_rng(0).uniform(-12, 12, (150, 2))


@dataclass(frozen=True)
class MadeUp(Walk):
    """A walk with turns: the radar's frame k has the time of the lidar's frame `first + rate * k`."""

    first: float = 0.0
    rate: float = 1.0
    speed: float = 1.0

    def pose(self, instant: float) -> tuple[float, float, float]:
        """Return x, y (m), yaw (rad) at a time in frames of the lidar."""
        time = 0.05 * self.speed * instant
        return 0.5 * time - 5, 2 * np.sin(0.3 * time), 0.6 * np.sin(0.5 * time)

    def seen(self, instant: float, columns: int, farther: float) -> np.ndarray:
        """Return the polar cells that contain points, at a time in frames of the lidar."""
        x, y = transform(inverse(np.array(self.pose(instant))), POINTS).T
        distance, azimuth = np.hypot(x, y) + farther, np.degrees(np.arctan2(y, x))
        inside = (distance < polar.REACH) & (np.abs(azimuth) < 89)
        found = np.zeros((polar.ROWS, columns), bool)
        row = np.searchsorted(polar.RANGES, distance[inside])
        found[row, ((azimuth[inside] + 90) / 180 * columns).astype(int)] = True
        return found

    def radar(self, frame: int) -> np.ndarray:
        return 255 * self.seen(self.first + self.rate * frame, polar.COLUMNS, 0.25).astype(np.uint8)

    def lidar(self, frame: int) -> np.ndarray:
        return self.seen(frame, polar.BEAMS, 0.0)

    def write(self, data: Path) -> Path:
        """Write the walk as a test walk of a data set."""
        for kind, picture in (("radar", self.radar), ("lidar", lambda frame: 255 * self.lidar(frame).astype(np.uint8))):
            (data / "test" / kind).mkdir(parents=True)
            for frame in range(self.frames):
                Image.fromarray(picture(frame)).save(data / f"test/{kind}/{kind[0].upper()}_{self.number}_{frame}.png")
        return data
