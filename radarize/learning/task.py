"""Definition of a network's training: inputs, labels, loss, hyper-parameters."""

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

#: Inputs of a network: one tensor, or several.
Inputs = TypeVar("Inputs", Tensor, tuple[Tensor, ...])


@dataclass(frozen=True)
class Settings:
    """Hyper-parameters of a training.

    Attributes:
        width: width of the network; 64 in the paper.
        frames: number of frames of a window.
        epochs, batch, rate, betas: of Adam; the batch is divided among all processes.
        schedule: schedule of the learning rate: ``plateau``; ``cosine``, with warm-up and decay to zero in the last
            epoch, equally good in a third of the epochs; or ``steps``: times 0.75 every 25 epochs.
        plateau: epochs without lower validation loss after which the rate halves.
        patience: epochs without lower validation loss after which training ends.
        precision: precision of convolutions, ``float32`` or ``bfloat16``.
        seed: seed of initial weights, order and augmentation.
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
    """Definition of a network's training.

    Attributes:
        network: class of the network.
        maps: maps that are its input.
        sensed: other inputs.
        truth: truth from which labels are computed.
        share: share of all windows in an epoch, drawn anew each time; neighbouring windows of long walks are similar.
        reach: maximum time between frames of a window, s; None: consecutive frames. Drawn per item; validation uses the
            maximum.
        least_frames: minimum number of frames of a window.
        optimiser: class of the optimiser.
        steepest: norm to which gradients are clipped; most are about as large. Likelihood is unbounded: one item with a
            large error and a small estimated variance would undo many steps.
        defaults: default hyper-parameters.
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
        """Names of all inputs from a frame."""
        return (*self.maps, *(reading.name for reading in self.sensed))

    def header(self, settings: Settings, grid: MapGrid | None, **about: Any) -> Header:
        """Return the header of its file of weights; see `Header` for `about`."""
        return Header(
            kind=self.network.kind, setting=self.network.setting, frames=settings.frames, maps=self.reads,
            width=settings.width, grid=grid, seed=settings.seed, **about,
        )  # fmt: skip

    def net(self, settings: Settings, grid: MapGrid | None) -> Network:
        """Return a network for maps of a grid, with random weights from torch's generator."""
        return build(self.network, self.header(settings, grid))

    def table(
        self,
        paths: Sequence[Path],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: MapGrid | None = None,
    ) -> FeatureTable:
        """Read all inputs and truth from recordings, see `FeatureTable.read`."""
        return FeatureTable.read(paths, self.maps, self.truth, self.sensed, self.network.maker, workers, progress, grid)

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        """Return the optimiser."""
        return self.optimiser(parameters, settings.rate, settings.betas)

    def spacings(self, frame_period: float) -> Sequence[int]:
        """Return the spacings between frames of a window, for a frame period (s)."""
        return range(1, 2 if self.reach is None else max(2, round(self.reach / frame_period) + 1))

    def frames(
        self, starts: Int[Tensor, "item"], spacing: Int[Tensor, "item"], count: int
    ) -> Int[Tensor, "item frame"]:
        """Return the frames of windows."""
        return starts[:, None] + spacing[:, None] * torch.arange(count)

    def inputs(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Inputs:
        """Return the network's inputs for windows."""
        return cast(Inputs, table.window(frames))  # overridden by tasks with several inputs

    def label(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Tensor:
        """Return the expected output for windows."""
        return table.truth[self.truth[0].name][frames[:, -1]]

    def items(
        self, table: FeatureTable, starts: Int[Tensor, "item"], spacing: Int[Tensor, "item"], count: int
    ) -> tuple[Inputs, Tensor]:
        """Return inputs and expected output for windows of `count` frames."""
        frames = self.frames(starts, spacing, count)
        return self.inputs(table, frames), self.label(table, frames)

    @abstractmethod
    def augment(self, maps: Inputs, label: Tensor, generator: Generator) -> tuple[Inputs, Tensor]:
        """Return randomly changed items of equal probability."""

    @abstractmethod
    def loss(self, net: nn.Module, maps: Inputs, label: Tensor) -> Float[Tensor, "item"]:
        """Return the loss, calling the network once."""

    @abstractmethod
    def judge(self, net: Network, maps: Inputs, label: Tensor) -> Float[Tensor, "item number"]:
        """Evaluate `estimate` per item: validation loss, then the numbers that `metrics` needs."""

    @abstractmethod
    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        """Return metrics by name, from the means of the numbers from `judge`."""

    @abstractmethod
    def calibrate(self, net: Network, batches: Iterable[tuple[Inputs, Tensor]]) -> None:
        """Calibrate a trained network's uncertainty on validation data, which is iterated once."""


class Motion(Task[Tensor]):
    """Base class for velocity and rotation.

    Attributes:
        error, size: names of the RMS error and of the RMS true value in the log.
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
    """Return the change of yaw from the first frame of windows to the last, rad."""
    yaw = table.truth["yaw"]
    return torch.remainder(yaw[frames[:, -1]] - yaw[frames[:, 0]] + torch.pi, 2 * torch.pi) - torch.pi


def first_cell(cells: Tensor) -> Int[Tensor, "item bearing"]:
    """Return the range bin of the first true cell per bearing; the number of bins if there is none."""
    return torch.where(cells.any(dim=1), cells.int().argmax(dim=1), cells.shape[1])


#: Trainings by kind of network: entry points of the group ``radarize.tasks``, classes without arguments.
TASKS: Plugins[type[Task]] = Plugins("radarize.tasks", "task")


def find_task(kind: str) -> Task:
    """Return the training of a network.

    Raises:
        InputError: there is none of this name.
    """
    return TASKS.find(kind)()
