"""From raw I/Q to trajectory and map: the whole of Radarize, batch by batch.

    samples -> Batch (spectra, maps, points, made when asked for) -> odometry -> SLAM -> trajectory
                                                                  -> scans    ->      -> map

Methods of odometry and of scans come from `radarize.pipeline.methods`; what a batch gave is a `Result`, which goes to a
sink: a run's folder, the live page, or memory.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float, Float32, Int

from radarize.io.stopwatch import Stopwatch, stage
from radarize.odometry.integration import Track
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS
from radarize.signal.disturbance import Flaws
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig


class OdometryEstimator(Protocol):
    """Odometry of a stream of frames."""

    def update(self, batch: Batch) -> Track:
        """Poses of the next frames, or of those of them that it uses. Scans of the batch are in `Batch.ranges`."""
        ...


class ScanExtractor(Protocol):
    """Scans of a stream of frames."""

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Ranges of the next frames on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is seen."""
        ...


@dataclass(frozen=True)
class Result:
    """What a batch gave.

    Attributes:
        frames: numbers of its frames as the radar sent them, see `radarize.radar.numbering`.
        track: of these frames: poses, covariances, velocities.
        ranges: scans on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is seen.
        flaws: of these frames; None where nobody looked.
    """

    frames: Int[np.ndarray, "frame"]
    track: Track
    ranges: Float32[np.ndarray, "frame bearing"]
    flaws: Flaws | None = None


class Pipeline:
    """Radar SLAM as a stream: push batches, then read trajectory and map off `slam`. Memory grows with the way that is
    covered, not with the data.

    Args:
        odometry, extractor: methods.
        slam: settings of the back end.
        endless: without trajectory, and memory grows with the ground that is covered; see `Slam`.

    Attributes:
        slam: the back end.
        stopwatch: of its stages.
        seconds: of each stage by name, so far.
    """

    def __init__(
        self,
        odometry: OdometryEstimator,
        extractor: ScanExtractor,
        slam: SlamConfig | None = None,
        endless: bool = False,
    ):
        self.odometry, self.extractor = odometry, extractor
        self.slam = Slam(slam or SlamConfig.preset("radar"), endless)
        self.stopwatch = Stopwatch()

    @property
    def seconds(self) -> dict[str, float]:
        return self.stopwatch.seconds

    def push(self, batch: Batch) -> Result:
        """Follow the sensor over the next frames, and map what it saw."""
        with self.stopwatch.running():
            batch.ranges = self.extractor.extract(batch)
            track = self.odometry.update(batch)
            used = np.isin(batch.centers, track.time)
            ranges = batch.ranges[used]
            with stage("slam"):
                for time, pose, errors, scan in zip(track.time, track.pose, track.errors, ranges, strict=True):
                    self.slam.add_odometry(time, pose, errors)
                    self.slam.add_scan(time, BEARINGS, scan)
            flaws = None if batch.flaws is None else batch.flaws.of(used)
            return Result(batch.numbers[used], track, ranges.astype(np.float32), flaws)

    def run(self, batches: Iterable[Batch]) -> Iterator[Result]:
        """Push all of a stream's batches that hold frames, then finish."""
        yield from (self.push(batch) for batch in batches if len(batch))
        self.finish()

    def finish(self) -> None:
        """Close the last loops and optimise."""
        with self.stopwatch.running(), stage("slam"):
            self.slam.finish()
