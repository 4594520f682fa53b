"""Data sets of benchmarks: folders of recordings, and the test recordings of each split."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from radarize.evaluation.benchmark.choices import NamedWalk
from radarize.evaluation.benchmark.results import Data
from radarize.io.errors import InputError
from radarize.io.jsonfile import read_json
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig

#: Platforms in the order of the tables.
PLATFORMS = ("handheld", "cart", "robot")


@dataclass(frozen=True)
class Case:
    """A recording of a data set.

    Attributes:
        name: name that is unique in the data set.
        path: file of the recording.
        building, platform: names; "-" if unknown.
        frames: number of frames.
        config: radar configuration.
        attributes: all attributes of the recording.
        walk: scene, seed and length of the path.
    """

    name: str
    path: Path = field(compare=False)
    building: str = field(compare=False)
    platform: str = field(compare=False)
    frames: int = field(compare=False)
    config: RadarConfig = field(compare=False, repr=False)
    attributes: dict = field(compare=False, repr=False)
    walk: NamedWalk = field(compare=False, repr=False)

    @classmethod
    def of(cls, path: Path, name: str | None = None) -> "Case":
        """Read the attributes of a recording; its name is by default that of the file.

        Raises:
            InputError: not a recording.
        """
        with Recording(path) as recording:
            about, frames, config = recording.attributes, len(recording), recording.config
            walk = NamedWalk.of(recording)
        building = str(about.get("scene", "-")).split("_")[0]
        return cls(name or path.stem, path, building, str(about.get("platform", "-")), frames, config, about, walk)


@dataclass(frozen=True)
class DataSet:
    """A folder of recordings, made by `radarsim dataset` or otherwise.

    Attributes:
        folder: path of the folder.
        cases: the recordings, sorted by name.
        index: content of ``dataset.json``; empty without one.
    """

    folder: Path
    cases: tuple[Case, ...]
    index: dict = field(repr=False)

    @classmethod
    def load(cls, folder: str | Path) -> "DataSet":
        """Read the recordings of a folder, or, if it has none, of its subfolders.

        Raises:
            InputError: no recordings, or a file that is not a recording.
        """
        folder = Path(folder)
        paths = sorted(folder.glob("*.h5")) or sorted(folder.glob("*/*.h5"))
        if not paths:
            raise InputError(f"{folder}: holds no recordings, expected *.h5, or bags such as cart_csl_upper_0.bag")
        return cls(
            folder,
            tuple(Case.of(path, str(path.relative_to(folder).with_suffix(""))) for path in paths),
            read_json(folder / "dataset.json"),
        )

    def data(self, cases: Iterable[Case]) -> Data:
        """Return the description of some of the recordings, for a page of results."""
        about = self.index.get("specification", {})
        name = about.get("name", self.folder.resolve().name)
        return Data(name, tuple(case.walk for case in cases), about.get("seed"))

    def splits(self, kind: str) -> dict[str, list[Case]]:
        """Return the test recordings of each split of a kind.

        Args:
            kind: ``random``, ``platform`` (other platforms than in training) or ``building`` (each held out once).

        Returns:
            Recordings by name of the split. In a data set without such splits (see ``trainable``): all recordings for
            ``random``, all but the handheld ones for ``platform``, those of each building for ``building``.
        """
        if self.trainable(kind):
            by_name = {case.name: case for case in self.cases}
            found = {
                name: [by_name[member] for member in self.index["splits"][name].get("test", ()) if member in by_name]
                for name in self._names(kind)
            }
        elif kind == "platform":
            found = {"platform": [case for case in self.cases if case.platform not in ("handheld", "-")]}
        elif kind == "building":
            buildings = sorted({case.building for case in self.cases} - {"-"})
            found = {f"building-{name}": [case for case in self.cases if case.building == name] for name in buildings}
        else:
            found = {"all": list(self.cases)}
        return {name: cases for name, cases in found.items() if cases}

    def trainable(self, kind: str) -> bool:
        """Return whether the data set has splits of a kind into training and test recordings."""
        return bool(self._names(kind))

    def _names(self, kind: str) -> list[str]:
        """Return names of the splits of a kind; split NAME of kind random or building becomes NAME-0, NAME-A, ..."""
        kinds = {
            name: about.get("kind") for name, about in self.index.get("specification", {}).get("splits", {}).items()
        }
        return [
            name for name in self.index.get("splits", {}) if kinds.get(name, kinds.get(name.rpartition("-")[0])) == kind
        ]


def groups(cases: Iterable[Case]) -> dict[str, list[Case]]:
    """Group recordings by platform, then by building, then all."""
    cases = list(cases)
    names = [*PLATFORMS, *dict.fromkeys(case.building for case in cases)]
    found = {name: [case for case in cases if name in (case.platform, case.building)] for name in names if name != "-"}
    return {name: members for name, members in found.items() if members} | {"all": cases}
