"""The recordings that methods are compared on, and how a table goes through them."""

from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch

from radarize.console import progress
from radarize.recording import Recording
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification

SPECIFICATION = Path(__file__).parents[1] / "scenes" / "datasets" / "evaluation.yaml"
PLATFORMS = ("handheld", "cart", "robot")


@dataclass(frozen=True)
class Case:
    """A recording and what it is of."""

    path: Path
    building: str
    platform: str

    @classmethod
    def of(cls, path: Path) -> "Case":
        with Recording(path) as recording:
            about = recording.attributes
        return cls(path, str(about.get("scene", path.stem)).split("_")[0], str(about.get("platform", "-")))


def add_options(parser: ArgumentParser) -> None:
    """Options of every table on these recordings."""
    parser.add_argument("--data", type=Path, help="folder of recordings; where there are none, they are made (3 GB)")
    parser.add_argument("--processes", type=int, default=2)


@contextmanager
def cases(data: Path | None) -> Iterator[list[Case]]:
    """The recordings of a folder; if it has none, the evaluation data set is made in it, or in a temporary one."""
    with TemporaryDirectory() as temporary:
        folder = data or Path(temporary)
        if not any(folder.glob("*.h5")):
            with progress("making recordings") as report:
                make(Specification.load(SPECIFICATION), folder, progress=report)
        yield [Case.of(path) for path in sorted(folder.glob("*.h5"))]


def through(work: Callable[[Case], Any], found: list[Case], processes: int, label: str) -> list[Any]:
    """What `work` makes of every recording, in their order, by several processes of one thread each."""
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
    return [results[case] for case in found]


def groups(found: list[Case]) -> dict[str, list[int]]:
    """Indices of the recordings by platform, then by building, then of all."""
    names = [*PLATFORMS, *dict.fromkeys(case.building for case in found)]
    chosen = {name: [i for i, case in enumerate(found) if name in (case.platform, case.building)] for name in names}
    return {name: rows for name, rows in chosen.items() if rows} | {"all": list(range(len(found)))}
