"""A comparison of methods: its definition (`Benchmark`), and its execution on a data set (`Study`)."""

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
    """Options of a comparison; by default all methods are compared.

    Attributes:
        methods: keys of `radarize.pipeline.methods.ODOMETRY` and `SCANS`; if none of a kind is given, all of this kind
            that read samples.
        weights: folder of the networks' weights; the shipped ones if None.
        trained: train networks on each split instead.
        epochs: maximum number of epochs of these trainings; their defaults if None.
        protocol: a key of `PROTOCOLS`; all if None.
        workers: number of processes.
        ray: address of a Ray cluster to use instead.
        command: command that is printed with the results.
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
        """Check names and paths; InputError for an unknown name, or a missing folder of weights."""
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
        """Whether the networks are the shipped ones."""
        return not self.trained and self.weights is None

    @property
    def protocols(self) -> list[Protocol]:
        """Evaluation protocols."""
        return [PROTOCOLS[self.protocol]] if self.protocol else list(PROTOCOLS.values())


@dataclass(frozen=True)
class Chosen:
    """Methods that are compared.

    Attributes:
        odometry, scans: keys of `radarize.pipeline.methods.ODOMETRY` and `SCANS`.
        partner: default pair; its odometry is run with all scans, and its scans with all odometry.
    """

    odometry: tuple[str, ...]
    scans: tuple[str, ...]
    partner: Pair

    def by_odometry(self) -> list[Pair]:
        """Return all odometry, with the default scans."""
        return [Pair(odometry, self.partner.scans) for odometry in self.odometry]

    def by_scans(self) -> list[Pair]:
        """Return all scans, with the default odometry."""
        return [Pair(self.partner.odometry, scans) for scans in self.scans]

    @classmethod
    def of(cls, options: Options, data: DataSet) -> "Chosen":
        """Choose methods. The default pair has no networks if the shipped ones do not support the radar."""
        partner = best_methods(data.cases[0].config)[0] if options.shipped else BEST

        def compared(known: Mapping[str, Method]) -> tuple[str, ...]:
            named = [name for name in options.methods if name in known]
            return tuple(named or (name for name, method in known.items() if not method.pictures))

        return cls(compared(ODOMETRY), compared(SCANS), Pair(**partner))


@dataclass(frozen=True)
class Benchmark:
    """Definition of a comparison.

    Attributes:
        title: title of the page.
        about: description in a sentence.
        pairs: returns the pairs of methods to run.
        tables: returns the tables of a study that has run.
        split: kind of splits whose test recordings are used, see `DataSet.splits`; None: all recordings.
        timed: whether it measures run times, on the first recording.
        lacks: returns a sentence if a data set is not suitable; else an empty string.
        draw: adds figures to the page, below the tables.
        picture: returns a figure of a study and its tables, or None.
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
    """A benchmark on other data than folders of recordings.

    Attributes:
        about: description in a sentence.
        compare: called with the folder of data, the folder to write, and the options of ``radarize benchmark`` by name.
    """

    about: str
    compare: Callable[..., None]


BENCHMARKS: Plugins["Benchmark | OwnBenchmark"] = Plugins("radarize.benchmarks", "benchmark")


