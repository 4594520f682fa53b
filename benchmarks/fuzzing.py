"""Fuzzing of every reader of files and packets: each input must give a result or an error of one sentence.

Inputs and limits of run time and memory are those of `tests/fuzzing`. Each reader runs in a separate process, which
ends after a crash, a hang or exceeded memory; the error message has the path of the input.
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

#: Inputs per seed; coverage is measured with those of the first seed.
_BATCH = 500
#: Readers that need over 5 ms per input including its generation, and the factor by which they get fewer inputs.
_SLOW, _LESS = {
    "pcap", ".bin", "npy", "mat", "HDF5 recording", "ROS 1 bag", "ROS 2 mcap", "ROS 2 db3",
    *(name for name in READERS if name.startswith("run: ")),
}, 4  # fmt: skip
#: Maximum address space beyond that at the start, bytes; time after which an input counts as a hang, s.
_ADDRESSES, _HANG = 4 << 30, 120


def tried(reader: Reader, count: int, number: int, folder: Path) -> list[Attempt]:
    """Run a reader on the inputs of one seed."""
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
    """Run one reader on all inputs, in its process; return a row of the table."""
    warnings.simplefilter("ignore")  # of numpy and scipy about meaningless numbers
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
    """Return the line coverage of this project's functions that a reader enters, by the inputs of the first seed, %."""
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
    """Return a row of the table, from separate processes; or the error of the reader."""
    count = count // _LESS if name in _SLOW else count
    folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as process:
        try:
            row = process.submit(try_all, name, count, first, folder).result()
            row["lines reached, %"] = process.submit(reached, name, first, folder).result()
        except Exception as error:  # of the reader, or of its process
            return f"{name}: failed on what lies in {folder} ({error})"
    folder.rmdir()
    return row


def kept(name: str, count: int, first: int, earlier: str | None = None) -> dict[str, object] | str:
    """Return the result of `judged`, or a stored one of this commit or an earlier one, so that a run can continue."""
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
    inputs=(5000, f"inputs per reader; {_LESS} times fewer for slow ones ({', '.join(sorted(_SLOW))})"),
    seed=(0, "seed of hypothesis"),
    workers=(len(os.sched_getaffinity(0)), "number of readers in parallel"),
    reader=(str, "run only this reader, without a table", {"choices": list(READERS)}),
    earlier=(str, "use stored rows of this commit, too"),
)
def main(options: argparse.Namespace) -> Page:
    """Run all readers; fail if one of them fails."""
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
            "Inputs are valid files after bit flips, cuts, splices and edits of fields, or random bytes, generated by "
            "hypothesis. No input caused a crash, a hang, or an exception other than an error of one sentence.",
            f"Limits per input: {MOST_SECONDS:g} s of processor time; {MOST_MEMORY >> 20} MiB and {MOST_TIMES} times "
            "its size of memory. Memory is the increase of the resident size; longest is processor time; s is wall "
            "time, including the generation of inputs.",
            f"lines reached: line coverage of this project's functions that a reader enters, by the first {_BATCH} "
            "inputs, without compiled functions.",
            "commit: commit of the tested code; a reader that failed was corrected and run again, without the others.",
            surroundings(),
        ],
    )
