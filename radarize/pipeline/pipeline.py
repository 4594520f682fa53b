"""The whole of Radarize, from raw I/Q to trajectory and map, batch by batch.

    samples -> Batch (spectra, maps, points, computed on demand) -> odometry -> SLAM -> trajectory
                                                                 -> scans    ->      -> map

Methods of odometry and of scans come from `radarize.pipeline.methods`. Each batch gives a `Result`, which is written to
a run folder, shown on the live page, or kept in memory.
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
    """Interface of odometry on a stream of frames."""

    def update(self, batch: Batch) -> Track:
        """Return poses of the next frames, or of those of them that it uses. `Batch.ranges` has the scans of the
        batch."""
        ...


class ScanExtractor(Protocol):
    """Interface of scans on a stream of frames."""

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Return ranges of the next frames on `radarize.signal.bearings.BEARINGS`, m; inf: no echo."""
        ...


@dataclass(frozen=True)
class Result:
    """Result of a batch.

    Attributes:
        frames: frame numbers as the radar sent them, see `radarize.radar.numbering`.
        track: poses, covariances and velocities of these frames.
        ranges: scans on `radarize.signal.bearings.BEARINGS`, m; inf: no echo.
        flaws: disturbed chirps and receivers of these frames; None if not computed.
    """

    frames: Int[np.ndarray, "frame"]
    track: Track
    ranges: Float32[np.ndarray, "frame bearing"]
    flaws: Flaws | None = None


class Pipeline:
    """Radar SLAM on a stream: push batches, then read trajectory and map from `slam`. Memory grows with the length of
    the path, not with the number of frames.

    Args:
        odometry, extractor: methods of odometry and of scans.
        slam: settings of the back end.
        endless: keep no trajectory, so that memory grows with the mapped area only; see `Slam`.

    Attributes:
        slam: the back end.
        stopwatch: measures the time of each stage.
        seconds: time of each stage so far, by name, s.
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
        """Estimate the motion of the sensor over the next frames, and add their scans to the map."""
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
        """Push all batches of a stream that have frames, then finish."""
        yield from (self.push(batch) for batch in batches if len(batch))
        self.finish()

    def finish(self) -> None:
        """Search the last loop closures and optimise."""
        with self.stopwatch.running(), stage("slam"):
            self.slam.finish()
