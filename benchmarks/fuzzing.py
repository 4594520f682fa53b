"""Damaged and hostile input for every reader of foreign bytes: each must end in a result or in one sentence.

Inputs and what a reader may take are those of `tests/fuzzing`. Each reader runs in a process of its own, which dies of
a crash in a library, of a hang, or of memory without end; its input then lies where the message says.
"""

import argparse
import ast
import json
import os
import resource
import signal
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from coverage import Coverage
from hypothesis import HealthCheck, Phase, given, seed, settings
from rich.progress import track

import radarize
import radarsim
from benchmarks.results import Data, Page, same, script, surroundings
from radarize.evaluation.benchmark.results import commit
from radarize.io.replacing import replacing
from tests.fuzzing.reader import MOST_MEMORY, MOST_SECONDS, MOST_TIMES, Attempt, Reader, attempt
from tests.fuzzing.readers import READERS

#: Inputs of one seed: hypothesis remembers what it has tried. Of the first seed's, what they reach is measured.
_BATCH = 500
#: Readers that take over 5 ms for an input, making it included; they get so much less.
_SLOW, _LESS = {
    "pcap", ".bin", "npy", "mat", "HDF5 recording", "ROS 1 bag", "ROS 2 mcap", "ROS 2 db3",
    *(name for name in READERS if name.startswith("run: ")),
}, 4  # fmt: skip
#: Address space beyond what a process has before it starts, bytes; and s until a hang is the end of it.
_ADDRESSES, _HANG = 4 << 30, 120


def tried(reader: Reader, count: int, number: int, folder: Path) -> list[Attempt]:
    """What came of the inputs of one seed."""
    found = []

    def one(data: object) -> None:
        signal.alarm(_HANG)
        found.append(attempt(reader, data, folder))

    run = settings(
        max_examples=count, deadline=None, database=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )(given(reader.inputs)(one))  # fmt: skip
    seed(number)(run)()
    return found


def try_all(name: str, count: int, first: int, folder: Path) -> dict[str, object]:
    """Inputs for one reader, in its process; a row of the table."""
    warnings.simplefilter("ignore")  # numpy and scipy about numbers that make no sense
    reader, found = READERS[name](), []
    used = resource.getpagesize() * int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (used + _ADDRESSES, used + _ADDRESSES))
    start = time.perf_counter()
    for number, done in enumerate(range(0, count, _BATCH)):
        found += tried(reader, min(_BATCH, count - done), first + number, folder)
    accepted = sum(each.accepted for each in found)
    return {
        "reader": name,
        "inputs": len(found),
        "read": accepted,
        "refused": len(found) - accepted,
        "s": time.perf_counter() - start,
        "longest, ms": 1e3 * max(each.seconds for each in found),
        "most memory, MB": 1e-6 * max(each.memory for each in found),
    }


def reached(name: str, first: int, folder: Path) -> float:
    """Of the lines of this project's functions that a reader enters: share that the first seed's inputs reach, %."""
    warnings.simplefilter("ignore")
    reader = READERS[name]()
    coverage = Coverage(data_file=None, source_pkgs=[radarize.__name__, radarsim.__name__])
    with coverage.collect():
        tried(reader, _BATCH, first, folder)
    lines = hit = 0
    for path in coverage.get_data().measured_files():
        _, statements, _, missing, _ = coverage.analysis2(path)
        run = set(statements) - set(missing)
        for node in ast.walk(ast.parse(Path(path).read_text())):
            if isinstance(node, ast.FunctionDef):
                inside = set(range(node.body[0].lineno, node.end_lineno + 1)) & set(statements)
                if inside & run:
                    lines, hit = lines + len(inside), hit + len(inside & run)
    return 100 * hit / lines


def judged(name: str, count: int, first: int) -> dict[str, object] | str:
    """A row of the table, from processes of its own; or what the reader failed on."""
    count = count // _LESS if name in _SLOW else count
    folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as process:
        try:
            row = process.submit(try_all, name, count, first, folder).result()
            row["lines reached, %"] = process.submit(reached, name, first, folder).result()
        except Exception as error:  # the reader's own, or that its process has died
            return f"{name}: failed on what lies in {folder} ({error})"
    folder.rmdir()
    return row


def kept(name: str, count: int, first: int, earlier: str | None = None) -> dict[str, object] | str:
    """What is `judged`, or was by a run of this commit or an earlier one: a long one goes on where it was stopped."""
    now = commit(Path(__file__))
    for source in filter(None, (now, earlier)):
        path = _row(name, count, first, source)
        if path.exists():
            return json.loads(path.read_text()) | {"commit": source}
    row = judged(name, count, first)
    if isinstance(row, dict) and now.endswith("(clean)"):
        with replacing(_row(name, count, first, now)) as part:
            part.write_text(json.dumps(row))
    return row | {"commit": now} if isinstance(row, dict) else row


def _row(name: str, count: int, first: int, source: str) -> Path:
    return Path("build/fuzzing") / f"{source}-{count}-{first}" / f"{list(READERS).index(name)}.json"


@script(
    "Damaged and hostile input",
    inputs=(5000, f"for each reader; for slow ones, {', '.join(sorted(_SLOW))}, {_LESS} times fewer"),
    seed=(0, "of hypothesis"),
    workers=(len(os.sched_getaffinity(0)), "readers at a time"),
    reader=(str, "this one alone, without a table", {"choices": list(READERS)}),
    earlier=(str, "rows of a run at this commit count, too, which another reader's fault has ended"),
)
def main(options: argparse.Namespace) -> Page:
    """The table, if no reader fails."""
    if options.reader:
        row = judged(options.reader, options.inputs, options.seed)
        if isinstance(row, str):
            raise SystemExit(row)
        print(json.dumps(row, indent=2))
        return
    with ThreadPoolExecutor(options.workers) as threads:
        found = threads.map(lambda name: kept(name, options.inputs, options.seed, options.earlier), READERS)
        rows = list(track(found, "readers", total=len(READERS)))
    if failed := [each for each in rows if isinstance(each, str)]:
        raise SystemExit("\n".join(failed))
    total = {key: sum(row[key] for row in rows) for key in ("inputs", "read", "refused", "s")}
    most = {key: max(row[key] for row in rows) for key in ("longest, ms", "most memory, MB")}
    return Page(
        same([*rows, {"reader": "all", **total, **most}]),
        data=Data(f"{total['inputs']} damaged inputs", (), options.seed),
        notes=[
            "Valid files after bit flips, cuts, splices and edits of fields, or random bytes, drawn by hypothesis. "
            "None raised anything but a refusal in one sentence, crashed or hung.",
            f"More than {MOST_SECONDS:g} s of processor time, or {MOST_MEMORY >> 20} MiB and {MOST_TIMES} times its "
            "size in memory, would have failed the input. Memory is what was resident beyond the state before; the "
            "longest is in processor time, s are on the clock, making and placing the inputs included.",
            f"Lines reached: by the first {_BATCH} inputs, of the lines of this project's functions that a reader "
            "enters; compiled functions are left out.",
            "Commit: of the code that was tried; where a reader failed, it was mended and tried again, and others were "
            "not.",
            surroundings(),
        ],
    )
