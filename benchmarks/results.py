"""What all scripts share: their options, and how they write what they found, with all that
`radarize.evaluation.benchmark.results` wants it to say. `benchmarks.make` joins what several found to a page."""

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

#: Of what scripts and `radarize benchmark` found, a JSON file each.
PARTS = Path(__file__).parent / "results" / "parts"
#: Captures and logs that others made, beside the checkout.
SHARED = Path(__file__).parents[2] / "shared" / "recordings"
#: Options of scripts that judge real walks.
CLONE = Path("RadarHD/dataset_5"), "data set of a clone of RadarHD's repository"
POSES = "", "folder of poses, WALK.tum; by the lidar if none"
T = TypeVar("T")
machine()  # as things are now: sources may change while a script runs


class Page(NamedTuple):
    """What a script publishes.

    Attributes:
        rows: a mapping a row, same keys.
        data: that the figures are of.
        notes: sentences below the table.
        networks: that the figures are of.
        beside: whose figures stand beside ours.
        figure: of them; None: there is none.
    """

    rows: Sequence[Mapping[str, object]]
    data: Data
    notes: Sequence[str]
    networks: tuple[UsedNetwork, ...] = ()
    beside: Sequence[Beside] = ()
    figure: Figure | None = None


def script(title: str, **options: tuple) -> Callable[[Callable], Callable[[], None]]:
    """Make a script of the function below, the last one of its file, from options to what is published.

    What it found is written under the file's name, and printed. `main.parser` has the options.

    Args:
        title: heading.
        options: by name a default, or the type of one that has none; what it is; and more for `add_argument`. False
            stands for a flag, and ``{"nargs": "?"}`` makes a positional argument.
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
        for option, (default, words, *more) in (options | {"out": (PARTS, "folder to write")}).items():
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
    """The command that a script was begun with; where it writes is the machine's business."""
    words = [*sys.argv]
    if "--out" in words:
        del words[(at := words.index("--out")) : at + 2]
    return command(f"python -m benchmarks.{name}", words[1:])


def tracked(items: Sequence[T], title: str) -> Iterator[T]:
    """Go through items and show how many are done."""
    with progress(title) as report:
        for done, item in enumerate(items):
            report(done, len(items))
            yield item
        report(len(items), len(items))


def same(rows: Sequence[Mapping[str, object]]) -> list[dict[str, object]]:
    """Rows with the columns of all of them."""
    columns = dict.fromkeys(column for row in rows for column in row)
    return [{column: row.get(column) for column in columns} for row in rows]


def performed(jobs: Mapping[str, Job], workers: int | None, title: str) -> list:
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


def radarhd(title: str, walks: Sequence) -> Data:
    """Data of RadarHD's walks (`radarize.baselines.walks.walks.Walk`)."""
    return Data(title, tuple(NamedWalk.radarhd(walk.number) for walk in walks))


def walked(scene: str, seed: int, motion: Motion) -> NamedWalk:
    """A simulated walk of which no recording was made."""
    return NamedWalk(scene, seed, Statistics.of(motion).distance, simulated=True)


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
