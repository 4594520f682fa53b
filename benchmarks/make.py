"""Make the pages of results that are listed in `pages.yaml`.

    python -m benchmarks.make                 # or `make results`; python -m benchmarks.make walks scans: these pages
    python -m benchmarks.make --smoke         # a short trial of every part, in build/smoke; its figures are meaningless

Recordings are made first, then the parts of each page, each in a separate process; then the page is written from its
parts. If it is interrupted, the same command continues: a part that was made at this commit by the same command is
kept. A part without its data is left out, and listed on its page.
"""

import argparse
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from benchmarks.results import PARTS, SHARED
from radarize.evaluation.benchmark.results import Results, commit
from radarize.io.console import progress
from radarize.io.errors import InputError
from radarize.io.replacing import write_whole
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification
from radarsim.world.importers import import_scene

HERE = Path(__file__).parent
ROOT = HERE.parent
#: Lidar logs by the name of the building that is made from them.
PLANS = {name: SHARED / "radish" / f"{name}-corrected.log.gz" for name in ("intel", "orebro")}
#: Short trial: recordings of a data set, and their duration, s.
FEW, SHORT = 2, 2.0
PAGES: dict[str, dict[str, Any]] = yaml.safe_load((HERE / "pages.yaml").read_text())


@dataclass(frozen=True)
class Place:
    """Folders and options.

    Attributes:
        parts: folder of the parts; pages are written to its parent.
        work: folder of recordings and runs.
        radarhd: ``dataset_5`` of a clone of RadarHD's repository.
        smoke: whether it is a short trial.
        workers: number of processes.
        ray: address of a Ray cluster to use instead, for recordings and `radarize benchmark`.
    """

    parts: Path
    work: Path
    radarhd: Path
    smoke: bool
    workers: int | None
    ray: str | None

    @property
    def spread(self) -> list[str]:
        """Options of commands with several processes."""
        return ["--ray", self.ray] if self.ray else ["--workers", str(self.workers)] if self.workers else []


@dataclass(frozen=True)
class Part:
    """A part of a page: its name, and its entry in `pages.yaml`."""

    name: str
    about: dict[str, Any]

    def make(self, place: Place) -> str:
        """Make the part, unless it is up to date; return a sentence if its data is missing.

        Raises:
            InputError: its command fails.
        """
        if self.about.get("needs") == "radarhd" and not place.radarhd.is_dir():
            return f"Left out: {self.name}, because there is no clone of RadarHD's repository (--radarhd)."
        data = [recordings(name, place) for name in self.sets()]
        benchmark, words = self.about.get("benchmark"), self._words(place)
        if benchmark is None:
            command = [sys.executable, "-m", f"benchmarks.{self.name}", *words, "--out", str(place.parts)]
        else:
            folder = place.radarhd if benchmark == "real" else common(data)
            # Benchmarks of the same data share their runs.
            out = place.work / "tables" / self.about.get("data", self.name).rstrip("/")
            command = [sys.executable, "-m", "radarize.cli", "benchmark", benchmark, "--data", str(folder)]
            command += ["--out", str(out), *words, *place.spread]
        if self._made(command, place):
            return ""
        if subprocess.run(command, cwd=ROOT).returncode:
            raise InputError(f"{self.name}: {shlex.join(command)} failed with the error above")
        if benchmark is not None:
            self._take(benchmark, out, place)
        write_whole(self._stamp(place), self._state(command) + "\n")
        return ""

    def read(self, place: Place) -> Results | None:
        """Read the results of the part; None if it does not exist."""
        path = place.parts / f"{self.name}.json"
        return Results.read(path) if path.is_file() else None

    def sets(self) -> list[str]:
        """Return the data sets that the part reads; for a folder, all of its specifications."""
        name = self.about.get("data") or self.about.get("simulated")
        if name is None or not name.endswith("/"):
            return [name] if name else []
        return sorted(f"{name}{path.stem}" for path in (ROOT / "scenes" / "datasets" / name).glob("*.yaml"))

    def _words(self, place: Place) -> list[str]:
        words = shlex.split(self.about.get("words", "").format(data=place.work / "data"))
        if self.about.get("needs") == "radarhd" and "benchmark" not in self.about:
            words += ["--data", str(place.radarhd)]
        return words + (shlex.split(self.about.get("smoke", "")) if place.smoke else [])

    def _state(self, command: list[str]) -> str:
        return f"{commit(HERE / 'make.py')} {shlex.join(command)}"

    def _stamp(self, place: Place) -> Path:
        place.work.mkdir(parents=True, exist_ok=True)
        return place.work / f"{self.name}.made"

    def _made(self, command: list[str], place: Place) -> bool:
        stamp = self._stamp(place)
        there = stamp.is_file() and (place.parts / f"{self.name}.json").is_file()
        return there and stamp.read_text().strip() == self._state(command)

    def _take(self, benchmark: str, out: Path, place: Place) -> None:
        """Copy the results of `radarize benchmark`, with the picture."""
        results = Results.read(out / f"{benchmark}.json")
        place.parts.mkdir(parents=True, exist_ok=True)
        if (picture := out / f"{benchmark}.png").is_file():
            shutil.copy(picture, place.parts / f"{self.name}.png")
        shown = f"]({place.parts.name}/{self.name}.png)"
        results.notes[:] = [note.replace(f"]({benchmark}.png)", shown) for note in results.notes]
        results.save(place.parts / f"{self.name}.json")


