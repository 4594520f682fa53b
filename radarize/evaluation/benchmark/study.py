"""A comparison of methods: what it is (`Benchmark`), and how it goes on a data set (`Study`)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from radarize.evaluation.benchmark.dataset import Case, DataSet, groups
from radarize.evaluation.benchmark.networks import Networks, Training
from radarize.evaluation.benchmark.protocol import PROTOCOLS, Protocol
from radarize.evaluation.benchmark.results import Results, UsedNetwork, command
from radarize.evaluation.benchmark.runs import Pair, RunStep, Timing
from radarize.evaluation.benchmark.steps import Step, perform
from radarize.evaluation.benchmark.table import Table
from radarize.evaluation.report.page import Page
from radarize.io.errors import InputError
from radarize.io.plugins import Plugins
from radarize.pipeline.method import Method
from radarize.pipeline.methods import BEST, ODOMETRY, SCANS, best_methods


@dataclass(frozen=True)
class Options:
    """What is compared, by default all that there is, and with what.

    Attributes:
        methods: keys of `radarize.pipeline.methods.ODOMETRY` and `SCANS`; of a sort of which none is named, all that
            read samples.
        weights: folder of the networks' weights; the shipped ones if None.
        trained: train networks on each split instead.
        epochs: of these trainings, at most; their defaults if None.
        protocol: a key of `PROTOCOLS`; all if None.
        workers: processes.
        ray: address of a Ray cluster to use instead.
        command: that the results name.
    """

    methods: Sequence[str] = ()
    weights: Path | None = None
    trained: bool = False
    epochs: int | None = None
    protocol: str | None = None
    workers: int = 1
    ray: str | None = None
    command: str = field(default_factory=lambda: command("radarize"))

    def check(self) -> None:
        """Raises: InputError: an unknown name, or weights that are none."""
        if unknown := [name for name in self.methods if name not in (*ODOMETRY, *SCANS)]:
            raise InputError(f"methods names {unknown[0]!r}, expected some of: {', '.join((*ODOMETRY, *SCANS))}")
        if self.protocol is not None and self.protocol not in PROTOCOLS:
            raise InputError(f"protocol is {self.protocol!r}, expected one of: {', '.join(PROTOCOLS)}")
        if self.weights is not None and not self.weights.is_dir():
            raise InputError(f"weights is {self.weights}, expected a folder that holds the networks' weights")
        if self.trained and self.weights is not None:
            raise InputError(f"weights {self.weights} are given with --train, expected one of the two")

    @property
    def shipped(self) -> bool:
        """Whether networks are those that come with the package."""
        return not self.trained and self.weights is None

    @property
    def protocols(self) -> list[Protocol]:
        """Ways to compare trajectories."""
        return [PROTOCOLS[self.protocol]] if self.protocol else list(PROTOCOLS.values())


@dataclass(frozen=True)
class Chosen:
    """Methods that are compared.

    Attributes:
        odometry, scans: keys of `radarize.pipeline.methods.ODOMETRY` and `SCANS`.
        partner: what is run with methods of the other sort when these are compared.
    """

    odometry: tuple[str, ...]
    scans: tuple[str, ...]
    partner: Pair

    def by_odometry(self) -> list[Pair]:
        """Every odometry; the scans are the same."""
        return [Pair(odometry, self.partner.scans) for odometry in self.odometry]

    def by_scans(self) -> list[Pair]:
        """Every scan; odometry is the same."""
        return [Pair(self.partner.odometry, scans) for scans in self.scans]

    @classmethod
    def of(cls, options: Options, data: DataSet) -> "Chosen":
        """Methods of choice are those without networks where the shipped ones do not fit the radar."""
        partner = best_methods(data.cases[0].config)[0] if options.shipped else BEST

        def compared(known: Mapping[str, Method]) -> tuple[str, ...]:
            named = [name for name in options.methods if name in known]
            return tuple(named or (name for name, method in known.items() if not method.pictures))

        return cls(compared(ODOMETRY), compared(SCANS), Pair(**partner))


@dataclass(frozen=True)
class Benchmark:
    """A comparison.

    Attributes:
        title, about: in short, and in a sentence.
        pairs: what it runs.
        tables: what it makes of that.
        split: kind of splits whose test parts it goes through, see `DataSet.splits`; None: all recordings.
        timed: it measures time, on the first recording.
        lacks: what a data set must have and has not, as a sentence.
        draw: sections of its page below the tables.
        picture: beside its tables, which it is given, too; None: there is none.
    """

    title: str
    about: str
    pairs: Callable[[Chosen], list[Pair]]
    tables: Callable[["Study"], list[Table]]
    split: str | None = None
    timed: bool = False
    lacks: Callable[[DataSet], str] = lambda data: ""
    draw: Callable[["Study", Page], None] = lambda study, page: None
    picture: Callable[["Study", list[Table]], Figure | None] = lambda study, tables: None


@dataclass(frozen=True)
class OwnBenchmark:
    """A benchmark on other data than folders of recordings, which does everything itself.

    Attributes:
        about: in a sentence.
        compare: called with the folder of data, the folder to write, and the options of ``radarize benchmark`` by name.
    """

    about: str
    compare: Callable[..., None]


BENCHMARKS: Plugins["Benchmark | OwnBenchmark"] = Plugins("radarize.benchmarks", "benchmark")


@dataclass
class Study:
    """A benchmark on a data set.

    Attributes:
        benchmark, data: which, on what.
        output: folder of all runs.
        options: with what.
        chosen: methods that are compared.
        splits: name to recordings.
        networks: of each split.
        trainings: that its runs need.
        results: what each step found, or why it could not be done.
    """

    benchmark: Benchmark
    data: DataSet
    output: Path
    options: Options
    chosen: Chosen
    splits: dict[str, list[Case]]
    networks: dict[str, Networks]
    trainings: list[Training] = field(default_factory=list)
    results: dict[Step, dict | str] = field(default_factory=dict)

    @classmethod
    def plan(cls, benchmark: Benchmark, data: DataSet, output: Path, options: Options = Options()) -> "Study":  # noqa: B008
        """Look what is to be done.

        Raises:
            InputError: an unknown method, none that the benchmark compares, or a data set without what it needs.
        """
        options.check()
        if reason := benchmark.lacks(data):
            raise InputError(f"{data.folder}: {reason}")
        splits = {"all": list(data.cases)} if benchmark.split is None else data.splits(benchmark.split)
        if not splits:
            raise InputError(f"{data.folder}: no recording tests in a split of kind {benchmark.split}")
        given = Networks() if options.weights is None else Networks("given", options.weights)
        networks = dict.fromkeys(splits, given)
        study = cls(benchmark, data, output, options, Chosen.of(options, data), splits, networks)
        if not study.pairs:
            raise InputError(f"methods names {', '.join(options.methods)}, of which this benchmark compares none")
        if options.trained and benchmark.split is not None:
            if not data.trainable(benchmark.split):
                raise InputError(
                    f"{data.folder}: its dataset.json has no split of kind {benchmark.split}, expected one to train on"
                )
            study.networks = {name: Networks(name, output / "weights" / name) for name in splits}
            study.trainings = [
                Training(split, kind, data.folder, options.epochs) for split in splits for kind in study.kinds
            ]
        return study

    @property
    def pairs(self) -> list[Pair]:
        """Methods that are run."""
        return list(dict.fromkeys(self.benchmark.pairs(self.chosen)))

    @property
    def kinds(self) -> list[str]:
        """Networks that they need."""
        return list(dict.fromkeys(kind for pair in self.pairs for kind in pair.networks))

    @property
    def cases(self) -> list[Case]:
        """Recordings that test, each once, in the data set's order."""
        tested = {case for cases in self.splits.values() for case in cases}
        return [case for case in self.data.cases if case in tested]

    @property
    def runs(self) -> list[tuple[str, RunStep]]:
        """All runs with their splits, recording by recording, so that each is read from memory after the first time."""
        return [
            # Methods without networks are the same in every split.
            (split, RunStep(case, pair, self.networks[split] if pair.networks else Networks()))
            for split, cases in self.splits.items()
            for case in cases
            for pair in self.pairs
        ]

    @property
    def timings(self) -> list[Timing]:
        """On the first recording."""
        split, cases = next(iter(self.splits.items()))
        return [Timing(cases[0], pair, self.networks[split]) for pair in self.pairs]

    @property
    def steps(self) -> list[Step]:
        """All that takes long, in order."""
        return [*self.trainings, *(self.timings if self.benchmark.timed else (run for _, run in self.runs))]

    def of(self, pair: Pair, once: bool = True) -> pd.DataFrame:
        """Figures of a pair's runs that ended well, a row each.

        Args:
            pair: of methods.
            once: each run once, in the order of recordings; else as often as it tests in a split.

        Returns:
            Columns ``run`` (`RunStep`), ``split``, ``recording`` (name), and every figure of
            `radarize.evaluation.benchmark.runs.figures` by its path: ``odometry.ate.position.mean``.
        """
        order = {case: k for k, case in enumerate(self.data.cases)}
        runs = [(split, run) for split, run in self.runs if run.pair == pair]
        runs = [(split, run) for split, run in runs if isinstance(self.results.get(run), dict)]
        if once:
            runs = sorted({run: (split, run) for split, run in runs}.values(), key=lambda each: order[each[1].case])
        about = pd.DataFrame(
            [(run, split, run.case.name) for split, run in runs], columns=["run", "split", "recording"]
        )
        return about.join(pd.json_normalize([self.results[run] for _, run in runs]))

    def by_group(self) -> Iterator[tuple[Pair, dict[str, object], pd.DataFrame]]:
        """By platform, by building and of all: a pair, what a table's row says of the group, and its rows of `of`."""
        found = {pair: self.of(pair) for pair in self.pairs}
        for name, members in groups(self.cases).items():
            for pair, runs in found.items():
                here = runs[runs["recording"].isin([case.name for case in members])]
                if len(here):
                    yield pair, {"on": name, "recordings": len(here)}, here

    def publish(self) -> Results:
        """Tables, and all that tells what they are worth."""
        splits = [f"Tested in splits {', '.join(self.splits)}."] if len(self.splits) > 1 else []
        return Results(
            self.benchmark.title,
            self.benchmark.tables(self),
            self.data.data([self.timings[0].case] if self.benchmark.timed else self.cases),
            self.used,
            self.options.command,
            [*splits, *self.shortfalls],
        )

    @property
    def used(self) -> tuple[UsedNetwork, ...]:
        """Networks that it was done with."""
        found = [one for networks in self.networks.values() for one in networks.used(self.kinds)]
        return tuple(dict.fromkeys(found))

    @property
    def shortfalls(self) -> list[str]:
        """A sentence for each pair, or network, that there is something missing of."""
        found = []
        for training in self.trainings:
            if isinstance(reason := self.results.get(training), str):
                found.append(f"{training.split}: {self._plain(reason)}.")
        steps = dict.fromkeys(step for step in self.steps if isinstance(step, RunStep | Timing))
        for pair in self.pairs:
            of_pair = [self.results.get(step) for step in steps if step.pair == pair]
            reasons = [self._plain(found) for found in of_pair if isinstance(found, str)]
            if reasons:
                found.append(f"{pair}: - on {len(reasons)} of {len(of_pair)} recordings ({reasons[0]}).")
        return found

    def _plain(self, reason: str) -> str:
        """A reason without folders, which are the machine's business."""
        for folder in (self.output, self.data.folder, Path(__file__).parents[1]):
            reason = reason.replace(f"{folder}/", "").replace(f"{folder.resolve()}/", "")
        return reason


def carry_out(studies: Sequence[Study], progress: Callable[[int, int], None]) -> None:
    """Do what studies of the same options need, each step once for all of them, and give them what was found.

    Raises:
        InputError: nothing could be done.
    """
    steps = [step for study in studies for step in study.steps]
    # Networks before runs, and runs before timings, which want quiet cores.
    steps.sort(key=lambda step: (Training, RunStep, Timing).index(type(step)))
    options = studies[0].options
    results = perform(steps, studies[0].output, options.workers, progress, options.ray)
    for study in studies:
        study.results = results
    done = [found for step, found in results.items() if not isinstance(step, Training)]
    if done and all(isinstance(found, str) for found in done):
        raise InputError(f"nothing could be compared: {done[0]}")
