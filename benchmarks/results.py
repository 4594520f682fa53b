"""Common parts of all scripts: their options, and their results with provenance
(`radarize.evaluation.benchmark.results`). `benchmarks.make` combines the results of several scripts to a page."""

import argparse
import inspect
import os
import resource
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from matplotlib.figure import Figure

from radarize.evaluation.benchmark.results import Data, NamedWalk, Results, UsedNetwork, command, machine
from radarize.evaluation.benchmark.table import Beside, Table
from radarize.io.console import progress
from radarize.io.errors import InputError
from radarize.io.jobs import Job, perform
from radarsim.motion.statistics import Statistics
from radarsim.motion.trajectory import Motion

#: Folder of the results of scripts and of `radarize benchmark`, a JSON file each, from which pages are written.
PARTS = Path(__file__).parent / "results" / "parts"
#: Folder of the results of a script that is run by itself: only `benchmarks.make` replaces those of the pages.
TRIAL = Path("build/parts")
#: Public captures and logs, beside the checkout.
SHARED = Path(__file__).parents[2] / "shared" / "recordings"
#: Options of scripts that evaluate real walks.
CLONE = Path("RadarHD/dataset_5"), "data set in a clone of RadarHD's repository"
POSES = "", "folder of true poses, WALK.tum; estimated from the lidar if empty"
T = TypeVar("T")
machine()  # read now, because sources may change while a script runs


class Page(NamedTuple):
    """Results of a script.

    Attributes:
        rows: rows of the table, with the same keys.
        data: data of the results.
        notes: sentences below the table.
        networks: networks that were used.
        beside: published results that are shown in the table.
        figure: figure of the results, or None.
    """

    rows: Sequence[Mapping[str, object]]
    data: Data
    notes: Sequence[str]
    networks: tuple[UsedNetwork, ...] = ()
    beside: Sequence[Beside] = ()
    figure: Figure | None = None


def script(title: str, **options: tuple) -> Callable[[Callable], Callable[[], None]]:
    """Make a script of the decorated function, the last one of its file, which returns results for options.

    Results are written under the name of the file, and printed. `main.parser` has the options.

    Args:
        title: heading.
        options: by name: default, or type of an option without one; help text; further arguments of `add_argument`.
            False makes a flag, and ``{"nargs": "?"}`` a positional argument.
    """

    def of(work: Callable[[argparse.Namespace], Page | tuple[Results, Figure] | None]) -> Callable[[], None]:
        name = Path(inspect.getfile(work)).stem

        def main() -> None:
            given = main.parser.parse_args()
            if (found := work(given)) is None:
                return
            if isinstance(found, Page):
                figure, table = found.figure, Table(title, list(found.rows), list(found.notes), tuple(found.beside))
                results = Results(title, [table], found.data, found.networks, typed(name))
            else:
                results, figure = found
            given.out.mkdir(parents=True, exist_ok=True)
            if figure is not None:
                figure.savefig(given.out / f"{name}.png", dpi=90)
                results.notes.append(f"![{title}]({given.out.name}/{name}.png)")
            results.save(given.out / f"{name}.json")
            print(results.markdown())

        main.parser = argparse.ArgumentParser(description=inspect.getmodule(work).__doc__)
        for option, (default, words, *more) in (options | {"out": (TRIAL, "folder to write")}).items():
            kind, value = (default, None) if isinstance(default, type) else (type(default), default)
            how = {"action": "store_true"} if default is False else {"type": kind, "default": value}
            how |= more[0] if more else {}
            flag = option if how.get("nargs") == "?" else "--" + option.replace("_", "-")
            main.parser.add_argument(flag, help=words, **how)
        if work.__module__ == "__main__":
            main()
        return main

    return of


def typed(name: str) -> str:
    """Return the command of this script, without its output folder."""
    words = [*sys.argv]
    if "--out" in words:
        del words[(at := words.index("--out")) : at + 2]
    return command(f"python -m benchmarks.{name}", words[1:])


def tracked(items: Sequence[T], title: str) -> Iterator[T]:
    """Iterate over items with a progress bar."""
    with progress(title) as report:
        for done, item in enumerate(items):
            report(done, len(items))
            yield item
        report(len(items), len(items))


def same(rows: Sequence[Mapping[str, object]]) -> list[dict[str, object]]:
    """Return rows with the union of their columns."""
    columns = dict.fromkeys(column for row in rows for column in row)
    return [{column: row.get(column) for column in columns} for row in rows]


def performed(jobs: Mapping[str, Job], workers: int | None, title: str) -> list:
    """Execute jobs in processes, and return their results in order.

    Raises:
        InputError: a job fails.
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


def radarhd(title: str, walks: Sequence) -> Data:
    """Return the description of RadarHD's walks (`radarize.baselines.walks.walks.Walk`)."""
    return Data(title, tuple(NamedWalk.radarhd(walk.number) for walk in walks))


def walked(scene: str, seed: int, motion: Motion) -> NamedWalk:
    """Return the description of a simulated walk without a recording."""
    return NamedWalk(scene, seed, Statistics.of(motion).distance, simulated=True)


def timed(work: Callable[..., T], *arguments: object) -> tuple[T, float]:
    """Call a function; return its result and its run time, s."""
    start = time.perf_counter()
    return work(*arguments), time.perf_counter() - start


def peak_memory_mb() -> float:
    """Return the peak resident size of this process, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def memory_mb() -> float:
    """Return the resident size of this process, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def surroundings() -> str:
    """Return a note on the load of the machine, and on the priority of the measurement (Linux: of the session)."""
    group = Path("/proc/self/autogroup")
    priority = group.read_text().split(maxsplit=1)[1].strip() if group.exists() else "that of any process"
    return (
        f"Other work on the machine: load average {os.getloadavg()[2]:.1f}; priority of this measurement: {priority}."
    )
