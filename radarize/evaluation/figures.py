"""What a figure is called, and where it stands in what `radarize.evaluation` found."""

from collections.abc import Mapping
from typing import Any, NamedTuple

#: What stands where there is no figure.
NONE = "-"


class Figure(NamedTuple):
    """A figure: words, where it stands (keys with dots), unit and factor, format, meaning."""

    words: str
    path: str
    unit: str = ""
    factor: float = 1
    form: str = ".3g"
    meaning: str = ""

    @property
    def title(self) -> str:
        """Words and unit."""
        return f"{self.words}, {self.unit}"

    def text(self, metrics: Mapping[str, object], unit: bool = True) -> str:
        """Value and unit; metrics are nested."""
        value: Any = metrics
        for key in self.path.split("."):
            value = (value or {}).get(key)
        return NONE if value is None else f"{self.factor * value:{self.form}} {self.unit * unit}".strip()
