"""What is published of a comparison: tables as JSON and Markdown, with command, version, commit, seed and machine."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from radarize import __version__
from radarize.benchmark.table import Table
from radarize.evaluation.metrics import without_nan
from radarize.replacing import write_whole


def machine() -> dict[str, str]:
    """Processor, cores and software that figures were taken with."""
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
        "commit": _commit(),
    }


def _commit() -> str:
    """Of the sources that run, if they are a clone."""
    try:
        found = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError:
        return "unknown"
    return found.stdout.strip() or "unknown"


def command(name: str) -> str:
    """A program's name with the arguments of this process; folders are the machine's business, not the reader's."""
    return " ".join([name, *(Path(word).name if Path(word).is_absolute() else word for word in sys.argv[1:])])


@dataclass(frozen=True)
class Results:
    """Tables and how they came about.

    Attributes:
        title: heading.
        tables: one or several.
        notes: what holds for all of them.
        command: that makes them.
        seed: that everything was drawn from; None if the data does not say.
        machine: see `machine`.
    """

    title: str
    tables: Sequence[Table]
    notes: list[str]
    command: str
    seed: int | None
    machine: dict[str, str] = field(default_factory=machine)

    @property
    def made(self) -> str:
        """Command, seed and machine in a line."""
        seed = "" if self.seed is None else f" seed {self.seed};"
        return f"`{self.command}`,{seed} " + ", ".join(f"{name} {value}" for name, value in self.machine.items()) + "."

    def markdown(self) -> str:
        """The whole as text; a single table of the same title has no heading of its own."""
        lone = len(self.tables) == 1 and self.tables[0].title == self.title
        tables = [table.markdown(1 if lone else 2) for table in self.tables]
        notes = "".join(f"- {note}\n" for note in self.notes)
        parts = [*([] if lone else [f"# {self.title}\n"]), *tables, *([notes] if notes else []), f"{self.made}\n"]
        return "\n".join(parts)

    def write(self, folder: Path, name: str) -> Path:
        """Write NAME.json and NAME.md, and return the latter's path.

        Raises:
            InputError: they cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / f"{name}.json", json.dumps(without_nan(asdict(self)), indent=2) + "\n")
        return write_whole(folder / f"{name}.md", self.markdown())
