"""Rows in parallel arrays: what a batch has many of, for numpy and for compiled kernels."""

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np


@dataclass(frozen=True)
class Table:
    """Arrays of the same length; `rows[index]` takes some of them, `columns` is what compiled kernels take.

    Attributes:
        SHARED: fields that belong to all rows together.
    """

    Columns: ClassVar[type[Any]]
    SHARED: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls):
        # numba tells named tuples by their names alone
        columns = [name for name in cls.__annotations__ if name not in cls.SHARED]
        cls.Columns = namedtuple(f"{cls.__name__}Columns", columns)
        cls.Columns.__module__, cls.Columns.__qualname__ = cls.__module__, f"{cls.__qualname__}.Columns"

    @property
    def columns(self) -> tuple:
        """The arrays by name, as a named tuple."""
        return self.Columns(*(getattr(self, name) for name in self.Columns._fields))

    def __len__(self) -> int:
        return len(self.columns[0])

    def __getitem__(self, index: slice | np.ndarray) -> Self:
        shared = (getattr(self, name) for name in self.SHARED)
        if isinstance(index, slice):
            return type(self)(*(column[index] for column in self.columns), *shared)
        index = np.asarray(index)
        rows = np.flatnonzero(index) if index.dtype == bool else index  # once for all columns
        return type(self)(*(column.take(rows, axis=0) for column in self.columns), *shared)

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """All rows of several tables; nothing is shared."""
        some = [part for part in parts if len(part)]
        if len(some) == 1 and not cls.SHARED:
            return some[0]
        return cls(*(np.concatenate(column) for column in zip(*(part.columns for part in parts), strict=True)))


Rows = TypeVar("Rows", bound=Table)


def filled(room: Callable[[int], Rows], fill: Callable[[Rows], int], size: int) -> Rows:
    """A table of as many rows as there turn out to be.

    Args:
        room: makes a table of so many rows.
        fill: writes as many rows as fit; returns how many there are.
        size: rows to begin with.
    """
    while True:
        found = room(size)
        count = fill(found)
        if count <= size:
            return found[:count]
        size = count
