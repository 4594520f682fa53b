"""Torch data sets of recordings, for a user's own training loop."""

from collections.abc import Sequence
from pathlib import Path

from radarize.learning.training.dataset import FrameDataset


def torch_dataset(
    data: str | Path | Sequence[str | Path],
    *,
    features: Sequence[str] = ("range_azimuth", "doppler_azimuth"),
    labels: Sequence[str] = ("velocity",),
    split: str | None = None,
    part: str = "train",
    window: int = 1,
    stride: int = 1,
    cache: bool = False,
) -> FrameDataset:
    """Read recordings as a torch `Dataset`, lazily, from any number of processes.

    Maps are in dB of squared ADC counts, at 80 azimuths from -59.25 to 59.25 deg to the left. The axes, and the scaling
    of the shipped networks, are described in `radarize.learning.training.dataset`; the result's `axes` has their
    values.

    Args:
        data: a recording, several, or a folder of them, such as from ``radarsim dataset``.
        features: maps of `radarize.signal.maps.MAPS` (float32, dB), ``adc`` (int16 samples), ``time`` (s, float64).
        labels: truth: ``velocity`` (m/s), ``turn`` (rad between frames), ``pose``, ``scan`` (m), ``depth`` (mm),
            ``occupancy``.
        split, part: split of the data set's specification, such as ``random-0``, and its part ``train``, ``validation``
            or ``test``; all recordings without a split.
        window: number of frames of an item.
        stride: frames between the starts of consecutive items.
        cache: keep computed maps in memory, in each worker process.

    Returns:
        A data set whose items are dictionaries of tensors by name, with the window's frames along the first axis.

    Raises:
        InputError: no recordings, an unknown name or split, or truth that a recording lacks.

    Example:
        >>> dataset = rz.torch_dataset("walk.h5", features=["doppler_azimuth"], labels=["velocity"], cache=True)
        >>> {name: tuple(tensor.shape) for name, tensor in dataset[0].items()}
        {'doppler_azimuth': (1, 32, 80), 'velocity': (1, 3)}
    """
    return FrameDataset(data, split, part, (*features, *labels), window, stride=stride, cache=cache)
