"""`radarize benchmark`: compare methods on a folder of recordings and publish what came of it."""

from collections.abc import Callable, Sequence
from pathlib import Path

from radarize.benchmark.benchmark import Study, carry_out
from radarize.benchmark.benchmarks import BENCHMARKS
from radarize.benchmark.dataset import DataSet
from radarize.benchmark.page import write_index, write_page
from radarize.benchmark.protocol import PROTOCOLS
from radarize.benchmark.results import Results
from radarize.errors import InputError

#: All that the data is fit for.
ALL = "all"


def benchmark(
    name: str,
    data: Path,
    output: Path,
    *,
    methods: Sequence[str] = (),
    weights: Path | None = None,
    trained: bool = False,
    epochs: int | None = None,
    protocol: str | None = None,
    workers: int = 1,
    command: str = "",
    title: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> dict[str, Results]:
    """Compare methods. Whatever ends it, the same call goes on after the last run that ended.

    Args:
        name: a key of `BENCHMARKS`, or ``all``.
        data: folder of recordings.
        output: folder to write: NAME.json, NAME.md and NAME.html for each benchmark, index.html over all; ``runs``,
            ``timings`` and ``weights``, which are used again.
        methods: keys of `radarize.methods.ODOMETRY` and `SCANS`; all of a sort of which none is named.
        weights: folder of the networks' weights; the shipped ones if None.
        trained: train networks on each split instead.
        epochs: of these trainings, at most; their defaults if None.
        protocol: a key of `PROTOCOLS`; both if None.
        workers: processes.
        command: that the results name; title: of them, by default the benchmark's.
        progress: called with (frames done, frames in all).
        say: takes a line on each benchmark that the data is not fit for.

    Returns:
        what was published, by name.

    Raises:
        InputError: an unknown name, or data that is not fit for it.
    """
    if name != ALL and name not in BENCHMARKS:
        raise InputError(f"benchmark is {name!r}, expected one of: {', '.join((*BENCHMARKS, ALL))}")
    if protocol is not None and protocol not in PROTOCOLS:
        raise InputError(f"protocol is {protocol!r}, expected one of: {', '.join(PROTOCOLS)}")
    if weights is not None and not weights.is_dir():
        raise InputError(f"weights is {weights}, expected a folder that holds the networks' weights")
    if trained and weights is not None:
        raise InputError(f"weights {weights} are given with --train, expected one of the two")
    found, output = DataSet.load(data), Path(output)
    studies: dict[str, Study] = {}
    for each in BENCHMARKS if name == ALL else (name,):
        try:
            studies[each] = Study.plan(
                BENCHMARKS[each],
                found,
                output,
                methods,
                weights,
                trained,
                epochs,
                (protocol,) if protocol else tuple(PROTOCOLS),
            )
        except InputError as error:
            if name != ALL:
                raise
            say(f"{each}: left out, {error}")
    if not studies:
        raise InputError(f"{data}: is fit for no benchmark")
    carry_out(list(studies.values()), workers, progress)
    published = {}
    for each, study in studies.items():
        published[each] = Results(
            title or study.benchmark.title, study.benchmark.tables(study), _notes(study), command, found.seed
        )
        published[each].write(output, each)
        write_page(study, published[each], output / f"{each}.html")
    write_index(output)
    return published


def _notes(study: Study) -> list[str]:
    """What holds for all tables: data, networks, what is missing."""
    recordings = len({case.name for cases in study.splits.values() for case in cases})
    name = study.data.index.get("specification", {}).get("name", study.data.folder.resolve().name)
    if study.trainings:
        epochs = study.trainings[0].epochs
        networks = "each split's networks were trained on its own training part" + (
            f" (epochs: {epochs})" if epochs else ""
        )
    else:
        label = next(iter(study.networks.values())).label
        own = " (--train makes networks of each split's own)" if study.benchmark.split else ""
        networks = f"{label} weights for all of them{own}"
    splits = ", ".join(study.splits)
    return [f"Data set {name}: {recordings} recordings test ({splits}); {networks}.", *study.shortfalls]
