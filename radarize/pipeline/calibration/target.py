"""Calibration with a corner reflector at a known distance straight ahead of a radar that stands still.

The method is that of ``measureRangeBiasAndRxChanPhase`` in the SDK demo (mmWave SDK user's guide): the strongest echo
in a window around the distance gives the range bias, as measured minus true range, and its amplitudes in the channels
give the factors. They are compared with the echo of a point at that distance, so that directions are correct without
motion.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from radarize.io.errors import InputError
from radarize.io.recording import Clip
from radarize.odometry.parabola import vertex
from radarize.pipeline.calibration.cells import uncalibrated
from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Preprocessor, Signal

#: m, half width of the range window; maximum number of frames; minimum ratio of the reflector's power to that of the
#: median range, and to that of moving echoes at its range, Doppler sidelobes (-43 dB) excluded.
WINDOW, _FRAMES, _STRONG, _STILL = 0.5, 128, 1e3, 30.0


class Reflector(NamedTuple):
    """Range bias and channel factors, measured with a corner reflector.

    Attributes:
        factors: (antenna,) channel factors with a mean gain of 0 dB.
        error: (antenna, 2) standard errors of their gains (dB) and phases (rad).
        bias, bias_error: range bias and its standard error, m.
        frames: number of frames used.
    """

    factors: Complex[np.ndarray, "antenna"]
    error: Float[np.ndarray, "antenna 2"]
    bias: float
    bias_error: float
    frames: int


def measure(frames: Clip, distance: float) -> Reflector:
    """Measure range bias and channel factors with a reflector at a distance, m.

    Raises:
        InputError: no echo stands out there, the radar moves, or the distance is out of range.
    """
    config, path = uncalibrated(frames.config), frames.recording.path
    signal = Signal(config)
    ranges = signal.heatmaps.ranges
    near = np.flatnonzero(np.abs(ranges - distance) < WINDOW)
    near = near[(near > 0) & (near < len(ranges) - 1)]
    if not 0.3 < distance < config.max_range or not len(near):
        raise InputError(
            f"--target is {distance:g} m, expected between 0.3 and {config.max_range:.2f} m, the farthest range"
        )
    some = frames[:_FRAMES]
    batch = Preprocessor(signal).process(some.samples, some.times, some.valid)
    if not len(batch):
        raise InputError(f"{path}: all its frames are lost or silent, expected echoes of a reflector")
    spectrum = batch.folded.numpy()
    power = np.square(np.abs(spectrum)).sum(axis=3).mean(axis=0)  # (range, doppler)
    still = config.loops // 2
    at = int(near[power[near, still].argmax()])
    if power[at, still] < _STRONG * np.median(power[:, still]):
        raise InputError(
            f"{path}: no strong echo is within {WINDOW} m of {distance:g} m, expected a corner reflector there"
        )
    apart = np.abs(np.arange(config.loops) - still) > 3
    if power[at, apart].max(initial=0) * _STILL > power[at, still]:
        raise InputError(
            f"{path}: echoes at {ranges[at]:.2f} m move, expected a radar and a reflector that stand still"
        )
    levels = np.log(np.square(np.abs(spectrum[:, at - 1 : at + 2, still])).sum(axis=2))
    measured = ranges[at] + config.range_resolution * np.array([vertex(*level) for level in levels])
    each = spectrum[:, at, still] / _echo(config, distance)
    each = each / each.mean(axis=1, keepdims=True)
    factors = each.mean(axis=0)
    apart_by = np.log(each / factors)
    scatter = np.stack([20 / np.log(10) * apart_by.real, apart_by.imag], axis=-1).std(axis=0)
    count = max(len(each) - 1, 1)
    factors = factors / np.exp(np.log(np.abs(factors)).mean())
    bias = float(measured.mean()) - distance
    return Reflector(factors, scatter / np.sqrt(count), bias, float(measured.std() / np.sqrt(count)), len(each))


def _echo(config: RadarConfig, distance: float) -> Complex[np.ndarray, "antenna"]:
    """Return the phasors of a point straight ahead of the centre of the array, at a distance from there."""
    out, back = tx_positions(config), rx_positions(config)
    middle = (out.mean(axis=0) + back.mean(axis=0)) / 2
    point = middle + np.array([distance, 0.0, 0.0])
    path = np.linalg.norm(point - out, axis=1)[:, None] + np.linalg.norm(point - back, axis=1)
    return np.exp(2j * np.pi / config.wavelength * (path - 2 * distance)).ravel()  # a shorter path has less phase
