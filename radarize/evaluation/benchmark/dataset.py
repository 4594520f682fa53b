"""What methods are compared on: a folder of recordings, and which of them test in each split."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from radarize.evaluation.benchmark.choices import NamedWalk
from radarize.evaluation.benchmark.results import Data
from radarize.io.errors import InputError
from radarize.io.jsonfile import read_json
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig

#: Platforms in the order of tables, where a data set has them.
PLATFORMS = ("handheld", "cart", "robot")


@dataclass(frozen=True)
class Case:
    """A recording and what it is of.

    Attributes:
        name: unique in its data set.
        path: file.
        building, platform: "-" where the recording does not say.
        frames: how many it has.
        config: of its radar.
        attributes: all that it says of itself.
        walk: of the sensor.
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
        """Look into a recording, called like its file unless told.

        Raises:
            InputError: it is none.
        """
        with Recording(path) as recording:
            about, frames, config = recording.attributes, len(recording), recording.config
            walk = NamedWalk.of(recording)
        building = str(about.get("scene", "-")).split("_")[0]
        return cls(name or path.stem, path, building, str(about.get("platform", "-")), frames, config, about, walk)


@dataclass(frozen=True)
class DataSet:
    """A folder of recordings, as `radarsim dataset` makes them or any other.

    Attributes:
        folder: where.
        cases: the recordings, by name.
        index: its ``dataset.json``; empty if it has none.
    """

    folder: Path
    cases: tuple[Case, ...]
    index: dict = field(repr=False)

    @classmethod
    def load(cls, folder: str | Path) -> "DataSet":
        """Look into a folder; where it has no recordings itself, into the folders in it.

        Raises:
            InputError: no recordings, or a file that is none.
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
        """What figures of some of the recordings are of."""
        about = self.index.get("specification", {})
        name = about.get("name", self.folder.resolve().name)
        return Data(name, tuple(case.walk for case in cases), about.get("seed"))

    def splits(self, kind: str) -> dict[str, list[Case]]:
        """Recordings that test in each split of a kind.

        Args:
            kind: ``random``, ``platform`` (tested on others than trained on) or ``building`` (each held out once).

        Returns:
            Name of a split to recordings. Without such splits, what tests is the same: all recordings for ``random``,
            all but the handheld ones for ``platform``, those of each building for ``building``; ``trainable`` tells.
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
        """Whether the data set says what trains and what tests in splits of a kind."""
        return bool(self._names(kind))

    def _names(self, kind: str) -> list[str]:
        """Splits of a kind; a specification's split NAME of kinds random and building stands for NAME-0, NAME-A ..."""
        kinds = {
            name: about.get("kind") for name, about in self.index.get("specification", {}).get("splits", {}).items()
        }
        return [
            name for name in self.index.get("splits", {}) if kinds.get(name, kinds.get(name.rpartition("-")[0])) == kind
        ]


def groups(cases: Iterable[Case]) -> dict[str, list[Case]]:
    """Recordings by platform, then by building, then all."""
    cases = list(cases)
    names = [*PLATFORMS, *dict.fromkeys(case.building for case in cases)]
    found = {name: [case for case in cases if name in (case.platform, case.building)] for name in names if name != "-"}
    return {name: members for name, members in found.items() if members} | {"all": cases}
