"""Data that the tests of a check examine: some frames of a recording, and products computed on first access."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import scipy.fft
from jaxtyping import Bool, Complex64, Float, Int, Int16

from radarize.io.errors import InputError
from radarize.io.recording import Clip
from radarize.io.trajectory import Trajectory
from radarize.odometry.inertial import Imu
from radarize.pipeline.check.finding import Correction, NotObservable
from radarize.pipeline.check.motion import Motions, find_motions
from radarize.pipeline.check.planewaves import PlaneWaves, Reading, fit_plane_waves
from radarize.pipeline.check.summary import Sequence, Summary
from radarize.pipeline.check.tracks import Tracks, find_tracks
from radarize.radar.config import RadarConfig
from radarize.signal.snapshots import Snapshots, find_snapshots

#: Frames that are examined: number of places, evenly over the recording, and of consecutive frames at each.
PLACES, RUN = 16, 4
#: The spectra use every N-th loop of a frame; frames read at a time.
_EVERY, _BATCH = 8, 16

Frames = Int16[np.ndarray, "frame loop tx rx sample 2"]


class Evidence:
    """Data of a recording, or of the first frames of a stream, for the tests of a check.

    Args:
        config: configuration of the radar.
        times: starts of all frames, s.
        valid: per chirp, False where samples were lost.
        read: returns the frames start to stop - 1 when called with (start, stop).
        truth: true poses, if known.
        imu: IMU, if there is one.
        numbers: numbers of the frames in the recording; from 0 if None.

    Attributes:
        places: number of places at which frames are examined.
    """

    places = PLACES

    def __init__(
        self,
        config: RadarConfig,
        times: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"],
        read: Callable[[int, int], Frames],
        truth: Trajectory | None = None,
        imu: Imu | None = None,
        numbers: Int[np.ndarray, "frame"] | None = None,
    ):
        self.numbers = np.arange(len(times)) if numbers is None else numbers
        self.config, self.times, self.valid, self.truth, self.imu = config, times, valid, truth, imu
        self._read = read

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def of(cls, frames: Clip) -> "Evidence":
        """Return the evidence of frames of a recording, with its truth and its IMU."""
        start, step = frames.span.start, frames.numbers.step
        adc = frames.recording.adc

        def read(first: int, last: int) -> Frames:
            return adc(start + first * step, min(start + (last - 1) * step + 1, frames.span.stop))[::step]

        try:
            imu = Imu.of(frames.recording) if frames.recording.has("imu/time") else None
        except InputError:  # an unusable IMU counts as none
            imu = None
        return cls(frames.config, frames.times, frames.valid, read, frames.truth, imu, np.asarray(frames.numbers))

    def corrected(self, correction: Correction) -> "Evidence":
        """Return the evidence of the corrected recording."""
        config, read, change = correction.config or self.config, self._read, correction.samples
        times, valid, numbers = self.times, self.valid, self.numbers
        if (order := correction.order) is not None:
            valid, numbers = valid[order], numbers[order]
            times = times[: len(order)] if correction.keeps_stamps else times[order]
        if correction.period is not None:
            times = times[0] + correction.period * np.arange(len(times))

        def corrected_frames(first: int, last: int) -> Frames:
            if order is None:
                samples = read(first, last)
            else:
                samples = np.concatenate([read(k, k + 1) for k in order[first:last]])
            return samples if change is None else change(samples)

        corrected = Evidence(config, times, valid, corrected_frames, self.truth, self.imu, numbers)
        corrected.places = self.places
        return corrected

    def read(self, start: int, stop: int) -> Frames:
        """Read frames start to stop - 1."""
        return self._read(start, stop)

    # --- frames that are examined --------- ---------------------------------------------------------------------------
    @cached_property
    def chosen(self) -> Int[np.ndarray, "frame"]:
        """Numbers of the examined frames, without lost and silent ones."""
        starts = np.unique(np.linspace(0, max(len(self) - RUN, 0), self.places).astype(int))
        near = np.unique((starts[:, None] + np.arange(RUN)).clip(max=len(self) - 1))
        return near[self.valid[near].mean(axis=(1, 2)) > 0.5]

    @cached_property
    def samples(self) -> Frames:
        """Samples of the examined frames."""
        if not len(self.chosen):
            return np.zeros((0, *self.config.frame_shape), np.int16)
        runs = np.split(self.chosen, np.flatnonzero(np.diff(self.chosen) > 1) + 1)
        return np.concatenate([self._read(run[0], run[-1] + 1) for run in runs])

    @cached_property
    def profiles(self) -> Complex64[np.ndarray, "frame loop tx rx range"]:
        """Range spectra (Hann, a beat of amplitude 1 has amplitude 1) of some loops of the examined frames."""
        some = np.ascontiguousarray(self.samples[:: max(1, RUN // 2), ::_EVERY], np.float32)
        window = np.hanning(self.config.samples).astype(np.float32)
        return scipy.fft.fft(some.view(np.complex64)[..., 0] * (window / window.sum()), axis=-1)

    @cached_property
    def levels(self) -> Float[np.ndarray, "range"]:
        """Power per range bin, counts^2: median over loops and frames, mean over channels."""
        power = np.square(np.abs(self.profiles)).mean(axis=(2, 3))
        return np.median(power.reshape(-1, power.shape[-1]), axis=0)

    @cached_property
    def cells(self) -> Snapshots:
        """Echoes of the examined frames; `Snapshots.frame` has their numbers."""
        found = find_snapshots(self.samples, self.config, self.valid[self.chosen])
        return found._replace(frame=self.chosen[found.frame])

    @cached_property
    def reading(self) -> Reading:
        """Antennas of the channels as configured."""
        return Reading.of(self.config)

    @cached_property
    def waves(self) -> PlaneWaves:
        """Echoes as plane waves over the configured antennas."""
        return fit_plane_waves(self.cells, self.reading)

    @cached_property
    def tracks(self) -> Tracks:
        """Echoes that are found again in the next frames."""
        return find_tracks(self.cells, self.waves if np.prod(self.config.frame_shape[1:3]) >= 4 else None)

    @cached_property
    def motions(self) -> Motions:
        """Motion of the radar at the examined places.

        Raises:
            NotObservable: there are too few channels for directions.
        """
        if np.prod(self.config.frame_shape[1:3]) < 4:
            raise NotObservable("there are too few channels for directions")
        return find_motions(self.cells, self.waves, self.tracks, self.times)

    # --- all frames --------------------------------------------------------------------------------------------------
    @cached_property
    def sequence(self) -> Sequence:
        """Summary of all frames; set from outside if they were read already."""
        summary = Summary(self.config)
        for start in range(0, len(self), _BATCH):
            summary.add(self._read(start, min(start + _BATCH, len(self))))
        return summary.sequence
