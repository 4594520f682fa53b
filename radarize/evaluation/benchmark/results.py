"""Results of benchmarks: tables as JSON and Markdown, with their provenance.

Every page states its data (recordings, simulated or real, members of tuning sets), its networks, and how it was made
(command, version, commit, machine). Results without them are refused.
"""

import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from pydantic import TypeAdapter

from radarize import __version__
from radarize.evaluation.benchmark.choices import NamedWalk, tuned_on
from radarize.evaluation.benchmark.table import Table
from radarize.io.errors import explained
from radarize.io.recording import Recording
from radarize.io.replacing import write_whole
from radarize.learning.nets.weights import header_of, read


@dataclass(frozen=True)
class Data:
    """Data that results are of.

    Attributes:
        name: name of the data set, or a description.
        walks: recordings; empty if results are not of walks.
        seed: seed of the data set; None if unknown.
    """

    name: str
    walks: tuple[NamedWalk, ...]
    seed: int | None = None

    @classmethod
    def of(cls, name: str, paths: Sequence[Path], seed: int | None = None) -> "Data":
        """Describe recordings.

        Raises:
            InputError: an unreadable recording.
        """
        walks = []
        for path in paths:
            with Recording(path) as recording:
                walks.append(NamedWalk.of(recording))
        return cls(name, tuple(walks), seed)

    @property
    def sentence(self) -> str:
        """Name, number, path length, simulated or real, seed, and members of tuning sets."""
        parts = [self.name, f"{len(self.walks)} recordings" if self.walks else "no recordings"]
        if self.walks:
            known = [walk.metres for walk in self.walks if walk.metres is not None]
            without = len(self.walks) - len(known)
            parts.append(f"{sum(known):.0f} m walked" + (f" ({without} without true poses)" if without else ""))
            simulated = sum(walk.simulated for walk in self.walks)
            kinds = {len(self.walks): "all simulated", 0: "all real"}
            parts.append(kinds.get(simulated, f"{simulated} simulated, {len(self.walks) - simulated} real"))
        parts += [] if self.seed is None else [f"seed {self.seed}"]
        return "; ".join([", ".join(parts), *tuned_on(self.walks)])


@dataclass(frozen=True)
class UsedNetwork:
    """A trained network that was used for results.

    Attributes:
        kind: kind of network.
        parameters: number of parameters.
        data, split: data set and split of the training.
        epochs: epochs of the training.
        width: channels of the first stage; 0 if unknown.
        hours: duration of the training data, h; 0 if unknown.
    """

    kind: str
    parameters: int
    data: str
    split: str | None
    epochs: int
    width: int = 0
    hours: float = 0.0

    @classmethod
    def of(cls, path: Path) -> "UsedNetwork":
        """Read the header of a file of weights.

        Raises:
            InputError: unreadable.
        """
        tensors, _ = read(path)
        # The file contains the running statistics of normalisation layers, too.
        counted = [v.numel() for name, v in tensors.items() if "running_" not in name and "num_batches" not in name]
        about = header_of(path)
        return cls(about.kind, sum(counted), about.data or "-", about.split, about.epochs, about.width, about.hours)

    @property
    def sentence(self) -> str:
        split = "" if self.split is None else f" ({self.split})"
        width = f", width {self.width}" if self.width else ""
        hours = f"{self.hours:.2g} h of " if self.hours else ""
        size = f"{self.kind}{width}, {self.parameters:,} parameters"
        return f"{size}, trained on {hours}{self.data}{split}, {self.epochs} epochs"


@cache
def machine() -> dict[str, str]:
    """Return processor, cores and software versions, as of the first call, because sources may change during a run."""
    try:
        model = next(x for x in Path("/proc/cpuinfo").read_text().splitlines() if x.startswith("model name"))
        model = model.split(":", 1)[1].strip()
    except (OSError, StopIteration):
        model = platform.processor()
    return {
        "processor": model,
        "cores": str(len(os.sched_getaffinity(0))),
        "python": platform.python_version(),
        "version": __version__,
        "commit": commit(Path(__file__)),
    }


