"""Compact summary of all frames of a recording, to check their order."""

from typing import NamedTuple
from zlib import crc32

import numpy as np
import scipy.fft
from jaxtyping import Bool, Float32, Int, Int16

from radarize.radar.config import RadarConfig
from radarize.signal.snapshots import NEAREST

#: The summary uses every N-th loop of a frame.
_EVERY = 8


class Sequence(NamedTuple):
    """Summary of all frames.

    Attributes:
        digest: CRC-32 of the samples.
        silent: whether all samples are zero.
        looks: logarithm of power over range (beyond leakage) and beams, minus its mean over all frames, normalised to
            norm 1.
    """

    digest: Int[np.ndarray, "frame"]
    silent: Bool[np.ndarray, "frame"]
    looks: Float32[np.ndarray, "frame cell"]


class Summary:
    """Summarises frames as they are read: 0.2 ms and 0.7 kB per frame.

    Args:
        config: configuration of the radar.
    """

    def __init__(self, config: RadarConfig):
        self._first = int(np.searchsorted(config.ranges, NEAREST))
        self._window = np.hanning(config.samples).astype(np.float32)
        self._digests: list[int] = []
        self._silent: list[bool] = []
        self._looks: list[np.ndarray] = []

    def add(self, frames: Int16[np.ndarray, "frame loop tx rx sample 2"]) -> None:
        """Add the next frames."""
        self._digests += [crc32(frame.tobytes()) for frame in frames]
        self._silent += [not frame.any() for frame in frames]
        some = np.ascontiguousarray(frames[:, ::_EVERY], np.float32).view(np.complex64)[..., 0]
        beams = scipy.fft.fft(scipy.fft.fft(some * self._window, axis=-1)[..., self._first : -2], axis=3)
        # The median over chirps is not affected by interference and lost chirps.
        power = np.median(np.square(np.abs(beams)), axis=(1, 2))  # (frame, beam, range)
        self._looks.append(np.log(power.reshape(len(frames), -1) + np.float32(1e-3)).astype(np.float16))

    @property
    def sequence(self) -> Sequence:
        """Summary of all frames so far."""
        looks = np.concatenate(self._looks).astype(np.float32) if self._looks else np.zeros((0, 1), np.float32)
        silent = np.array(self._silent, bool)
        looks = looks - (looks[~silent].mean(axis=0) if (~silent).any() else 0)
        looks /= np.maximum(np.linalg.norm(looks, axis=1, keepdims=True), 1e-12)
        return Sequence(np.array(self._digests, int), silent, looks.astype(np.float32))
