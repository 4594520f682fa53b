"""Damaged and hostile input for every reader of foreign bytes: each must end in a result or in one sentence.

Inputs and what a reader may take are those of `tests/fuzzing/readers.py`. Each reader runs in a process of its own,
which dies of a crash in a library, of a hang, or of memory without end; its input then lies where the message says.
"""

import json
import resource
import signal
import tempfile
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from rich.progress import track

from benchmarks.results import Data, command_line, publish, surroundings
from tests.fuzzing.readers import MOST_MEMORY, MOST_SECONDS, MOST_TIMES, READERS, attempt

#: Inputs of one seed: hypothesis remembers what it has tried.
_BATCH = 500
#: Address space beyond what a process has before it starts, bytes; and s until a hang is the end of it.
_ADDRESSES, _HANG = 4 << 30, 60


def try_all(name: str, count: int, first: int, folder: Path) -> dict[str, object]:
    """Inputs for one reader, in its process; a row of the table."""
    warnings.simplefilter("ignore")  # numpy and scipy about numbers that make no sense
    reader, found = READERS[name](), []
    used = resource.getpagesize() * int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (used + _ADDRESSES, used + _ADDRESSES))

    def one(data: object) -> None:
        signal.alarm(_HANG)
        found.append(attempt(reader, data, folder))

    start = time.perf_counter()
    for number, done in enumerate(range(0, count, _BATCH)):
        run = settings(
            max_examples=min(_BATCH, count - done), deadline=None, database=None, phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )(given(reader.inputs)(one))  # fmt: skip
        seed(first + number)(run)()
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


PARSER = command_line(
    __doc__,
    inputs=(5000, "for each reader"),
    seed=(0, "of hypothesis"),
)
PARSER.add_argument("--reader", choices=list(READERS), help="this one alone, without a table")


def main() -> None:
    """The table; ends at the first input that a reader fails on."""
    options, rows = PARSER.parse_args(), []
    for name in track([options.reader] if options.reader else list(READERS), "readers"):
        folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
        with ProcessPoolExecutor(1, get_context("spawn")) as process:
            try:
                rows.append(process.submit(try_all, name, options.inputs, options.seed, folder).result())
            except Exception as error:  # the reader's own, or that its process has died
                raise SystemExit(f"{name}: failed on what lies in {folder} ({error})") from error
        folder.rmdir()
    if options.reader:
        print(json.dumps(rows[0], indent=2))
        return
    total = {key: sum(row[key] for row in rows) for key in ("inputs", "read", "refused", "s")}
    most = {key: max(row[key] for row in rows) for key in ("longest, ms", "most memory, MB")}
    publish(
        "fuzzing",
        "Damaged and hostile input",
        [*rows, {"reader": "all", **total, **most}],
        data=Data(f"{total['inputs']} damaged inputs", (), options.seed),
        networks=(),
        notes=[
            "Valid files after bit flips, cuts, splices and edits of fields, or random bytes, drawn by hypothesis. "
            "None raised anything but a refusal in one sentence, crashed or hung.",
            f"More than {MOST_SECONDS:g} s of processor time, or {MOST_MEMORY >> 20} MiB and {MOST_TIMES} times its "
            "size in memory, would have failed the input. Memory is what was resident beyond the state before; the "
            "longest is in processor time, s are on the clock, making and placing the inputs included.",
            surroundings(),
        ],
    )


if __name__ == "__main__":
    main()
