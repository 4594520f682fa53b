"""What a training needs to know of a network: what it sees, its labels, its loss, its hyper-parameters."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

import torch
from jaxtyping import Float, Int
from torch import Generator, Tensor, nn

from radarize.io.plugins import Plugins
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable, Reading
from radarize.learning.nets.gaussian import Gaussian
from radarize.learning.nets.weights import Header, Network, build
from radarize.signal.maps import Maps

#: What a network reads of items: one tensor, or several.
Inputs = TypeVar("Inputs", Tensor, tuple[Tensor, ...])


@dataclass(frozen=True)
class Settings:
    """Hyper-parameters.

    Attributes:
        width: of the network; the paper's is 64.
        frames: of a window.
        epochs, batch, rate, betas: of Adam; a batch is what all processes take together.
        schedule: of the rate: ``plateau``, or ``cosine``, which warms up and then falls to nothing in the last epoch:
            as good in a third of the epochs; or ``steps``: to three quarters every 25 epochs.
        plateau: epochs without a better validation loss after which the rate halves.
        patience: such epochs after which training ends.
        precision: of convolutions, ``float32`` or ``bfloat16``.
        seed: of weights, order and augmentation.
    """

    width: int = 16
    frames: int = 2
    epochs: int = 30
    batch: int = 128
    rate: float = 1e-3
    betas: tuple[float, float] = (0.9, 0.999)
    schedule: str = "plateau"
    plateau: int = 10
    patience: int = 15
    precision: str = "float32"
    seed: int = 0


class Task(ABC, Generic[Inputs]):
    """What the trainer needs to know of a network's task.

    Attributes:
        network: class of the network.
        maps: that its network reads.
        sensed: what else it reads.
        truth: that its labels are made of.
        share: of all windows, which an epoch takes, drawn anew each time: neighbours among long ones are nearly alike.
        reach: s, from one frame of a window to the next, at most; None: the very next. Drawn for every item; the
            farthest is what is validated.
        least_frames: of a window, for what it estimates.
        optimiser: algorithm.
        steepest: norm of the gradient from which it is cut; most are about as large. A likelihood has no bounds: a
            single item that a network is wrongly sure of would undo many steps.
        defaults: settings.
    """

    network: type[Network]
    maps: tuple[str, ...] = ()
    sensed: tuple[Reading, ...] = ()
    truth: tuple[Reading, ...]
    share: float = 1.0
    reach: float | None = None
    least_frames: int = 1
    optimiser: Callable[..., torch.optim.Optimizer] = torch.optim.Adam
    steepest: float = 1.0
    defaults: Settings

    @property
    def reads(self) -> tuple[str, ...]:
        """All that its network reads of a frame."""
        return (*self.maps, *(reading.name for reading in self.sensed))

    def header(self, settings: Settings, grid: MapGrid | None, **about: Any) -> Header:
        """What its weights' file says; see `Header` for what else to say."""
        return Header(
            kind=self.network.kind, setting=self.network.setting, frames=settings.frames, maps=self.reads,
            width=settings.width, grid=grid, seed=settings.seed, **about,
        )  # fmt: skip

    def net(self, settings: Settings, grid: MapGrid | None) -> Network:
        """A network for maps of a grid, if it reads any, with random weights from torch's generator."""
        return build(self.network, self.header(settings, grid))

    def table(
        self,
        paths: Sequence[Path],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: MapGrid | None = None,
    ) -> FeatureTable:
        """All that it reads of recordings, see `FeatureTable.read`."""
        return FeatureTable.read(paths, self.maps, self.truth, self.sensed, self.network.maker, workers, progress, grid)

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        """The algorithm, at work."""
        return self.optimiser(parameters, settings.rate, settings.betas)

    def spacings(self, frame_period: float) -> Sequence[int]:
        """Frames from one of a window to the next, for frames that come every `frame_period` (s)."""
        return range(1, 2 if self.reach is None else max(2, round(self.reach / frame_period) + 1))

    def frames(
        self, starts: Int[Tensor, "item"], spacing: Int[Tensor, "item"], count: int
    ) -> Int[Tensor, "item frame"]:
        """Frames of windows."""
        return starts[:, None] + spacing[:, None] * torch.arange(count)

    def inputs(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Inputs:
        """What the network reads of windows."""
        return cast(Inputs, table.window(frames))  # tasks that read several tensors have their own

    def label(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Tensor:
        """What the network should say of windows."""
        return table.truth[self.truth[0].name][frames[:, -1]]

    def items(
        self, table: FeatureTable, starts: Int[Tensor, "item"], spacing: Int[Tensor, "item"], count: int
    ) -> tuple[Inputs, Tensor]:
        """What the network reads of windows of so many frames, and what it should say."""
        frames = self.frames(starts, spacing, count)
        return self.inputs(table, frames), self.label(table, frames)

    @abstractmethod
    def augment(self, maps: Inputs, label: Tensor, generator: Generator) -> tuple[Inputs, Tensor]:
        """Items as they might as well have been."""

    @abstractmethod
    def loss(self, net: nn.Module, maps: Inputs, label: Tensor) -> Float[Tensor, "item"]:
        """What training makes small; calls the network once."""

    @abstractmethod
    def judge(self, net: Network, maps: Inputs, label: Tensor) -> Float[Tensor, "item number"]:
        """Of what `estimate` says of each item: the validation loss, then what `metrics` needs."""

    @abstractmethod
    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        """Names and values, from the means of what `judge` says."""

    @abstractmethod
    def calibrate(self, net: Network, batches: Iterable[tuple[Inputs, Tensor]]) -> None:
        """Make a trained network's uncertainty honest on validation data, which is gone through once."""


class Motion(Task[Tensor]):
    """Velocity or turn.

    Attributes:
        error, size: what the log calls the error and the size of what is told, RMS.
    """

    error: str
    size: str

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        mean, covariance = net.estimate(maps)
        return self._judged(mean, covariance, label)

    def _judged(self, mean: Tensor, covariance: Tensor, label: Tensor) -> Tensor:
        found = Gaussian(mean, torch.linalg.cholesky(covariance))
        squared = (mean - label).square().sum(dim=1)
        trivial = label.square().sum(dim=1)
        normalised = found.errors_squared(label) / mean.shape[1]
        return torch.stack([found.negative_log_likelihood(label), squared, trivial, normalised], dim=1)

    def metrics(self, means: Tensor) -> dict[str, float]:
        loss, squared, trivial, normalised = means.tolist()
        return {
            "loss": loss,
            self.error: squared**0.5,
            self.size: trivial**0.5,
            "normalised_error_squared": normalised,
        }

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        spread = net.get_buffer("spread")
        spread.zero_()
        normalised = torch.cat([self.judge(net, *batch)[:, 3] for batch in batches])
        spread.fill_(0.5 * normalised.mean().log())


def turns(table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item 1"]:
    """Change of yaw from the first frame of windows to the last, rad."""
    yaw = table.truth["yaw"]
    return torch.remainder(yaw[frames[:, -1]] - yaw[frames[:, 0]] + torch.pi, 2 * torch.pi) - torch.pi


def first_cell(cells: Tensor) -> Int[Tensor, "item bearing"]:
    """Range bin of the first true cell per bearing; the number of bins where there is none."""
    return torch.where(cells.any(dim=1), cells.int().argmax(dim=1), cells.shape[1])


#: Trainings by the kind of network: entry points of the group ``radarize.tasks``, classes without arguments.
TASKS: Plugins[type[Task]] = Plugins("radarize.tasks", "task")


def find_task(kind: str) -> Task:
    """Return a network's training.

    Raises:
        InputError: there is none of this name.
    """
    return TASKS.find(kind)()
