"""Antenna snapshots of strong range-Doppler cells: the raw value of each virtual channel.

Nothing is assumed about the array: channels are neither calibrated nor sorted, and the delays between
transmitters remain. Estimates of the array, the order of transmitters or the phases from the echoes of a moving radar
start from these cells.
"""

from typing import NamedTuple

import numpy as np
import scipy.fft
from jaxtyping import Bool, Complex64, Float, Int, Int16

from radarize.radar.config import RadarConfig

#: m: smallest range, beyond the transmitters' leakage.
NEAREST = 0.25
#: Smallest power of a cell relative to the frame's median.
_THRESHOLD = 20.0
_TINY = 1e-20


class Snapshots(NamedTuple):
    """Strong cells of some frames.

    Attributes:
        frame: index of the frame.
        range: m, without `RadarConfig.range_bias`, interpolated between bins.
        speed: m/s, closing, within the unambiguous span, interpolated between bins.
        power: relative to the frame's median cell.
        channels: I/Q at the cell, transmitters and receivers in the order of the samples.
    """

    frame: Int[np.ndarray, "cell"]
    range: Float[np.ndarray, "cell"]
    speed: Float[np.ndarray, "cell"]
    power: Float[np.ndarray, "cell"]
    channels: Complex64[np.ndarray, "cell tx rx"]

    def where(self, chosen: np.ndarray) -> "Snapshots":
        """Select some of the cells."""
        return Snapshots(*(each[chosen] for each in self))


def find_snapshots(
    samples: Int16[np.ndarray, "frame loop tx rx sample 2"],
    config: RadarConfig,
    valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    most: int = 48,
) -> Snapshots:
    """Find the strongest local maxima over range and Doppler, `most` per frame.

    Args:
        samples: raw I/Q.
        config: radar configuration; only its timing and range bins are used.
        valid: False where a chirp was lost; such a chirp has zero weight.
    """
    found = [_of_frame(k, one, config, None if valid is None else valid[k], most) for k, one in enumerate(samples)] or [
        _of_frame(0, np.zeros(config.frame_shape, np.int16), config, None, most)
    ]
    return Snapshots(*map(np.concatenate, zip(*found, strict=True)))


def range_doppler(
    samples: Int16[np.ndarray, "loop tx rx sample 2"], valid: Bool[np.ndarray, "loop tx"] | None = None
) -> Complex64[np.ndarray, "doppler tx rx range"]:
    """Spectrum of one frame, closing speeds ascending, zero in the middle; Hann over samples, Hamming over loops."""
    signal = np.ascontiguousarray(samples, np.float32).view(np.complex64)[..., 0]
    loops, count = signal.shape[0], signal.shape[-1]
    window, over_loops = np.hanning(count).astype(np.float32), np.hamming(loops).astype(np.float32)
    profile = scipy.fft.fft(signal * (window / window.sum()), axis=-1)
    weights = np.broadcast_to(over_loops[:, None], signal.shape[:2])
    if valid is not None:
        weights = weights * valid
    profile *= (weights / np.maximum(weights.sum(axis=0), _TINY)).astype(np.float32)[..., None, None]
    return np.fft.fftshift(scipy.fft.ifft(profile, axis=0, norm="forward"), axes=0)


def _of_frame(
    number: int, samples: np.ndarray, config: RadarConfig, valid: np.ndarray | None, most: int
) -> tuple[np.ndarray, ...]:
    spectrum = range_doppler(samples, valid)
    power = np.square(np.abs(spectrum)).sum(axis=(1, 2))  # (doppler, range)
    first = int(np.searchsorted(config.ranges, NEAREST))
    level = max(float(np.median(power[:, first:])), _TINY)
    strong = power > _THRESHOLD * level
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        strong &= power >= np.roll(power, step, axis=axis)
    strong[:, : max(first, 1)] = strong[:, -2:] = False
    d, r = np.nonzero(strong)
    order = np.argsort(-power[d, r], kind="stable")[:most]
    d, r = d[order], r[order]
    bins, logs = len(power), np.log(power + _TINY)
    faster = _between(logs[(d - 1) % bins, r], logs[d, r], logs[(d + 1) % bins, r])
    farther = _between(logs[d, r - 1], logs[d, r], logs[d, r + 1])
    return (
        np.full(len(d), number), config.range_resolution * (r + farther),
        config.velocity_resolution * (d + faster - bins // 2), power[d, r] / level, spectrum[d, :, :, r],
    )  # fmt: skip


def _between(left: np.ndarray, middle: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Offset in bins of the vertices of parabolas through three logarithms each."""
    bend = np.minimum(left - 2 * middle + right, -1e-9)
    return np.clip(0.5 * (left - right) / bend, -0.5, 0.5)
