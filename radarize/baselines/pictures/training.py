"""Training on simulated walks: pictures with random properties of board and room, labels by a simulated lidar."""

from collections.abc import Iterable

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Generator, Tensor, nn

from radarize.baselines.pictures import roughening
from radarize.baselines.pictures.network import COLUMNS, PictureNet
from radarize.baselines.pictures.points import points
from radarize.baselines.pictures.roughening import uniform
from radarize.baselines.pictures.task import PictureTask
from radarize.baselines.walks.point_cloud_distance import PointCloudDistance
from radarize.learning.features.augment import chosen, mirrored
from radarize.learning.features.table import Reading
from radarize.learning.nets.weights import Network
from radarize.learning.task import Settings
from radarize.signal import polar
from radarize.signal.maps import Maps

#: Candidates for the probability above which every cell has a point.
DENSE = (0.015, 0.02, 0.025, 0.03, 0.035, 0.04, 0.05, 0.06)
#: Augmentation: maximum change of scale, and maximum rotation in columns of a picture.
ZOOM, TURN = 0.25, 8
#: Offset of the radar's ranges against the lidar's on the training walks, by range bias and lever arm of the rig, m.
BIAS = (0.17, 0.34)
#: Label of cells outside of the field of view.
UNKNOWN = -1.0


class Pictures(PictureTask):
    """Training task: a lidar's points from polar pictures; labels are packed pictures of the lidar.

    Attributes:
        columns: columns of the network's output.
    """

    network: type[Network] = PictureNet
    truth, columns = (Reading("lidar", "truth/lidar"),), COLUMNS
    defaults = Settings(width=12, frames=5, epochs=20, batch=64, rate=2e-3, schedule="cosine")

    def augment(
        self, maps: Maps, label: Tensor, generator: Generator
    ) -> tuple[Float[Tensor, "item frame 1 range column"], Tensor]:
        pictures, label = elsewhere(roughening.rough(maps, generator), unpacked(label, self.columns), generator)
        return biased(pictures[:, :, 0], uniform(generator, *BIAS, len(maps))), label

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return entropy(net(maps), label)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        logits, label = net(validated(maps)), unpacked(label)
        return torch.stack(
            [entropy(logits, label), chamfer(points(logits.exp(), net.get_buffer("dense")), label)], dim=1
        )

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, chamfer = means.tolist()
        return {"loss": loss, "chamfer_m": chamfer}

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Choose the probability above which every cell has a point, by the least mean Chamfer distance."""
        least = net.get_buffer("dense")
        total = torch.zeros(len(DENSE), device=least.device)
        for maps, label in batches:
            probability, label = net.estimate(validated(maps)), unpacked(label)
            total += torch.stack([chamfer(points(probability, dense), label).sum() for dense in DENSE])
        least.fill_(DENSE[int(total.argmin())])


def chamfer(found: Bool[Tensor, "item row column"], label: Float[Tensor, "item row other"]) -> Float[Tensor, "item"]:
    """Return Chamfer distances between estimated and true points, m; half the range of a picture if either is empty."""
    clouds = zip(found.cpu().numpy(), label.bool().cpu().numpy(), strict=True)
    distances = np.nan_to_num([PointCloudDistance.of_pictures(*each).chamfer for each in clouds], nan=polar.REACH / 2)
    return torch.tensor(distances, dtype=torch.float32, device=label.device)


def validated(maps: Maps) -> Float[Tensor, "item frame 1 range column"]:
    """Compute validation pictures: the same random properties in every epoch, and the mean range offset."""
    seed = int(maps.abs().double().sum()) % 2**31
    pictures = roughening.rough(maps, Generator(maps.device).manual_seed(seed))
    return biased(pictures[:, :, 0], torch.full((len(maps),), sum(BIAS) / 2, device=maps.device))


def elsewhere(
    pictures: Maps, label: Float[Tensor, "item row column"], generator: Generator
) -> tuple[Maps, Float[Tensor, "item row column"]]:
    """Augment pictures and labels geometrically: mirrored, scaled and rotated."""
    left = chosen(pictures, generator)
    pictures = torch.where(left, mirrored(pictures), pictures)[:, :, 0]
    label = torch.where(left[:, 0, 0], label.flip(2), label)[:, None]
    factor = uniform(generator, 1 - ZOOM, 1 + ZOOM, len(label))
    turn = uniform(generator, -TURN, TURN, len(label)).round().long()
    finer = label.shape[3] // pictures.shape[3]
    pictures, label = rolled(zoomed(pictures, factor), turn, 0.0), rolled(zoomed(label, factor), finer * turn, UNKNOWN)
    return pictures[:, :, None], label[:, 0]


def biased(pictures: Float[Tensor, "item frame row column"], metres: Float[Tensor, "item"]) -> Maps:
    """Shift pictures in range by an offset in metres."""
    rows = (metres / polar.RANGES[1]).round().long()
    return _gathered(pictures, torch.arange(polar.ROWS, device=pictures.device) - rows[:, None])[:, :, None]


def zoomed(
    pictures: Float[Tensor, "item frame row column"], factor: Float[Tensor, "item"]
) -> Float[Tensor, "item frame row column"]:
    """Scale pictures in range by a factor."""
    rows = torch.arange(polar.ROWS, device=pictures.device)
    return _gathered(pictures, (rows / factor[:, None]).round().long())


def rolled(
    pictures: Float[Tensor, "item frame row column"], columns: Int[Tensor, "item"], beyond: float
) -> Float[Tensor, "item frame row column"]:
    """Rotate pictures by a number of columns; `beyond` fills columns from outside of the field of view."""
    place = torch.arange(pictures.shape[3], device=pictures.device) - columns[:, None]
    inside = (place >= 0) & (place < pictures.shape[3])
    index = place.clamp(0, pictures.shape[3] - 1)[:, None, None].expand_as(pictures)
    return pictures.gather(3, index).masked_fill(~inside[:, None, None], beyond)


def _gathered(pictures: Tensor, place: Int[Tensor, "item row"]) -> Tensor:
    """Gather rows of pictures; 0 for rows outside of them."""
    inside = (place >= 0) & (place < polar.ROWS)
    found = pictures.gather(2, place.clamp(0, polar.ROWS - 1)[:, None, :, None].expand_as(pictures))
    return found * inside[:, None, :, None]


def unpacked(label: Tensor, columns: int = COLUMNS) -> Float[Tensor, "item row column"]:
    """Unpack a lidar's pictures to a network's columns: 1 where any beam of a column has a point."""
    bits = (label[..., None].to(torch.uint8) >> torch.arange(7, -1, -1, dtype=torch.uint8, device=label.device)) & 1
    return bits.flatten(2).unflatten(2, (columns, -1)).amax(dim=3).float()


def entropy(logits: Float[Tensor, "item 257 column"], label: Float[Tensor, "item row column"]) -> Float[Tensor, "item"]:
    """Return the mean cross-entropy over known columns, with a uniform distribution over the points of a column, or on
    no point."""
    known = label[:, 0] != UNKNOWN
    count = label.sum(dim=1)
    rows = (label * logits[:, :-1]).sum(dim=1) / count.clamp_min(1)
    return -(torch.where(count > 0, rows, logits[:, -1]) * known).sum(dim=1) / known.sum(dim=1)
