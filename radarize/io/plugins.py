"""Extensions that packages add by entry points: methods, trainings, formats, benchmarks."""

from collections.abc import Iterator, MutableMapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Generic, TypeVar, cast

from radarize.io.errors import InputError

Part = TypeVar("Part")


class Plugins(MutableMapping[str, Part], Generic[Part]):
    """Extensions by name: the entry points of a group, each imported at first use, and those added at run time.

    Args:
        group: group of entry points, in the ``pyproject.toml`` of any installed package.
        what: name of such an extension in errors.

    Example:
        >>> Plugins("radarize.scans", "scans").find("first-eco")
        Traceback (most recent call last):
        radarize.io.errors.InputError: scans is 'first-eco', expected one of cfar, elevation-aware, first-echo, ...
    """

    def __init__(self, group: str, what: str):
        self.group, self.what = group, what
        self._added: dict[str, Part] = {}

    @cached_property
    def _installed(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=self.group)}

    def find(self, name: str) -> Part:
        """Return an extension.

        Raises:
            InputError: no extension has this name, or its module cannot be imported.
        """
        if not self._installed and not self._added:
            raise InputError(f"{self.what} {name}: no {self.group} is installed, expected radarize installed by pip")
        if name not in self:
            raise InputError(f"{self.what} is {name!r}, expected one of {', '.join(self)}")
        return self[name]

    def __getitem__(self, name: str) -> Part:
        if name not in self._added:
            point = self._installed[name]
            try:
                self._added[name] = cast(Part, point.load())
            except (ImportError, AttributeError) as error:
                raise InputError(f"{self.what} {name}: {point.value} cannot be imported: {error}") from error
        return self._added[name]

    def __setitem__(self, name: str, part: Part) -> None:
        self._added[name] = part

    def __delitem__(self, name: str) -> None:
        del self._added[name]

    def __contains__(self, name: object) -> bool:
        return name in self._added or name in self._installed

    def __iter__(self) -> Iterator[str]:
        """Names of extensions that can be imported; folders of this package may be deleted."""
        there = {name for name, point in self._installed.items() if _exists(point.module)}
        return iter(sorted(there | self._added.keys()))

    def __len__(self) -> int:
        return len(list(iter(self)))


def _exists(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # a parent package is missing
        return False
