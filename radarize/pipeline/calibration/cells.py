"""Echoes of a walk: the peaks of each frame's range-Doppler map, each with a snapshot of all virtual antennas.

The channel errors are not corrected, since calibrating or checking a board measures them.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from numba import njit

from radarize.io.recording import Clip
from radarize.odometry.parabola import vertex
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch, Preprocessor, Signal
from radarize.signal.effort import together

#: Minimum ratio of a peak's power to the median cell's; maximum number of peaks per frame; minimum range, m, beyond
#: leakage and mount.
_THRESHOLD, _MOST, _NEAREST = 30.0, 120, 0.45


@dataclass(frozen=True)
class Cells:
    """Peaks of range-Doppler maps.

    Attributes:
        frame: (cell,) frame number, ascending; if every N-th frame is used, counted in these.
        time: (cell,) burst centre of the frame, s.
        range: (cell,) range, interpolated between bins, m; includes a range bias.
        speed: (cell,) closing speed, interpolated between bins, m/s.
        power: (cell,) ratio to the power of the frame's median cell.
        snapshot: (cell, antenna) amplitudes of the virtual antennas, flat (tx, rx), as if sampled at the same time;
            corrected for the signs of the board's receivers only.
    """

    frame: Int[np.ndarray, "cell"]
    time: Float[np.ndarray, "cell"]
    range: Float[np.ndarray, "cell"]
    speed: Float[np.ndarray, "cell"]
    power: Float[np.ndarray, "cell"]
    snapshot: Complex[np.ndarray, "cell antenna"]

    def __len__(self) -> int:
        return len(self.frame)

    def where(self, chosen: Bool[np.ndarray, "cell"] | Int[np.ndarray, "cell"]) -> "Cells":
        """Return some of the cells."""
        return Cells(*(getattr(self, field.name)[chosen] for field in fields(self)))


def uncalibrated(config: RadarConfig) -> RadarConfig:
    """Return the radar's configuration without channel calibration and range bias."""
    return config.model_copy(update={"channel_calibration": None, "range_bias": 0.0})


def cells_of(frames: Clip, progress: Callable[[int, int], None] = lambda done, total: None) -> Cells:
    """Find the peaks of all complete frames; `progress` is called with (frames done, frames in all)."""
    source, span = frames.recording, frames.span
    signal = Signal(uncalibrated(frames.config))
    every = frames.numbers.step
    preprocessor, size, found = Preprocessor(signal, every), together(source.config), []
    for start in range(span.start, span.stop, size):
        stop = min(start + size, span.stop)
        batch = preprocessor.process(source.adc(start, stop), source.times[start:stop], source.valid(start, stop))
        if len(batch):
            found.append(cells_of_batch(batch))
        progress(stop - span.start, len(span))
    cells = joined(found, len(signal.radar.tx) * len(signal.radar.rx))
    return replace(cells, frame=cells.frame // every)


def cells_of_batch(batch: Batch) -> Cells:
    """Find the peaks of a batch of frames; its radar should be `uncalibrated`."""
    heatmaps, config = batch.signal.heatmaps, batch.signal.radar
    spectrum = batch.spectrum.numpy()
    power = np.square(np.abs(spectrum)).sum(axis=3)
    first = max(int(np.searchsorted(heatmaps.ranges, _NEAREST)), 1)
    level = np.median(power[:, first:], axis=(1, 2)).clip(1e-12)
    place = _peaks(power, _THRESHOLD * level.astype(np.float32), first, _MOST)
    frame, near, bin_ = place.T
    over_range, over_doppler = _offsets(power, place)
    speed = heatmaps.velocities[bin_] + 2 * config.max_velocity * batch.aliases[frame, bin_]
    off = config.velocity_resolution * over_doppler
    # The phase of each slot's delay was corrected at the bin's speed; between bins the speed differs a little.
    delay = np.repeat(np.asarray(config.slot) * config.chirp_time, len(config.rx))
    turn = np.exp(4j * np.pi / config.wavelength * off[:, None] * delay)
    return Cells(
        batch.numbers[frame], batch.centers[frame], heatmaps.ranges[near] + config.range_resolution * over_range,
        speed + off, power[frame, near, bin_] / level[frame],
        (spectrum[frame, near, bin_] * turn).astype(np.complex64),
    )  # fmt: skip


def joined(parts: list[Cells], antennas: int) -> Cells:
    """Join the cells of consecutive batches."""
    if not parts:
        none = np.zeros(0)
        return Cells(np.zeros(0, int), none, none, none, none, np.zeros((0, antennas), np.complex64))
    return Cells(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Cells)))


@njit(cache=True)
def _peaks(power, threshold, first, most):
    """Return local maxima (frame, range, doppler) of maps, cyclic in Doppler; at most the strongest `most` per
    frame."""
    frames, ranges, bins = power.shape
    found = []
    for k in range(frames):
        here, strength = [], []
        for r in range(first, ranges - 1):
            for d in range(bins):
                p = power[k, r, d]
                if p < threshold[k]:
                    continue
                before, after = (d - 1) % bins, (d + 1) % bins
                around = max(power[k, r - 1, before], power[k, r - 1, d], power[k, r - 1, after])
                around = max(around, power[k, r + 1, before], power[k, r + 1, d], power[k, r + 1, after])
                if p > around and p > max(power[k, r, before], power[k, r, after]):
                    here.append((k, r, d))
                    strength.append(-p)
        for i in np.argsort(np.array(strength))[:most]:
            found.append(here[i])
    result = np.empty((len(found), 3), np.int64)
    for i, cell in enumerate(found):
        result[i] = cell
    return result


@njit(cache=True)
def _offsets(power, place):
    """Return offsets of peaks in bins over range and Doppler, by parabolas through the logarithms of three powers."""
    bins = power.shape[2]
    offsets = np.empty((2, len(place)))
    for i in range(len(place)):
        k, r, d = place[i]
        before, after = power[k, r, (d - 1) % bins], power[k, r, (d + 1) % bins]
        here = np.log(power[k, r, d])
        offsets[0, i] = vertex(np.log(power[k, r - 1, d] + 1e-30), here, np.log(power[k, r + 1, d] + 1e-30))
        offsets[1, i] = vertex(np.log(before + 1e-30), here, np.log(after + 1e-30))
    return offsets
