"""The networks that methods are run with: those that are shipped, a folder of the user's, or trained for a split."""

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

#: File with what a training began with, so that no other goes on from its checkpoint.
BEGUN = "begun.json"


@dataclass(frozen=True)
class Networks:
    """Where weights come from.

    Attributes:
        label: what runs with them are called: ``shipped``, ``given``, or the split that they were trained on.
        folder: of the files; None: those that come with the package.
    """

    label: str = "shipped"
    folder: Path | None = field(default=None, compare=False)

    @property
    def weights(self) -> Weights:
        """For methods."""
        return Weights(self.folder)

    def identity(self, kinds: Iterable[str]) -> dict[str, str]:
        """What tells the files of some kinds from others."""
        return {kind: of_file(self.weights.of(kind)) for kind in kinds}

    def used(self, kinds: Iterable[str]) -> tuple[UsedNetwork, ...]:
        """What the files of some kinds say of themselves, those that can be read."""
        found = []
        for kind in kinds:
            with suppress(InputError):  # a method that needs it says why it could not run
                found.append(UsedNetwork.of(self.weights.of(kind)))
        return tuple(found)


@dataclass(frozen=True)
class Training:
    """A network of a kind, trained on a split's training part.

    Attributes:
        split, kind: of the data set; of network.
        data: folder of the data set.
        epochs: at most; None: the task's own.
        seed: of the training.
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
        """An epoch over ten frames takes about as long as a run over two."""
        return self.settings.epochs * len(self._members("train")) * 120

    @property
    def settings(self) -> Settings:
        """The task's own, but for what is asked for; few epochs are for the schedule that makes the most of them."""
        own = replace(find_task(self.kind).defaults, seed=self.seed)
        return replace(own, epochs=self.epochs, schedule="cosine") if self.epochs else own

    def identity(self) -> dict[str, object]:
        """All that the network depends on: sources, settings, and what is in the recordings."""
        found = {
            "split": self.split,
            "kind": self.kind,
            "settings": asdict(self.settings),
            "code": of_code(),
            **{part: {path.name: of_file(path) for path in self._members(part)} for part in ("train", "validation")},
        }
        return json.loads(json.dumps(found))  # as it will be read again

    def _members(self, part: str) -> list[Path]:
        """Recordings of a part; none where the training is to say why there are none."""
        try:
            return recordings(self.data, self.split, part)
        except InputError:
            return []

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        lines: list[str] = []

        def say(line: str) -> None:
            lines.append(line)
            report(min(len(lines) / self.settings.epochs, 1.0))

        output, begun = folder.with_name(f"{self.kind}.safetensors"), folder / BEGUN
        folder.mkdir(parents=True, exist_ok=True)
        if not begun.is_file() or read_json(begun) != self.identity():
            output.with_suffix(".checkpoint").unlink(missing_ok=True)
            write_whole(begun, json.dumps(self.identity(), indent=1))
        try:
            train(self.kind, self.data, output, self.settings, TrainOptions(self.split, resume=True), log=say)
        except InputError as error:
            raise InputError(f"{self.kind} could not be trained: {error}") from error
        return {"log": lines}
