"""The three trainings: which maps, which labels, which loss, and the paper's hyper-parameters (its section 5)."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Generator, Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from radarize.nets.gaussian import Gaussian
from radarize.nets.maps import Maps
from radarize.nets.weights import Grid, make
from radarize.training import augment, losses
from radarize.training.table import Table

#: What a network reads, one tensor or several.
Inputs = Tensor | tuple[Tensor, ...]


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


class Task(ABC):
    """What the trainer needs to know of a network's task.

    Attributes:
        kind: key of `radarize.nets.NETS`.
        setting: key of `radarize.settings.SETTINGS`.
        maps: that its network reads.
        sensed: what else it reads, keys of `radarize.training.table.SENSED`.
        truth: that its labels are made of, keys of `radarize.training.table.TRUTH`.
        share: of all windows, which an epoch takes, drawn anew each time: neighbours among long ones are nearly alike.
        reach: s, from one frame of a window to the next, at most; None: the very next. Drawn for every item; the
            farthest is what is validated.
        optimiser: algorithm.
        steepest: norm of the gradient from which it is cut; most are about as large. A likelihood has no bounds: a
            single item that a network is wrongly sure of would undo many steps.
        defaults: settings.
    """

    kind: str
    setting: str = "corrected"
    maps: tuple[str, ...] = ()
    sensed: tuple[str, ...] = ()
    truth: tuple[str, ...]
    share: float = 1.0
    reach: float | None = None
    optimiser: type[torch.optim.Optimizer] = torch.optim.Adam
    steepest: float = 1.0
    defaults: Settings

    @property
    def reads(self) -> tuple[str, ...]:
        """All that its network reads of a frame."""
        return self.maps + self.sensed

    def net(self, settings: Settings, grid: Grid | None) -> nn.Module:
        """A network for maps of a grid, if it reads any, with random weights from torch's generator."""
        return make(self.kind, settings.frames, self.reads, settings.width, grid, self.setting)

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

    def inputs(self, table: Table, frames: Int[Tensor, "item frame"]) -> Inputs:
        """What the network reads of windows."""
        return table.window(frames)

    def label(self, table: Table, frames: Int[Tensor, "item frame"]) -> Tensor:
        """What the network should say of windows."""
        return table.truth[self.truth[0]][frames[:, -1]]

    @abstractmethod
    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        """Items as they might as well have been."""

    @abstractmethod
    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        """What training makes small; calls the network once."""

    @abstractmethod
    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        """Of what `estimate` says of each item: the validation loss, then what `metrics` needs."""

    @abstractmethod
    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        """Names and values, from the means of what `judge` says."""

    @abstractmethod
    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Make a trained network's uncertainty honest on validation data, which is gone through once."""


class Motion(Task):
    """Velocity or turn.

    Attributes:
        error, size: what the log calls the error and the size of what is told, RMS.
    """

    error: str
    size: str

    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return self._judged(*net.estimate(maps), label)

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

    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        net.spread.zero_()
        normalised = torch.cat([self.judge(net, *batch)[:, 3] for batch in batches])
        net.spread.fill_(0.5 * normalised.mean().log())


class Translation(Motion):
    """Velocity, m/s."""

    kind, truth = "translation", ("velocity",)
    error, size = "rmse_m_s", "rms_speed_m_s"
    maps = ("doppler_azimuth", "doppler_elevation_aware")
    defaults = Settings(frames=2)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left, back = (augment.chosen(maps, generator) for _ in range(2))
        maps = torch.where(left, augment.mirrored(maps), maps)
        maps = torch.where(back, augment.receding(maps), maps)
        label = torch.where(left.flatten(1), label * label.new_tensor([1.0, -1.0]), label)
        label = torch.where(back.flatten(1), -label, label)
        maps = augment.other_radar(maps, generator, doppler=True)
        return (augment.lost_frames(maps, generator) if maps.shape[1] > 1 else maps), label

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return losses.likelihood(net(maps), label.repeat(2, 1)).unflatten(0, (2, -1)).mean(dim=0)