def common(folders: list[Path]) -> Path:
    """Return the folder of a data set, or the common folder of several."""
    return folders[0] if len(folders) == 1 else folders[0].parent


def data_file(name: str) -> Path:
    """Return the file of a data set, in this folder or in scenes/datasets."""
    return next(path for folder in (HERE, ROOT / "scenes" / "datasets") if (path := folder / f"{name}.yaml").is_file())


def recordings(name: str, place: Place) -> Path:
    """Make the missing recordings of a data set, or a few short ones for a short trial; return their folder."""
    folder, plans = place.work / "data" / name, place.work / "plans"
    plans.mkdir(parents=True, exist_ok=True)
    source = data_file(name)
    text = source.read_text()
    for plan, log in PLANS.items():
        if f"{plan}.yaml" in text and not (plans / f"{plan}.yaml").is_file():
            import_scene(log, plans)
    for beside in source.parent.glob("*.cfg"):
        shutil.copy(beside, plans)
    path = write_whole(plans / f"{name.replace('/', '-')}.yaml", shortened(text) if place.smoke else text)
    with progress(f"recordings of {name}") as report:
        make(Specification.load(path), folder, workers=place.workers, ray=place.ray, progress=report)
    return folder


def shortened(specification: str) -> str:
    """Reduce a specification to a few short recordings."""
    about = yaml.safe_load(specification)
    about["recordings"] = [each | {"duration": SHORT, "count": 1} for each in about["recordings"][:FEW]]
    for each in about["recordings"]:
        if "floors" in each:
            each["floors"] = each["floors"][:1]
    return yaml.safe_dump(about, sort_keys=False)


def page(name: str, parts: dict[str, Results], missing: list[str]) -> str:
    """Return the text of a page: its question, and the tables of each part with their provenance."""
    about = PAGES[name]
    lines = [f"# {about['title']}", "", about["asks"], ""]
    for results in parts.values():
        lone = len(results.tables) == 1 and results.tables[0].title == results.title
        lines += [] if lone else [f"## {results.title}", ""]
        lines += [table.markdown(2 if lone else 3) for table in results.tables]
        facts = [f"**{fact}**: {words}." for fact, words in results.facts.items()]
        lines += [f"- {line}" for line in (*results.notes, *facts)] + [""]
    return "\n".join([*lines, *missing]).rstrip() + "\n"


def write(name: str, place: Place, missing: list[str]) -> Path:
    """Write a page from its existing parts."""
    parts = {part: Part(part, about).read(place) for part, about in PAGES[name]["parts"].items()}
    there = {part: results for part, results in parts.items() if results is not None}
    return write_whole(place.parts.parent / f"{name}.md", page(name, there, missing))


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("pages", nargs="*", metavar="PAGE", help=", ".join(PAGES))
    words.add_argument("--smoke", action="store_true", help="a short trial")
    words.add_argument("--work", type=Path, help="folder of recordings and runs; build/results or build/smoke")
    words.add_argument("--radarhd", type=Path, default=Path("RadarHD/dataset_5"), help="data set in RadarHD's clone")
    words.add_argument("--workers", type=int, help="number of processes; one per core by default")
    words.add_argument("--ray", help="address of a Ray cluster to use instead")
    words.add_argument("--write", action="store_true", help="only write pages from the existing parts")
    given = words.parse_args()
    if unknown := [name for name in given.pages if name not in PAGES]:
        words.error(f"page is {unknown[0]!r}, expected some of: {', '.join(PAGES)}")
    state = commit(HERE / "make.py")
    if not (given.smoke or given.write or state.endswith("(clean)")):
        raise SystemExit(f"benchmarks.make: the checkout is at {state}, expected a clean one: pages name their commit")
    work = (given.work or ROOT / "build" / ("smoke" if given.smoke else "results")).resolve()
    parts = work / "pages" / "parts" if given.smoke else PARTS
    place = Place(parts, work, given.radarhd.resolve(), given.smoke, given.workers, given.ray)
    for name in given.pages or PAGES:
        try:
            listed = [Part(part, about) for part, about in PAGES[name]["parts"].items()]
            missing = [] if given.write else [why for part in listed if (why := part.make(place))]
        except InputError as error:
            raise SystemExit(f"benchmarks.make: {error}") from error
        print(write(name, place, missing), flush=True)


if __name__ == "__main__":
    main()
