"""Tables of parallel arrays, for numpy and for compiled kernels."""

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np


@dataclass(frozen=True)
class Table:
    """Arrays of the same length; `rows[index]` selects rows, `columns` is the argument for compiled kernels.

    Attributes:
        SHARED: fields that belong to all rows together.
    """

    Columns: ClassVar[type[Any]]
    SHARED: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls):
        # numba distinguishes named tuples by their names only
        columns = [name for name in cls.__annotations__ if name not in cls.SHARED]
        cls.Columns = namedtuple(f"{cls.__name__}Columns", columns)
        cls.Columns.__module__, cls.Columns.__qualname__ = cls.__module__, f"{cls.__qualname__}.Columns"

    @property
    def columns(self) -> tuple:
        """Arrays by name, as a named tuple."""
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
    def zeros(cls, n: int) -> Self:
        """Rows of zeros, with the types and shapes of the columns' annotations."""
        kinds = [cls.__annotations__[name] for name in cls.Columns._fields]
        shapes = [(n, *map(int, kind.dim_str.split()[1:])) for kind in kinds]
        return cls(*(np.zeros(s, kind.dtypes[-1].rstrip("_")) for s, kind in zip(shapes, kinds, strict=True)))

    @classmethod
    def from_rows(cls, rows: list[tuple]) -> Self:
        """Table of the values of each row, in the order of the columns."""
        return cls(*(np.array(column) for column in zip(*rows, strict=True))) if rows else cls.zeros(0)

    @classmethod
    def joined(cls, parts: list[Self]) -> Self:
        """Concatenate several tables."""
        some = [part for part in parts if len(part)]
        if len(some) == 1 and not cls.SHARED:
            return some[0]
        return cls(*(np.concatenate(column) for column in zip(*(part.columns for part in parts), strict=True)))


Rows = TypeVar("Rows", bound=Table)


def filled(table: type[Rows], fill: Callable[[Rows], int], size: int = 4096) -> Rows:
    """Build a table with a number of rows not known in advance.

    Args:
        table: its type.
        fill: function that writes as many rows as fit and returns their number.
        size: rows of the first attempt; if there are more, `fill` is called again.
    """
    while True:
        found = table.zeros(size)
        count = fill(found)
        if count <= size:
            return found[:count]
        size = count
