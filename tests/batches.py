"""Batches for tests: from samples, from a spectrum, or cut out of a stream."""

from collections.abc import Iterator

import numpy as np
import torch

from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch, Preprocessor, Signal


def batch(radar: RadarConfig | Signal, adc: np.ndarray, times: np.ndarray, valid: np.ndarray | None = None) -> Batch:
    """Batch from samples."""
    return Batch(radar if isinstance(radar, Signal) else Signal(radar), adc, np.asarray(times, float), valid)


def of_spectrum(signal: Signal, spectrum: torch.Tensor, times: np.ndarray) -> Batch:
    """Batch from a spectrum without samples, or from a substitute."""
    found = Batch(signal, np.zeros((len(spectrum), 0, 0, 0, 0, 2), np.int16), np.asarray(times, float))
    found.folded = found.spectrum = spectrum
    if not isinstance(spectrum, torch.Tensor):
        found.aliases = np.zeros((len(spectrum), signal.radar.loops), int)
    return found


def of_scans(signal: Signal, scans: np.ndarray, times: np.ndarray) -> Batch:
    """Batch from extracted scans."""
    found = Batch(signal, None, times)
    found.ranges = scans
    return found


def parts(signal: Signal, spectrum: torch.Tensor, times: np.ndarray, cuts: list[int]) -> list[Batch]:
    """Spectra of a stream, in parts."""
    stamps = np.split(np.asarray(times, float), np.cumsum(cuts)[:-1])
    return [of_spectrum(signal, *part) for part in zip(spectrum.split(cuts), stamps, strict=True)]


def stream(
    preprocessor: Preprocessor, adc: np.ndarray, times: np.ndarray, valid: np.ndarray | None = None, size: int = 16
) -> Iterator[Batch]:
    """Stream of a radar, in batches of frames."""
    for start in range(0, len(adc), size):
        part = slice(start, start + size)
        yield preprocessor.process(adc[part], times[part], None if valid is None else valid[part])