class Rotation(Motion):
    """Turn, rad, over up to 0.27 s: the paper's 4 frames of 15 Hz.

    Labels are turn and travel; the latter is what the network is told, off by as much as velocities are in use.
    """

    kind, truth = "rotation", ("yaw", "velocity")
    error, size = "rmse_rad", "rms_turn_rad"
    maps = ("range_azimuth",)
    reach = 4 / 15
    defaults = Settings()
    #: m, standard deviation of the travel that is told.
    doubt = 0.01

    def label(self, table: Table, frames: Tensor) -> Float[Tensor, "item 3"]:
        """Turn (rad) and travel (m): the mean of the velocities at the window's ends times its duration."""
        velocity, first, last = table.truth["velocity"], frames[:, 0], frames[:, -1]
        duration = (last - first)[:, None] * table.frame_period
        return torch.cat([turns(table, frames), duration * (velocity[first] + velocity[last]) / 2], dim=1)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left = augment.chosen(maps, generator)
        maps = torch.where(left, augment.mirrored(maps), maps)
        label = torch.where(left.flatten(1), label * label.new_tensor([-1.0, 1.0, -1.0]), label)
        off = torch.randn((len(label), 2), generator=generator, device=label.device)
        label = torch.cat([label[:, :1], label[:, 1:] + self.doubt * off], dim=1)
        return augment.other_radar(maps, generator, doppler=False), label

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return losses.cyclic(net(maps, label[:, 1:]), label[:, :1])

    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return self._judged(*net.estimate(maps, label[:, 1:]), label[:, :1])


class Segmentation(Task):
    """Occupancy."""

    kind, truth = "segmentation", ("occupancy",)
    maps = ("range_azimuth", "elevation_aware")
    defaults = Settings(frames=1, epochs=5, batch=48, rate=1e-4, betas=(0.8, 0.9))
    #: Cells of range by which a first surface may be off to count as found: 9 cm.
    near = 2

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left = augment.chosen(maps, generator)
        maps = torch.where(left, augment.mirrored(maps), maps)
        label = torch.where(left[:, :, 0, 0], augment.mirrored_columns(label, losses.UNKNOWN), label)
        return augment.other_radar(maps, generator, doppler=False), label

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return losses.surfaces(net(maps), label)

    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        logits = net(maps)
        found, truth = first_cell(logits > 0), first_cell(label == losses.SURFACE)
        there = truth < label.shape[1]
        near = ((found - truth).abs() <= self.near) & there
        return torch.stack([losses.surfaces(logits, label), near.sum(dim=1), there.sum(dim=1)], dim=1)

    def metrics(self, means: Tensor) -> dict[str, float]:
        loss, near, there = means.tolist()
        return {"loss": loss, "share_found_within_9_cm": near / max(there, 1e-9)}

    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """By plain likelihood: multiplied along a bearing, cells' probabilities are that of its first surface."""
        pairs = [(net(maps)[:, :, ::4], label[:, :, ::4]) for maps, label in batches]
        known = [label != losses.UNKNOWN for _, label in pairs]
        logits = torch.cat([found[k] for (found, _), k in zip(pairs, known, strict=True)]).detach()
        truth = torch.cat([label[k] for (_, label), k in zip(pairs, known, strict=True)]).eq(losses.SURFACE).float()
        fit = torch.tensor([1.0, 0.0], device=logits.device, requires_grad=True)
        optimiser = torch.optim.LBFGS([fit], line_search_fn="strong_wolfe", max_iter=30)

        def closure() -> Tensor:
            optimiser.zero_grad()
            loss = binary_cross_entropy_with_logits(logits * fit[0] + fit[1], truth)
            loss.backward()
            return loss

        with torch.enable_grad():
            optimiser.step(closure)
        net.scale.copy_(fit[0].detach())
        net.offset.copy_(fit[1].detach())


def turns(table: Table, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item 1"]:
    """Change of yaw from the first frame of windows to the last, rad."""
    yaw = table.truth["yaw"]
    return torch.remainder(yaw[frames[:, -1]] - yaw[frames[:, 0]] + torch.pi, 2 * torch.pi) - torch.pi


def first_cell(cells: Tensor) -> Int[Tensor, "item bearing"]:
    """Range bin of the first true cell per bearing; the number of bins where there is none."""
    return torch.where(cells.any(dim=1), cells.int().argmax(dim=1), cells.shape[1])


#: Tasks by name.
TASKS = {task.kind: task() for task in (Translation, Rotation, Segmentation)}
