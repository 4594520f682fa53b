"""Array of rows that grows at its end."""

import numpy as np
from jaxtyping import Float


class Rows:
    """An array that grows at its end; its capacity doubles when it is full.

    Args:
        shape: of a row.
    """

    def __init__(self, *shape: int):
        self._buffer, self._count = np.zeros((64, *shape)), 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Float[np.ndarray, "..."] | float) -> None:
        """Append a row."""
        if self._count == len(self._buffer):
            self._buffer = np.concatenate([self._buffer, np.zeros_like(self._buffer)])
        self._buffer[self._count] = row
        self._count += 1

    def drop(self, first: int, end: int) -> None:
        """Remove the rows from `first` up to `end`."""
        remaining = self._count - max(end - first, 0)
        self._buffer[first:remaining] = self.values[max(end, first) :]
        self._count = remaining

    @property
    def values(self) -> Float[np.ndarray, "row ..."]:
        """All rows, as a view."""
        return self._buffer[: self._count]
