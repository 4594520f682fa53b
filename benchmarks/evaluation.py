"""The recordings that methods are compared on, and how a table goes through them."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch

from benchmarks.results import FOLDER
from radarize.benchmark.dataset import Case, DataSet, groups
from radarize.benchmark.results import command
from radarize.benchmark.run import benchmark
from radarize.console import progress
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification

__all__ = ["Case", "add_options", "cases", "compare", "groups", "through"]

SPECIFICATION = Path(__file__).parents[1] / "scenes" / "datasets" / "evaluation.yaml"


def add_options(parser: ArgumentParser) -> None:
    """Options of every table on these recordings."""
    parser.add_argument("--data", type=Path, help="folder of recordings; where there are none, they are made (3 GB)")
    parser.add_argument("--processes", type=int, default=2)


@contextmanager
def recordings(data: Path | None) -> Iterator[Path]:
    """A folder of recordings; if it has none, the evaluation data set is made in it, or in a temporary one."""
    with TemporaryDirectory() as temporary:
        folder = data or Path(temporary)
        if not any(folder.glob("*.h5")):
            with progress("making recordings") as report:
                make(Specification.load(SPECIFICATION), folder, progress=report)
        yield folder


@contextmanager
def cases(data: Path | None) -> Iterator[list[Case]]:
    """The recordings themselves."""
    with recordings(data) as folder:
        yield list(DataSet.load(folder).cases)


def compare(
    name: str, file: str, title: str, options: Namespace, notes: list[str], script: str = "", **choices: Any
) -> None:
    """Carry out a benchmark of `radarize.benchmark` on these recordings and publish its tables.

    Args:
        name: of the benchmark.
        file: name of the results.
        title: of the results.
        options: of the command line; ``out`` is where runs are kept, and found again.
        notes: sentences below the tables.
        script: that does it; by default the name of its results.
        choices: what else `radarize.benchmark.run.benchmark` takes.
    """
    with TemporaryDirectory() as temporary, recordings(options.data) as data, progress("runs") as report:
        found = benchmark(
            name,
            data,
            options.out or Path(temporary),
            workers=options.processes,
            command=command(f"python -m benchmarks.{script or file}"),
            title=title,
            progress=report,
            **choices,
        )[name]
    found.notes.extend(notes)
    print(found.write(FOLDER, file).read_text())


def through(work: Callable[[Case], Any], found: list[Case], processes: int, label: str) -> dict[Case, Any]:
    """What `work` makes of every recording, by several processes of one thread each."""
    results: dict[Case, Any] = {}
    pool = ProcessPoolExecutor(processes, get_context("spawn"), torch.set_num_threads, (1,))
    with progress(label) as report:
        try:
            jobs = {pool.submit(work, case): case for case in found}
            report(0, len(found))
            for job in as_completed(jobs):
                results[jobs[job]] = job.result()
                report(len(results), len(found))
        finally:
            pool.shutdown(cancel_futures=True)
    return {case: results[case] for case in found}
