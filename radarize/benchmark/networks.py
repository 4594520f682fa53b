"""The networks that methods are run with: those that are shipped, a folder of the user's, or trained for a split."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from radarize.benchmark.steps import Report
from radarize.errors import InputError
from radarize.methods.registry import Weights, find_task
from radarize.training.dataset import recordings
from radarize.training.train import train


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

    def digests(self, kinds: tuple[str, ...]) -> dict[str, str]:
        """What tells the files of some kinds from others."""
        return {kind: _digest(self.weights.of(kind)) for kind in kinds}


def _digest(path: Path) -> str:
    if not path.is_file():
        return "none"
    about = path.stat()
    return _digest_of(path, about.st_size, about.st_mtime_ns)


@lru_cache
def _digest_of(path: Path, size: int, changed: int) -> str:
    return sha256(path.read_bytes()).hexdigest()[:16]


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
        count = len(recordings(self.data, self.split, "train"))
        return self._epochs * count * 120

    @property
    def _epochs(self) -> int:
        return self.epochs or find_task(self.kind).defaults.epochs

    def identity(self) -> dict[str, object]:
        members = {part: [path.name for path in recordings(self.data, self.split, part)] for part in ("train",)}
        return {"split": self.split, "kind": self.kind, "epochs": self._epochs, "seed": self.seed, **members}

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        settings = find_task(self.kind).defaults
        if self.epochs:
            # Few epochs are for the schedule that makes the most of them.
            settings = replace(settings, epochs=self.epochs, schedule="cosine")
        lines: list[str] = []

        def say(line: str) -> None:
            lines.append(line)
            report(min(len(lines) / self._epochs, 1.0))

        output = folder.with_name(f"{self.kind}.safetensors")
        output.parent.mkdir(parents=True, exist_ok=True)
        try:
            train(
                self.kind, self.data, output, split=self.split, settings=replace(settings, seed=self.seed), resume=True,
                say=say,
            )  # fmt: skip
        except InputError as error:
            raise InputError(f"{self.kind} could not be trained: {error}") from error
        return {"log": lines}
