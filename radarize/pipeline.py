"""From raw I/Q to trajectory and map: the whole of Radarize, frame batch by frame batch."""

import time as clock
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from radarize.mapping.scans import BEARINGS
from radarize.methods import CLASSICAL, Inputs, Weights
from radarize.published.chain import Chain
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

#: Frames a batch: enough to vectorise over, few enough to stay in cache.
BATCH = 16


class Pipeline:
    """Radar SLAM as a stream: push raw frames, then read trajectory and map. Memory grows with the path, not the data.

    Lost chirps weigh nothing. Frames that are lost as a whole, or nearly, or silent, leave a gap, over which odometry
    takes motion to change evenly; `frames` says which ones are left.

    Args:
        config: radar configuration.
        scans: how scans are made, a key of `radarize.methods.SCANS`.
        odometry: where motion comes from, a key of `radarize.methods.ODOMETRY`.
        weights: of the networks; the shipped ones if None.
        recording: with other sensors' streams, for methods that use them.
        chain: what else makes odometry and scans of samples, then in place of all these.
        beside: a pipeline of the same radar, weights and recording that is pushed the same batches, the same objects:
            whatever both need is made once.

    Raises:
        InputError: an unknown method, or networks that do not fit the radar.
    """

    def __init__(
        self,
        config: RadarConfig,
        scans: str = CLASSICAL["scans"],
        odometry: str = CLASSICAL["odometry"],
        weights: Weights | None = None,
        recording: Recording | None = None,
        chain: Chain | None = None,
        beside: "Pipeline | None" = None,
    ):
        self.config, self.scans, self.chain = config, scans, chain
        self._inputs = (
            beside._inputs.beside(scans) if beside else Inputs(config, weights, scans, recording, self._stage)
        )
        self.heatmaps = self._inputs.heatmaps
        self.odometry, self.scanner = self._inputs.odometry(odometry), self._inputs.scanner()
        self.slam = Slam(SlamConfig.preset("radar"))
        self.pushed = self.lost = 0
        self.frames: list[np.ndarray] = []  # numbers of those used, counted as pushed
        self.times: list[np.ndarray] = []
        self.poses: list[np.ndarray] = []
        self.velocities: list[np.ndarray] = []
        self.velocity_covariances: list[np.ndarray] = []
        self.step_covariances: list[np.ndarray] = []
        self.ranges: list[np.ndarray] = []
        self.stage_seconds: dict[str, float] = defaultdict(float)

    def push(self, adc: np.ndarray, times: np.ndarray, valid: np.ndarray | None = None) -> None:
        """Process the next frames.

        Args:
            adc: int16 (frame, loop, tx, rx, sample, iq).
            times: (frame,) stamps, s.
            valid: (frame, loop, tx), False where a chirp was lost.
        """
        numbers = self.pushed + np.arange(len(times))
        self.pushed += len(times)
        if self.chain:
            used = numbers % self.chain.stride == 0
            track, ranges = self.chain.push(adc, times, self._stage)
        else:
            used, spectrum = self._inputs.frames(adc, valid)
            self.lost += int(np.count_nonzero(~used))
            if spectrum is None:
                return
            track = self.odometry.follow(spectrum, times[used], self._stage)
            ranges = self.scanner.scan(spectrum)
        self.frames.append(numbers[used])
        with self._stage("slam"):
            for instant, pose, spread, scan in zip(track.time, track.pose, track.covariance, ranges, strict=True):
                self.slam.add_odometry(instant, pose, spread)
                self.slam.add_scan(instant, BEARINGS, scan)
        self.times.append(track.time)
        self.poses.append(track.pose)
        self.velocities.append(track.velocity)
        self.velocity_covariances.append(track.velocity_covariance)
        self.step_covariances.append(track.covariance)
        self.ranges.append(ranges.astype(np.float32))

    def finish(self) -> None:
        """Close the last loops and optimise."""
        with self._stage("slam"):
            self.slam.finish()

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        """Time a step; what steps within it take is theirs."""
        start, others = clock.perf_counter(), sum(self.stage_seconds.values())
        yield
        within = sum(self.stage_seconds.values()) - others
        self.stage_seconds[name] += clock.perf_counter() - start - within
