"""Training tasks of the artefact: squared errors instead of likelihoods, its labels and augmentations."""

import math
from collections.abc import Iterable

import torch
from jaxtyping import Float, UInt8
from torch import Generator, Tensor, nn

from radarize.baselines.published import labels
from radarize.baselines.published.maps import DOPPLER, LEVEL, RANGE
from radarize.baselines.published.networks import (
    PublishedRotationNet,
    PublishedSegmentationNet,
    PublishedTranslationNet,
)
from radarize.learning.features import augment
from radarize.learning.features.table import YAW, FeatureTable, Reading
from radarize.learning.nets.weights import Network
from radarize.learning.task import Motion, Settings, turns
from radarize.learning.training.tasks import Rotation, Segmentation, Translation
from radarize.signal.maps import Maps


class Plain(Motion):
    """Base class of tasks of networks without uncertainty, evaluated by their squared errors."""

    steepest = math.inf

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Set the covariance of all estimates to the mean squared validation error."""
        squared = torch.cat([(net.estimate(maps)[0] - label).square() for maps, label in batches])
        net.get_buffer("error").copy_(squared.mean(dim=0).clamp_min(1e-6))


class PublishedTranslation(Plain):
    """Training task: mean velocity since the previous frame, m/s."""

    network, error, size = PublishedTranslationNet, Translation.error, Translation.size
    maps, truth = tuple(DOPPLER), (Reading("published_velocity", "truth/pose", labels.velocity),)
    defaults = Settings(width=64, frames=1, patience=30)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        """Reverse the velocity of half of the items. Zero Doppler is the lower edge of row 30 of 60, which becomes row
        29."""
        back = augment.chosen(maps, generator)
        return torch.where(back, maps.flip(3), maps), torch.where(back.flatten(1), -label, label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        """Return the root mean squared error of the batch, for each of its items."""
        return (net(maps) - label).square().mean().sqrt().expand(len(maps))

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        judged = super().judge(net, maps, label)
        judged[:, 0] = judged[:, 1] / label.shape[1]
        return judged

    def metrics(self, means: Tensor) -> dict[str, float]:
        found = super().metrics(means)
        return found | {"loss": found["loss"] ** 0.5}


class PublishedRotation(Plain):
    """Training task: change of yaw over one to four frames of 15 Hz, rad."""

    network, error, size, reach = PublishedRotationNet, Rotation.error, Rotation.size, Rotation.reach
    maps, truth = tuple(RANGE), (YAW,)
    optimiser = torch.optim.AdamW
    least_frames = 2
    defaults = Settings(width=64, patience=30)

    def label(self, table: FeatureTable, frames: Tensor) -> Tensor:
        return turns(table, frames)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        """Reverse half of the items in time; none are mirrored."""
        back = augment.chosen(maps, generator)
        return torch.where(back, maps.flip(1), maps), torch.where(back.flatten(1), -label, label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        """Return the sum of squared errors forward and in reversed time."""
        forth, back = net(torch.cat([maps, maps.flip(1)])).chunk(2)
        return ((label - forth).square() + (-label - back).square()).squeeze(1)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        mean, covariance = net.estimate(maps)
        judged = self._judged(mean, covariance, label)
        judged[:, 0] = self.loss(net, maps, label)
        return judged


class PublishedSegmentation(Segmentation):
    """Training task: occupancy by the depth picture, near the sensor's plane."""

    network, steepest = PublishedSegmentationNet, math.inf
    maps, truth = (*RANGE, *LEVEL), (Reading("published_occupancy", "truth/depth", labels.occupancy),)
    defaults = Settings(width=64, frames=1, epochs=5, batch=48, rate=1e-4, betas=(0.8, 0.9))

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        """Mirror half of the items, column by column, as in the artefact, though the grids are not symmetric."""
        left = augment.chosen(maps, generator)
        return torch.where(left, maps.flip(4), maps), torch.where(left[:, :, 0, 0], label.flip(2), label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return pooled_dice(net(maps), label).expand(len(maps))

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        logits = net(maps)
        loss = torch.stack([pooled_dice(one[None], truth[None]) for one, truth in zip(logits, label, strict=True)])
        return self._judged(loss, logits.argmax(dim=1) == 1, label == 1)

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Do nothing: probabilities are used as they are."""


def pooled_dice(
    logits: Float[Tensor, "item 2 range bearing"], label: UInt8[Tensor, "item range bearing"]
) -> Float[Tensor, ""]:
    """Return the Dice loss with sums over items and both classes, which equals 1 - mean probability of the true class.
    All cells have the same weight, though only 1 % of them are occupied."""
    truth = torch.stack([label == 0, label == 1], dim=1).float()
    likely = logits.softmax(dim=1)
    return 1 - 2 * (likely * truth).sum() / (likely.sum() + truth.sum())
