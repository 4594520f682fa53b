"""Training on simulated walks: pictures roughened anew in every step, labels by the lidar beside the radar."""

from collections.abc import Iterable

import numpy as np
import torch
from jaxtyping import Float
from torch import Generator, Tensor, nn

from radarize import polar
from radarize.clouds import Apart
from radarize.features.maps import Maps
from radarize.features.table import Reading
from radarize.methods.pictures import roughening
from radarize.methods.pictures.network import COLUMNS, PictureNet
from radarize.methods.pictures.points import points
from radarize.methods.task import Settings, Task

#: Choices for the least probability of a point.
_LEAST = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8)


class Pictures(Task):
    """Points of a lidar from polar pictures; labels are its pictures, packed."""

    network, maps = PictureNet, ("levels",)
    truth = (Reading("lidar", "truth/lidar"),)
    defaults = Settings(width=8, frames=5, epochs=30, batch=16, rate=2e-3, schedule="cosine")
    reads = ("picture",)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        pictures = roughening.rough(maps, generator)
        left = torch.rand(len(maps), generator=generator) < 0.5
        pictures = torch.where(left[:, None, None, None, None], pictures.flip(4), pictures)
        label = unpacked(label)
        return pictures, torch.where(left[:, None, None], label.flip(2), label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return entropy(net(maps), label)

    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        logits, label = net(self._validated(maps)), unpacked(label)
        return torch.stack([entropy(logits, label), self._chamfer(logits.exp(), label, net.least)], dim=1)

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, chamfer = means.tolist()
        return {"loss": loss, "chamfer_m": chamfer}

    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Choose the probability from which a column has a point: the least mean Chamfer distance."""
        total = torch.zeros(len(_LEAST))
        for maps, label in batches:
            probability, label = net.estimate(self._validated(maps)), unpacked(label)
            total += torch.stack([self._chamfer(probability, label, least).sum() for least in _LEAST])
        net.least.fill_(_LEAST[int(total.argmin())])

    @staticmethod
    def _validated(maps: Maps) -> Maps:
        """The same roughening in every epoch."""
        return roughening.rough(maps, Generator().manual_seed(int(maps.abs().sum()) % 2**31))

    @staticmethod
    def _chamfer(probability: Tensor, label: Tensor, least: float | Tensor) -> Float[Tensor, "item"]:
        found = points(probability, least).numpy()
        apart = [
            Apart.of(polar.cartesian(one), polar.cartesian(true)).chamfer
            for one, true in zip(found, label.bool().numpy(), strict=True)
        ]
        return torch.tensor(np.nan_to_num(apart, nan=polar.REACH / 2), dtype=torch.float32)


def unpacked(label: Tensor) -> Float[Tensor, "item row column"]:
    """Pictures of a lidar on the network's columns: 1 where any of its beams has a point."""
    bits = (label[..., None].to(torch.uint8) >> torch.arange(7, -1, -1, dtype=torch.uint8)) & 1
    return bits.flatten(2).unflatten(2, (COLUMNS, -1)).amax(dim=3).float()


def entropy(logits: Float[Tensor, "item 257 column"], label: Float[Tensor, "item row column"]) -> Float[Tensor, "item"]:
    """Cross-entropy to the lidar's points of each column, evenly, or to nothing."""
    count = label.sum(dim=1)
    rows = (label * logits[:, :-1]).sum(dim=1) / count.clamp_min(1)
    return -torch.where(count > 0, rows, logits[:, -1]).mean(dim=1)
