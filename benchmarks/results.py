"""What all scripts share: their options, and where they put their figures, a page each, with all that
`radarize.benchmark.results` wants it to say."""

import argparse
import os
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from radarize.benchmark.results import Data, Network, Results, Walk, command, machine
from radarize.benchmark.table import Beside, Table
from radarize.console import progress
from radarize.errors import InputError
from radarize.jobs import Job, perform
from radarsim.motion.statistics import Statistics
from radarsim.motion.trajectory import Motion

FOLDER = Path(__file__).parent / "results"
#: Captures and logs that others made, beside the checkout.
SHARED = Path(__file__).parents[2] / "shared" / "recordings"
#: Options of scripts that judge real walks.
CLONE = Path("RadarHD/dataset_5"), "data set of a clone of RadarHD's repository"
POSES = "", "folder of poses, WALK.tum; by the lidar if none"
T = TypeVar("T")
machine()  # as things are now: sources may change while a script runs


def command_line(about: str | None, **options: tuple[object, str]) -> argparse.ArgumentParser:
    """A script's parser.

    Args:
        about: what it does.
        options: by name a default, or the type of one that has none, and what it is; False stands for a flag.
    """
    parser = argparse.ArgumentParser(description=about)
    for name, (default, words) in options.items():
        kind, value = (default, None) if isinstance(default, type) else (type(default), default)
        how = {"action": "store_true"} if default is False else {"type": kind, "default": value}
        parser.add_argument("--" + name.replace("_", "-"), help=words, **how)
    return parser


def publish(
    name: str,
    title: str,
    rows: Sequence[Mapping[str, object]],
    *,
    data: Data,
    networks: tuple[Network, ...],
    notes: Sequence[str],
    beside: Sequence[Beside] = (),
) -> None:
    """Write and print a table.

    Args:
        name: of the script, and of the files in ``benchmarks/results``.
        title: heading.
        rows: a mapping a row, same keys.
        data, networks: that the figures are of.
        notes: sentences below the table.
        beside: whose figures stand beside ours.
    """
    table = Table(title, list(rows), list(notes), tuple(beside))
    results = Results(title, [table], data, networks, command(f"python -m benchmarks.{name}"))
    print(results.write(FOLDER, name).read_text())


def same(rows: Sequence[Mapping[str, object]]) -> list[dict[str, object]]:
    """Rows with the columns of all of them."""
    columns = dict.fromkeys(column for row in rows for column in row)
    return [{column: row.get(column) for column in columns} for row in rows]


def performed(jobs: Mapping[str, Job], workers: int, title: str) -> list:
    """Of all jobs, in their order.

    Raises:
        InputError: one of them fails.
    """
    found = {}
    with progress(title) as report:
        for news in perform(jobs, workers):
            if news.error is not None:
                raise InputError(news.error)
            if news.ended:
                found[news.name] = news.result
                report(len(found), len(jobs))
    return [found[name] for name in jobs]


def walked(scene: str, seed: int, motion: Motion) -> Walk:
    """A simulated walk of which no recording was made."""
    return Walk(scene, seed, Statistics.of(motion).distance, simulated=True)


def timed(work: Callable[..., T], *arguments: object) -> tuple[T, float]:
    """What some work gives, and the s that it took."""
    start = time.perf_counter()
    return work(*arguments), time.perf_counter() - start


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