@dataclass
class Study:
    """A benchmark on a data set.

    Attributes:
        benchmark: definition of the comparison.
        data: data set.
        output: folder of all runs.
        options: options of the comparison.
        chosen: methods that are compared.
        splits: test recordings by name of the split.
        networks: networks of each split.
        trainings: trainings that the runs need.
        results: result of each step, or the sentence of its error.
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
        """Plan the steps of a benchmark.

        Raises:
            InputError: an unknown method, no method that the benchmark compares, or a data set that is not suitable.
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
        """Pairs of methods that are run."""
        return list(dict.fromkeys(self.benchmark.pairs(self.chosen)))

    @property
    def kinds(self) -> list[str]:
        """Kinds of network that the methods need."""
        return list(dict.fromkeys(kind for pair in self.pairs for kind in pair.networks))

    @property
    def cases(self) -> list[Case]:
        """Test recordings, each once, in the order of the data set."""
        tested = {case for cases in self.splits.values() for case in cases}
        return [case for case in self.data.cases if case in tested]

    @property
    def runs(self) -> list[tuple[str, RunStep]]:
        """All runs with their splits, ordered by recording, so that its file is in the cache after the first run."""
        return [
            # Methods without networks do not depend on the split.
            (split, RunStep(case, pair, self.networks[split] if pair.networks else Networks()))
            for split, cases in self.splits.items()
            for case in cases
            for pair in self.pairs
        ]

    @property
    def timings(self) -> list[Timing]:
        """Measurements of run time, on the first recording."""
        split, cases = next(iter(self.splits.items()))
        return [Timing(cases[0], pair, self.networks[split]) for pair in self.pairs]

    @property
    def steps(self) -> list[Step]:
        """All long steps, in order."""
        return [*self.trainings, *(self.timings if self.benchmark.timed else (run for _, run in self.runs))]

    def of(self, pair: Pair, once: bool = True) -> pd.DataFrame:
        """Return the metrics of the successful runs of a pair, one row per run.

        Args:
            pair: methods.
            once: each run once, in the order of recordings; else once per split in which it is tested.

        Returns:
            Columns ``run`` (`RunStep`), ``split``, ``recording`` (name), and every metric of
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
        """Yield for each group (platforms, buildings, all) and pair: the pair, the group's columns of a table, and the
        rows of `of`."""
        found = {pair: self.of(pair) for pair in self.pairs}
        for name, members in groups(self.cases).items():
            for pair, runs in found.items():
                here = runs[runs["recording"].isin([case.name for case in members])]
                if len(here):
                    yield pair, {"on": name, "recordings": len(here)}, here

    def publish(self) -> Results:
        """Return the tables with their provenance."""
        splits = [f"Test recordings of the splits {', '.join(self.splits)}."] if len(self.splits) > 1 else []
        return Results(
            self.benchmark.title,
            self.benchmark.tables(self),
            self.data.data([self.timings[0].case] if self.benchmark.timed else self.cases),
            self.used,
            self.options.command,
            [*splits, *self.left_out, *self.shortfalls],
        )

    @property
    def used(self) -> tuple[UsedNetwork, ...]:
        """Networks that were used."""
        found = [one for networks in self.networks.values() for one in networks.used(self.kinds)]
        return tuple(dict.fromkeys(found))

    @property
    def left_out(self) -> list[str]:
        """Sentence on requested methods that are in none of the pairs."""
        compared = {name for pair in self.pairs for name in (pair.odometry, pair.scans)}
        rest = [name for name in self.options.methods if name not in compared]
        return [f"Requested methods that this benchmark does not compare: {', '.join(rest)}."] if rest else []

    @property
    def shortfalls(self) -> list[str]:
        """Sentences on trainings and runs that failed."""
        found = []
        for training in self.trainings:
            if isinstance(reason := self.results.get(training), str):
                found.append(f"{training.split}: {self._plain(reason)}.")
        steps = dict.fromkeys(step for step in self.steps if isinstance(step, RunStep | Timing))
        for pair in self.pairs:
            of_pair = [self.results.get(step) for step in steps if step.pair == pair]
            reasons = [self._plain(found) for found in of_pair if isinstance(found, str)]
            if reasons:
                found.append(f"{pair}: failed on {len(reasons)} of {len(of_pair)} recordings ({reasons[0]}).")
        return found

    def _plain(self, reason: str) -> str:
        """Remove folders from the sentence of an error."""
        for folder in (self.output, self.data.folder, Path(__file__).parents[1]):
            reason = reason.replace(f"{folder}/", "").replace(f"{folder.resolve()}/", "")
        return reason


def carry_out(studies: Sequence[Study], progress: Callable[[int, int], None]) -> None:
    """Execute the steps of studies with the same options, each step once, and store the results in the studies.

    Raises:
        InputError: all runs failed.
    """
    steps = [step for study in studies for step in study.steps]
    # Trainings before runs, and runs before timings, which need idle cores.
    steps.sort(key=lambda step: (Training, RunStep, Timing).index(type(step)))
    options = studies[0].options
    results = perform(steps, studies[0].output, options.workers, progress, options.ray)
    for study in studies:
        study.results = results
    done = [found for step, found in results.items() if not isinstance(step, Training)]
    if done and all(isinstance(found, str) for found in done):
        raise InputError(f"nothing could be compared: {done[0]}")
