"""RadarHD's network on RadarHD's pictures, trained on the simulated walks of `radarize.baselines.pictures`."""

from collections.abc import Iterable
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.baselines.pictures.training import Pictures, chamfer, unpacked, validated
from radarize.baselines.radarhd.network import DRAWN, RadarHdPictureNet
from radarize.baselines.radarhd.training import RadarHd, unlike
from radarize.learning.nets.weights import Network
from radarize.learning.task import Settings
from radarize.signal.maps import Maps

#: Candidates for the probability above which a cell is a point; one cell in 150 has a point.
LEAST = torch.tensor([0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6])


class RadarHdPictures(Pictures):
    """Training task: a lidar's pictures from a radar's, with the network, loss, optimiser and rule for points of the
    paper, and two seconds of history. Data and augmentation are those of our own network, so that only the method
    differs.

    The original reads 41 pictures 0.05 s apart; this one reads 11, because the walks have a picture every 0.2 s.
    """

    network, columns = RadarHdPictureNet, DRAWN
    defaults: Settings = replace(RadarHd.defaults, frames=11)
    share = 1 / 4
    optimise = RadarHd.optimise

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return known(net(maps), label)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        logits, label = net(validated(maps)), unpacked(label, DRAWN)
        found = torch.sigmoid(logits) > net.get_buffer("least")
        return torch.stack([known(logits, label), chamfer(found, label)], dim=1)

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Choose the probability above which a cell is a point, by the least mean Chamfer distance."""
        total = torch.zeros(len(LEAST))
        for maps, label in batches:
            probability, label = net.estimate(validated(maps)), unpacked(label, DRAWN)
            total += torch.stack([chamfer(probability > least, label).sum().cpu() for least in LEAST])
        net.get_buffer("least").fill_(LEAST[total.argmin()])


def known(
    logits: Float[Tensor, "item range column"], label: Float[Tensor, "item range column"]
) -> Float[Tensor, "item"]:
    """Return the paper's loss on known columns; unknown columns count as correct."""
    return unlike(logits.masked_fill(label < 0, -20.0), label.clamp_min(0))
