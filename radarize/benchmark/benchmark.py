"""A comparison of methods: what it runs on which recordings, and the tables that come of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from radarize.benchmark.dataset import Case, DataSet
from radarize.benchmark.networks import Networks, Training
from radarize.benchmark.runs import Pair, Run, Timing
from radarize.benchmark.steps import Step, perform
from radarize.benchmark.table import Table
from radarize.errors import InputError
from radarize.methods.registry import BEST, ODOMETRY, SCANS, best_methods
from radarize.report.page import Page


@dataclass(frozen=True)
class Chosen:
    """What is compared, by default all that there is.

    Attributes:
        odometry, scans: methods, keys of `radarize.methods.ODOMETRY` and `SCANS`.
        partner: what is run with methods of the other sort when these are compared.
    """

    odometry: tuple[str, ...]
    scans: tuple[str, ...]
    partner: Pair

    @classmethod
    def of(cls, methods: Sequence[str], data: DataSet, networks: Networks, trained: bool) -> "Chosen":
        """Methods by name, of one sort or of both; all of a sort where none of it is named.

        Raises:
            InputError: an unknown name.
        """
        if unknown := [name for name in methods if name not in (*ODOMETRY, *SCANS)]:
            raise InputError(f"methods names {unknown[0]!r}, expected some of: {', '.join((*ODOMETRY, *SCANS))}")
        own = trained or networks.folder is not None
        partner = BEST if own else best_methods(data.cases[0].config)[0]
        odometry, scans = (tuple(n for n in methods if n in known) or tuple(known) for known in (ODOMETRY, SCANS))
        return cls(odometry, scans, Pair(**partner))


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
    """

    title: str
    about: str
    pairs: Callable[[Chosen], list[Pair]]
    tables: Callable[["Study"], list[Table]]
    split: str | None = None
    timed: bool = False
    lacks: Callable[[DataSet], str] = lambda data: ""
    draw: Callable[["Study", Page], None] = lambda study, page: None


@dataclass
class Study:
    """A benchmark on a data set.

    Attributes:
        benchmark, data: which, on what.
        output: folder of all runs.
        pairs: methods that are compared.
        splits: name to recordings.
        networks: of each split.
        protocols: names, see `radarize.benchmark.protocol`.
        trainings: that its runs need.
        results: what each step found, or why it could not be done.
    """

    benchmark: Benchmark
    data: DataSet
    output: Path
    chosen: Chosen
    splits: dict[str, list[Case]]
    networks: dict[str, Networks]
    protocols: tuple[str, ...]
    trainings: list[Training] = field(default_factory=list)
    results: dict[Step, dict | str] = field(default_factory=dict)

    @classmethod
    def plan(
        cls,
        benchmark: Benchmark,
        data: DataSet,
        output: Path,
        methods: Sequence[str] = (),
        weights: Path | None = None,
        trained: bool = False,
        epochs: int | None = None,
        protocols: tuple[str, ...] = ("paper", "mended"),
    ) -> "Study":
        """Look what is to be done.

        Raises:
            InputError: an unknown method, or a data set without what the benchmark needs.
        """
        if reason := benchmark.lacks(data):
            raise InputError(f"{data.folder}: {reason}")
        given = Networks() if weights is None else Networks("given", weights)
        chosen = Chosen.of(methods, data, given, trained)
        splits = {"all": list(data.cases)} if benchmark.split is None else data.splits(benchmark.split)
        if not splits:
            raise InputError(f"{data.folder}: no recording tests in a split of kind {benchmark.split}")
        study = cls(benchmark, data, output, chosen, splits, dict.fromkeys(splits, given), protocols)
        if trained and benchmark.split is not None:
            if not data.trainable(benchmark.split):
                raise InputError(
                    f"{data.folder}: its dataset.json has no split of kind {benchmark.split}, expected one to train on"
                )
            study.networks = {name: Networks(name, output / "weights" / name) for name in splits}
            kinds = dict.fromkeys(kind for pair in study.pairs for kind in pair.networks)
            study.trainings = [Training(split, kind, data.folder, epochs) for split in splits for kind in kinds]
        return study

    @property
    def pairs(self) -> list[Pair]:
        """Methods that are run."""
        return list(dict.fromkeys(self.benchmark.pairs(self.chosen)))

    @property
    def runs(self) -> list[Run]:
        """All runs, recording by recording, so that each is read from memory after the first time."""
        return [
            self._run(split, case, pair)
            for split, cases in self.splits.items()
            for case in cases
            for pair in self.pairs
        ]

    def _run(self, split: str, case: Case, pair: Pair) -> Run:
        """Methods without networks are the same in every split."""
        return Run(case, pair, self.networks[split] if pair.networks else Networks())

    @property
    def timings(self) -> list[Timing]:
        """On the first recording."""
        split, cases = next(iter(self.splits.items()))
        return [Timing(cases[0], pair, self.networks[split]) for pair in self.pairs]

    @property
    def steps(self) -> list[Step]:
        """All that takes long, in order."""
        return [*self.trainings, *(self.timings if self.benchmark.timed else self.runs)]

    def of(self, pair: Pair) -> dict[str, list[Run]]:
        """Runs of a pair that ended well, by split."""
        runs = {split: [self._run(split, case, pair) for case in cases] for split, cases in self.splits.items()}
        return {
            split: [run for run in members if isinstance(self.results.get(run), dict)]
            for split, members in runs.items()
        }

    def once(self, pair: Pair) -> list[Run]:
        """Runs of a pair that ended well, each once, in the order of recordings."""
        order = {case: k for k, case in enumerate(self.data.cases)}
        runs = dict.fromkeys(run for members in self.of(pair).values() for run in members)
        return sorted(runs, key=lambda run: order[run.case])

    @property
    def shortfalls(self) -> list[str]:
        """A sentence for each pair, or network, that there is something missing of."""
        found = []
        for training in self.trainings:
            if isinstance(reason := self.results.get(training), str):
                found.append(f"{training.split}: {self._plain(reason)}.")
        steps = self.timings if self.benchmark.timed else dict.fromkeys(self.runs)
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


def carry_out(studies: Sequence[Study], workers: int, progress: Callable[[int, int], None]) -> None:
    """Do what studies need, each step once for all of them, and give them what was found.

    Raises:
        InputError: nothing could be done.
    """
    steps = [step for study in studies for step in study.steps]
    # Networks before runs, and runs before timings, which want quiet cores.
    steps.sort(key=lambda step: (Training, Run, Timing).index(type(step)))
    results = perform(steps, studies[0].output, workers, progress)
    for study in studies:
        study.results = results
    done = [found for step, found in results.items() if not isinstance(step, Training)]
    if done and all(isinstance(found, str) for found in done):
        raise InputError(f"nothing could be compared: {done[0]}")
