"""Networks of the benchmarked methods: the shipped ones, a folder of the user's, or trained on a split."""

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from radarize.evaluation.benchmark.identity import of_code, of_file
from radarize.evaluation.benchmark.results import UsedNetwork
from radarize.evaluation.benchmark.steps import Report
from radarize.io.errors import InputError
from radarize.io.jsonfile import read_json
from radarize.io.replacing import write_whole
from radarize.learning.task import Settings, find_task
from radarize.learning.training.dataset import recordings
from radarize.learning.training.train import TrainOptions, train
from radarize.pipeline.method import Weights

#: File with the inputs of a training; its checkpoint is used again only by a training with the same inputs.
BEGUN = "begun.json"


@dataclass(frozen=True)
class Networks:
    """Source of the weights.

    Attributes:
        label: label of runs with these weights: ``shipped``, ``given``, or the split that they were trained on.
        folder: folder of the files; None: the shipped ones.
    """

    label: str = "shipped"
    folder: Path | None = field(default=None, compare=False)

    @property
    def weights(self) -> Weights:
        """Weights as input of methods."""
        return Weights(self.folder)

    def identity(self, kinds: Iterable[str]) -> dict[str, str]:
        """Return the fingerprints of the weights of some kinds of network."""
        return {kind: of_file(self.weights.of(kind)) for kind in kinds}

    def used(self, kinds: Iterable[str]) -> tuple[UsedNetwork, ...]:
        """Return descriptions of the weights of some kinds of network; unreadable files are left out."""
        found = []
        for kind in kinds:
            with suppress(InputError):  # the method that needs it reports the error
                found.append(UsedNetwork.of(self.weights.of(kind)))
        return tuple(found)


@dataclass(frozen=True)
class Training:
    """Training of a network on the training part of a split.

    Attributes:
        split: split of the data set.
        kind: kind of network.
        data: folder of the data set.
        epochs: maximum number of epochs; None: the default of the task.
        seed: seed of the training.
    """

    split: str
    kind: str
    data: Path = field(compare=False)
    epochs: int | None = None
    seed: int = 0
    alone = True
    together = None

    @property
    def place(self) -> str:
        return f"weights/{self.split}/{self.kind}"

    @property
    def frames(self) -> int:
        """Duration in frames of a run: an epoch over ten frames takes about as long as a run over two."""
        return self.settings.epochs * len(self._members("train")) * 120

    @property
    def settings(self) -> Settings:
        """Settings of the task, with the given seed and epochs; given epochs use the cosine schedule."""
        own = replace(find_task(self.kind).defaults, seed=self.seed)
        return replace(own, epochs=self.epochs, schedule="cosine") if self.epochs else own

    def identity(self) -> dict[str, object]:
        """Return fingerprints of everything that the network depends on: source code, settings, recordings."""
        found = {
            "split": self.split,
            "kind": self.kind,
            "settings": asdict(self.settings),
            "code": of_code(),
            **{part: {path.name: of_file(path) for path in self._members(part)} for part in ("train", "validation")},
        }
        return json.loads(json.dumps(found))  # as read from the file

    def _members(self, part: str) -> list[Path]:
        """Return recordings of a part of the split; none if there are none, which the training reports."""
        try:
            return recordings(self.data, self.split, part)
        except InputError:
            return []

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        lines: list[str] = []

        def log(line: str) -> None:
            lines.append(line)
            report(min(len(lines) / self.settings.epochs, 1.0))

        output, begun = folder.with_name(f"{self.kind}.safetensors"), folder / BEGUN
        folder.mkdir(parents=True, exist_ok=True)
        if not begun.is_file() or read_json(begun) != self.identity():
            output.with_suffix(".checkpoint").unlink(missing_ok=True)
            write_whole(begun, json.dumps(self.identity(), indent=1))
        try:
            train(self.kind, self.data, output, self.settings, TrainOptions(self.split, resume=True), log=log)
        except InputError as error:
            raise InputError(f"{self.kind} could not be trained: {error}") from error
        return {"log": lines}
