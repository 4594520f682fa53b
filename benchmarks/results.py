"""Where benchmarks put their figures: one JSON and one Markdown table each, with machine, command and seed."""

import json
import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

from radarize import __version__

FOLDER = Path(__file__).parent / "results"


def machine() -> dict[str, str]:
    """Processor, cores and software that figures were taken with."""
    try:
        model = next(x for x in Path("/proc/cpuinfo").read_text().splitlines() if x.startswith("model name"))
        model = model.split(":", 1)[1].strip()
    except (OSError, StopIteration):
        model = platform.processor()
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    return {
        "processor": model,
        "cores": str(len(os.sched_getaffinity(0))),
        "python": platform.python_version(),
        "version": __version__,
        "commit": commit.stdout.strip() or "unknown",
    }


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


def publish(name: str, title: str, rows: list[dict[str, object]], *, seed: int, notes: list[str]) -> None:
    """Write and print a table.

    Args:
        name: of the files in ``benchmarks/results``.
        title: heading.
        rows: one dictionary a row, same keys.
        seed: that everything was drawn from.
        notes: sentences below the table.
    """
    # Folders are the machine's business, not the reader's.
    options = [Path(word).name if Path(word).is_absolute() else word for word in sys.argv[1:]]
    command = f"python -m benchmarks.{name} {' '.join(options)}".strip()
    facts = {"title": title, "command": command, "seed": seed, "machine": machine(), "rows": rows, "notes": notes}
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.json").write_text(json.dumps(facts, indent=2) + "\n")
    columns = list(rows[0])
    lines = [f"# {title}", "", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    lines += ["| " + " | ".join(_cell(row[c]) for c in columns) + " |" for row in rows]
    lines += ["", *(f"- {note}" for note in notes)]
    lines += ["", f"`{command}`, seed {seed}; " + ", ".join(f"{k} {v}" for k, v in facts["machine"].items()) + "."]
    text = "\n".join(lines) + "\n"
    (FOLDER / f"{name}.md").write_text(text)
    print(text)


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
