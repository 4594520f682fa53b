"""Training of RadarHD with its paper's loss, augmentation and hyper-parameters, except the width."""

from collections.abc import Iterable

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Generator, Tensor, nn
from torch.nn.functional import adaptive_max_pool2d, binary_cross_entropy_with_logits

from radarize.baselines.radarhd.network import DRAWN, RadarHdNet, columns
from radarize.io.recording import Recording
from radarize.learning.features import augment
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import Reading
from radarize.learning.nets.weights import Network
from radarize.learning.task import Settings, Task, first_cell
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import Maps


def bins(recording: Recording, frames: slice) -> Float[np.ndarray, "frame bearing"]:
    """Return fractional range bins of the true scan, from which label pictures are drawn; -1 without a surface."""
    config = recording.config
    found = (recording.read("truth/scan")[frames] + config.range_bias) / config.range_resolution
    return np.where(np.isinf(found), -1, found).astype(np.float32)


def on_grid(
    label: Float[np.ndarray, "frame bearing"], own: MapGrid, known: MapGrid
) -> Float[np.ndarray, "frame bearing"]:
    """Convert range bins of one radar to those of a grid; -1 beyond its last bin."""
    found = label * np.float32(own.step / known.step)
    return np.where((label < 0) | (found > known.rows - 0.5), np.float32(-1), found)


class RadarHd(Task[Tensor]):
    """Training task: pictures of first surfaces, drawn from the true scan in place of the original's lidar.

    Labels are scans in range bins, -1 without a surface in range.
    """

    network, maps = RadarHdNet, ("range_azimuth",)
    truth = (Reading("scan", "truth/scan", bins, on_grid),)
    defaults = Settings(frames=41, epochs=120, batch=6, rate=1e-4)
    share = 1 / 20
    #: Maximum range error of a detected first surface, cells: 9 cm.
    near = 2

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        return torch.optim.Adam(parameters, settings.rate, settings.betas, weight_decay=5e-4)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left = augment.chosen(maps, generator)
        maps = torch.where(left, augment.mirrored(maps), maps)
        return maps, torch.where(left.flatten(1), augment.mirrored_columns(label[:, None], -1)[:, 0], label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return pictured(net(maps), label)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        logits = net(maps)
        return torch.cat(
            [pictured(logits, label)[:, None], self._counts(logits, label, net.get_buffer("least"))], dim=1
        )

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, near, returned, there = means.tolist()
        return {
            "loss": loss,
            "share_found_within_9_cm": near / max(there, 1e-9),
            "share_right_of_returned": near / max(returned, 1e-9),
        }

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Choose the probability above which the first cell on a bearing is returned, by the best F1 of ranges."""
        choices = torch.arange(0.1, 0.95, 0.05)
        counts = torch.zeros(len(choices), 3)
        for maps, label in batches:
            logits = net(maps)
            counts += torch.stack([self._counts(logits, label, least).sum(dim=0).cpu() for least in choices])
        near, returned, there = counts.T
        net.get_buffer("least").fill_(choices[(2 * near / (returned + there).clamp_min(1)).argmax()])

    def _counts(self, logits: Tensor, label: Tensor, least: Tensor) -> Int[Tensor, "item 3"]:
        """Count bearings with a correct range, with any range, and with a surface in range."""
        rows, bearings = logits.shape[1], len(BEARINGS)
        found = first_cell(adaptive_max_pool2d(logits, (rows, bearings)) > torch.logit(least))
        returned, there = found < rows, label >= 0
        near = returned & there & ((found - label).abs() <= self.near + 0.5)
        return torch.stack([near.sum(dim=1), returned.sum(dim=1), there.sum(dim=1)], dim=1)


def drawn(label: Float[Tensor, "item bearing"], rows: int) -> Float[Tensor, "item range direction"]:
    """Draw pictures of scans: in every column 1 in the range bin of the nearest bearing, or an interpolated range bin
    where two neighbouring bearings see the same surface."""
    place = (columns(DRAWN) - BEARINGS[0]) / (BEARINGS[1] - BEARINGS[0])
    place = torch.tensor(np.clip(place, 0, len(BEARINGS) - 1), dtype=torch.float32, device=label.device)
    before = place.long().clamp_max(len(BEARINGS) - 2)
    a, b, part = label[:, before], label[:, before + 1], place - before
    one_surface = (a >= 0) & (b >= 0) & ((a - b).abs() < 4)
    bins = torch.where(one_surface, a + part * (b - a), torch.where(part < 0.5, a, b)).round()
    return (bins[:, None] == torch.arange(rows, device=label.device)[:, None]).float()


def pictured(
    logits: Float[Tensor, "item range direction"], label: Float[Tensor, "item bearing"]
) -> Float[Tensor, "item"]:
    """Return the loss of pictures against scans in range bins."""
    return unlike(logits, drawn(label, logits.shape[1]))


def unlike(
    logits: Float[Tensor, "item range direction"], truth: Float[Tensor, "item range direction"]
) -> Float[Tensor, "item"]:
    """Return the loss of pictures: 0.9 cross-entropy + 0.1 Dice loss."""
    likely = torch.sigmoid(logits)
    entropy = binary_cross_entropy_with_logits(logits, truth, reduction="none").mean(dim=(1, 2))
    shared, total = (likely * truth).sum(dim=(1, 2)), (likely + truth).sum(dim=(1, 2))
    return 0.9 * entropy + 0.1 * (1 - (2 * shared + 1) / (total + 1))
