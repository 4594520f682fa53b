"""Where benchmarks put their figures: one JSON and one Markdown table each, with machine, command and seed."""

import os
import resource
from pathlib import Path

from radarize.benchmark.results import Results, command, machine
from radarize.benchmark.table import Table

__all__ = ["FOLDER", "machine", "memory_mb", "peak_memory_mb", "publish", "surroundings"]

FOLDER = Path(__file__).parent / "results"


def peak_memory_mb() -> float:
    """Largest resident size of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def memory_mb() -> float:
    """Resident size of this process now, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def surroundings() -> str:
    """What else the machine does, and at what priority (Linux: of the session) figures are taken: a note."""
    group = Path("/proc/self/autogroup")
    priority = group.read_text().split(maxsplit=1)[1].strip() if group.exists() else "that of any process"
    return (
        f"Other work on the machine: load average {os.getloadavg()[2]:.1f}; priority of this measurement: {priority}."
    )


def publish(name: str, title: str, rows: list[dict[str, object]], *, seed: int | None, notes: list[str]) -> None:
    """Write and print a table.

    Args:
        name: of the files in ``benchmarks/results``.
        title: heading.
        rows: one dictionary a row, same keys.
        seed: that everything was drawn from.
        notes: sentences below the table.
    """
    results = Results(title, [Table(title, rows, notes)], [], command(f"python -m benchmarks.{name}"), seed)
    print(results.write(FOLDER, name).read_text())
