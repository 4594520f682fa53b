"""What a recording is made of: data sets that grow, and data sets written once."""

from dataclasses import dataclass

import numpy as np

FORMAT = 1


@dataclass(frozen=True)
class Stream:
    """A data set that grows with the recording, one row per appended item.

    Attributes:
        shape: shape of one row.
        dtype: numpy type.
        unit: SI unit, or what the columns are.
        about: one sentence for the reader.
        clock: data set that says which instant (float, s) or frame (integer) each row belongs to; ``radar/time``: the
            rows are the frames.
        labels: what the values 0, 1, ... stand for, where they stand for something.
    """

    shape: tuple[int, ...]
    dtype: str
    unit: str
    about: str
    clock: str = "radar/time"
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Product:
    """A data set written once when the recording is opened (a floor plan, a label axis)."""

    data: np.ndarray
    unit: str
    about: str
