"""What is published of a comparison: tables as JSON and Markdown, and beside them all that tells what they are worth.

A page says by construction what its figures are of (data, walks, simulated or real, which of it helped to choose
settings), what networks they were taken with, and what made it (command, version, commit, machine): results without
that are refused.
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
from radarize.evaluation.benchmark.choices import NamedWalk, helped
from radarize.evaluation.benchmark.table import Table
from radarize.io.errors import explained
from radarize.io.recording import Recording
from radarize.io.replacing import write_whole
from radarize.learning.nets.weights import header_of, read


@dataclass(frozen=True)
class Data:
    """What figures are of.

    Attributes:
        name: of the data set, or what else it is in words.
        walks: recordings; none where figures are of no walks.
        seed: that all of it was drawn from; None if it does not say.
    """

    name: str
    walks: tuple[NamedWalk, ...]
    seed: int | None = None

    @classmethod
    def of(cls, name: str, paths: Sequence[Path], seed: int | None = None) -> "Data":
        """Of recordings.

        Raises:
            InputError: unreadable ones.
        """
        walks = []
        for path in paths:
            with Recording(path) as recording:
                walks.append(NamedWalk.of(recording))
        return cls(name, tuple(walks), seed)

    @property
    def sentence(self) -> str:
        """Name, n, path, simulated or real, seed, and what of it helped to choose settings."""
        parts = [self.name, f"{len(self.walks)} recordings" if self.walks else "no recordings"]
        if self.walks:
            known = [walk.metres for walk in self.walks if walk.metres is not None]
            without = len(self.walks) - len(known)
            parts.append(f"{sum(known):.0f} m walked" + (f" ({without} without true poses)" if without else ""))
            simulated = sum(walk.simulated for walk in self.walks)
            kinds = {len(self.walks): "all simulated", 0: "all real"}
            parts.append(kinds.get(simulated, f"{simulated} simulated, {len(self.walks) - simulated} real"))
        parts += [] if self.seed is None else [f"seed {self.seed}"]
        return "; ".join([", ".join(parts), *helped(self.walks)])


@dataclass(frozen=True)
class UsedNetwork:
    """A trained network that figures were taken with.

    Attributes:
        kind: of network.
        parameters: how many.
        data, split: that it was trained on; epochs: of the training.
        width: channels of its first stage; hours: of walks that it learned from; 0 where a page is older than that.
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
        """As a file of weights says.

        Raises:
            InputError: unreadable.
        """
        tensors, _ = read(path)
        # What normalisation counts while it is trained is in the file, too.
        counted = [v.numel() for name, v in tensors.items() if "running_" not in name and "num_batches" not in name]
        said = header_of(path)
        return cls(said.kind, sum(counted), said.data or "-", said.split, said.epochs, said.width, said.hours)

    @property
    def sentence(self) -> str:
        split = "" if self.split is None else f" ({self.split})"
        width = f", width {self.width}" if self.width else ""
        hours = f"{self.hours:.2g} h of " if self.hours else ""
        size = f"{self.kind}{width}, {self.parameters:,} parameters"
        return f"{size}, trained on {hours}{self.data}{split}, {self.epochs} epochs"


@cache
def machine() -> dict[str, str]:
    """Processor, cores and software that figures are taken with; of the first call, for sources may change later."""
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
    """Of the checkout that a source file is of, and whether its sources are those of the commit."""

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(("git", *words), cwd=root, capture_output=True, text=True, check=False)
        except OSError:
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    root = source.parent
    if not git("ls-files", "--error-unmatch", source.name):  # installed, perhaps below another project's checkout
        return "not a checkout"
    top = git("rev-parse", "--show-toplevel")
    assert top is not None  # git has just answered
    root = Path(top)
    changed = git("status", "--porcelain", "--", ":!benchmarks/results", ":!docs", ":!*.md")
    assert changed is not None
    state = f"{len(changed.splitlines())} files changed since" if changed else "clean"
    return f"{git('rev-parse', '--short', 'HEAD')} ({state})"


def command(name: str, words: Sequence[str] | None = None) -> str:
    """A program's name with its arguments, those of this process unless told; folders are the machine's business, not
    the reader's."""
    words = [
        Path(word).name if Path(word).is_absolute() else word for word in (sys.argv[1:] if words is None else words)
    ]
    return " ".join([name, shlex.join(words)]) if words else name


@dataclass(frozen=True)
class Results:
    """Tables and how they came about.

    Attributes:
        title: heading.
        tables: one or several.
        data: what they are of.
        networks: that they were taken with.
        command: that makes them.
        notes: what holds for all of them.
        machine: see `machine`.

    Raises:
        ValueError: anything of that is missing.
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
                raise ValueError(f"{self.title}: has no {name}, expected a page that says what it is of")
        if missing := {"processor", "cores", "version", "commit"} - self.machine.keys():
            raise ValueError(f"{self.title}: its machine lacks {', '.join(sorted(missing))}")

    @property
    def facts(self) -> dict[str, str]:
        """What the figures are worth, by name."""
        beside = dict.fromkeys(each for table in self.tables for each in table.beside)
        return {
            "Data": self.data.sentence,
            **({"Beside": "; ".join(each.sentence for each in beside)} if beside else {}),
            "Networks": "; ".join(network.sentence for network in self.networks) or "none",
            "Command": f"`{self.command}`",
            "Machine": ", ".join(f"{name} {value}" for name, value in self.machine.items()),
        }

    def markdown(self) -> str:
        """The whole as text; a single table of the same title has no heading of its own."""
        lone = len(self.tables) == 1 and self.tables[0].title == self.title
        parts = [table.markdown(1 if lone else 2) for table in self.tables]
        parts = parts if lone else [f"# {self.title}\n", *parts]
        facts = [f"**{name}**: {words}." for name, words in self.facts.items()]
        return "\n".join([*parts, "".join(f"- {line}\n" for line in (*self.notes, *facts))])

    @classmethod
    def read(cls, path: Path) -> "Results":
        """Of what `write` wrote.

        Raises:
            InputError: unreadable, or of another layout.
        """
        with explained(f"{path}: is no page of results as this version writes them", OSError, ValueError):
            return TypeAdapter(cls).validate_json(path.read_bytes())

    def write(self, folder: Path, name: str) -> Path:
        """Write NAME.json and NAME.md, and return the latter's path.

        Raises:
            InputError: they cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.save(folder / f"{name}.json")
        return write_whole(folder / f"{name}.md", self.markdown())

    def save(self, path: Path) -> Path:
        """Write all of it as JSON.

        Raises:
            InputError: it cannot be written.
        """
        return write_whole(path, TypeAdapter(Results).dump_json(self, indent=1).decode() + "\n")
