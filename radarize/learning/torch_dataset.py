"""Recordings for a training loop of one's own."""

from collections.abc import Sequence
from pathlib import Path

from radarize.learning.training.dataset import FrameDataset


def torch_dataset(
    data: str | Path,
    *,
    features: Sequence[str] = ("range_azimuth", "doppler_azimuth"),
    labels: Sequence[str] = ("velocity",),
    split: str | None = None,
    part: str = "train",
    window: int = 1,
    stride: int = 1,
) -> FrameDataset:
    """Read a folder of recordings as a torch `Dataset`, lazily, from any number of processes.

    Args:
        data: folder of recordings, such as ``radarsim dataset`` makes.
        features: maps of `radarize.signal.maps.MAPS` (float32, dB), ``adc`` (int16 samples), ``time`` (s).
        labels: truth: ``velocity`` (m/s), ``turn`` (rad from frame to frame), ``pose``, ``scan`` (m), ``depth`` (mm),
            ``occupancy``.
        split, part: of the data set's specification: such as ``random-0`` and ``train``, ``validation`` or ``test``;
            all recordings without a split.
        window: frames of an item.
        stride: frames from one item's start to the next one's.

    Returns:
        Items are dictionaries of tensors by name, the window's frames along the first axis.

    Raises:
        InputError: no recordings, an unknown name or split, or truth that a recording lacks.

    Example:
        >>> dataset = rz.torch_dataset(".", features=["doppler_azimuth"], labels=["velocity"])
        >>> {name: tuple(tensor.shape) for name, tensor in dataset[0].items()}
        {'doppler_azimuth': (1, 32, 80), 'velocity': (1, 3)}
    """
    return FrameDataset(data, split, part, (*features, *labels), window, stride=stride)
