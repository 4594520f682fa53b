"""Metrics in tables: name, unit, and path in the results of `radarize.evaluation`."""

from collections.abc import Mapping
from typing import Any, NamedTuple

#: Text for a missing value.
NONE = "-"


class Figure(NamedTuple):
    """A metric: name, path of keys with dots, unit and factor to it, format, explanation."""

    words: str
    path: str
    unit: str = ""
    factor: float = 1
    form: str = ".3g"
    meaning: str = ""

    @property
    def title(self) -> str:
        """Name and unit."""
        return f"{self.words}, {self.unit}"

    def text(self, metrics: Mapping[str, object], unit: bool = True) -> str:
        """Format the value of the metric in nested results, with its unit."""
        value: Any = metrics
        for key in self.path.split("."):
            value = (value or {}).get(key)
        return NONE if value is None else f"{self.factor * value:{self.form}} {self.unit * unit}".strip()