def commit(source: Path) -> str:
    """Return the commit of the checkout that a source file is in, and whether files differ from it."""

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(("git", *words), cwd=root, capture_output=True, text=True, check=False)
        except OSError:
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    root = source.parent
    if not git("ls-files", "--error-unmatch", source.name):  # installed, possibly inside another project's checkout
        return "not a checkout"
    top = git("rev-parse", "--show-toplevel")
    assert top is not None  # git has just answered
    root = Path(top)
    changed = git("status", "--porcelain", "--", ":!benchmarks/results", ":!docs", ":!*.md")
    assert changed is not None
    state = f"{len(changed.splitlines())} files changed since" if changed else "clean"
    return f"{git('rev-parse', '--short', 'HEAD')} ({state})"


def command(name: str, words: Sequence[str] | None = None) -> str:
    """Return a program's name with its arguments, by default those of this process, without absolute folders."""
    words = [
        Path(word).name if Path(word).is_absolute() else word for word in (sys.argv[1:] if words is None else words)
    ]
    return " ".join([name, shlex.join(words)]) if words else name


@dataclass(frozen=True)
class Results:
    """Tables with their provenance.

    Attributes:
        title: heading.
        tables: one or more tables.
        data: data of the results.
        networks: networks that were used.
        command: command that makes the results.
        notes: notes on all tables.
        machine: result of `machine`.

    Raises:
        ValueError: one of them is missing.
    """

    title: str
    tables: list[Table]
    data: Data
    networks: tuple[UsedNetwork, ...]
    command: str
    notes: list[str] = field(default_factory=list)
    machine: dict[str, str] = field(default_factory=machine)

    def __post_init__(self):
        for name, kind in (("data", Data), ("networks", tuple), ("command", str)):
            if not isinstance(getattr(self, name), kind):
                raise ValueError(f"{self.title}: has no {name}, expected results with their provenance")
        if missing := {"processor", "cores", "version", "commit"} - self.machine.keys():
            raise ValueError(f"{self.title}: its machine lacks {', '.join(sorted(missing))}")

    @property
    def facts(self) -> dict[str, str]:
        """Provenance of the results, by name."""
        beside = dict.fromkeys(each for table in self.tables for each in table.beside)
        return {
            "Data": self.data.sentence,
            **({"Beside": "; ".join(each.sentence for each in beside)} if beside else {}),
            "Networks": "; ".join(network.sentence for network in self.networks) or "none",
            "Command": f"`{self.command}`",
            "Machine": ", ".join(f"{name} {value}" for name, value in self.machine.items()),
        }

    def markdown(self) -> str:
        """Return the results as Markdown; a single table with the title of the page has no heading of its own."""
        lone = len(self.tables) == 1 and self.tables[0].title == self.title
        parts = [table.markdown(1 if lone else 2) for table in self.tables]
        parts = parts if lone else [f"# {self.title}\n", *parts]
        facts = [f"**{name}**: {words}." for name, words in self.facts.items()]
        return "\n".join([*parts, "".join(f"- {line}\n" for line in (*self.notes, *facts))])

    @classmethod
    def read(cls, path: Path) -> "Results":
        """Read a JSON file of `write`.

        Raises:
            InputError: an unreadable file, or another layout.
        """
        with explained(f"{path}: is no page of results as this version writes them", OSError, ValueError):
            return TypeAdapter(cls).validate_json(path.read_bytes())

    def write(self, folder: Path, name: str) -> Path:
        """Write NAME.json and NAME.md, and return the path of the latter.

        Raises:
            InputError: they cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.save(folder / f"{name}.json")
        return write_whole(folder / f"{name}.md", self.markdown())

    def save(self, path: Path) -> Path:
        """Write the results as JSON.

        Raises:
            InputError: it cannot be written.
        """
        return write_whole(path, TypeAdapter(Results).dump_json(self, indent=1).decode() + "\n")
