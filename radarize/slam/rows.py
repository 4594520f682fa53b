"""Rows of numbers that a session adds to one by one, packed."""

import numpy as np
from jaxtyping import Float


class Rows:
    """An array that grows at its end; its room doubles when it is full.

    Args:
        shape: of a row.
    """

    def __init__(self, *shape: int):
        self._room, self._count = np.zeros((64, *shape)), 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Float[np.ndarray, "..."] | float) -> None:
        """Add a row."""
        if self._count == len(self._room):
            self._room = np.concatenate([self._room, np.zeros_like(self._room)])
        self._room[self._count] = row
        self._count += 1

    def drop(self, first: int, end: int) -> None:
        """Forget the rows from `first` up to `end`."""
        left = self._count - max(end - first, 0)
        self._room[first:left] = self.values[max(end, first) :]
        self._count = left

    @property
    def values(self) -> Float[np.ndarray, "row ..."]:
        """All rows, to read and to write."""
        return self._room[: self._count]
