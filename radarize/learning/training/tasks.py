"""Trainings of the three networks: maps, labels, losses, and the paper's hyper-parameters (its section 5)."""

from collections.abc import Iterable

import torch
from jaxtyping import Float
from torch import Generator, Tensor, nn
from torch.nn.functional import binary_cross_entropy_with_logits

from radarize.learning.features import augment
from radarize.learning.features.occupancy import OCCUPANCY
from radarize.learning.features.table import VELOCITY, YAW, FeatureTable
from radarize.learning.nets import losses
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.learning.nets.segmentation import SegmentationNet
from radarize.learning.nets.weights import Network
from radarize.learning.task import Motion, Settings, Task, first_cell, turns
from radarize.signal.depthlabel import SURFACE, UNKNOWN
from radarize.signal.maps import Maps


class Translation(Motion):
    """Training of velocity, m/s."""

    network, truth = TranslationNet, (VELOCITY,)
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
    """Training of rotation, rad, over up to 0.27 s: the paper's 4 frames at 15 Hz.

    Labels are rotation and travel; the travel is an input of the network, with errors as large as those of velocities
    in operation.
    """

    network, truth = RotationNet, (YAW, VELOCITY)
    error, size = "rmse_rad", "rms_turn_rad"
    maps = ("range_azimuth",)
    reach = 4 / 15
    least_frames = 2
    defaults = Settings()
    #: m, standard deviation of the error added to the travel.
    doubt = 0.01

    def label(self, table: FeatureTable, frames: Tensor) -> Float[Tensor, "item 3"]:
        """Return rotation (rad) and travel (m): mean of the velocities at the window's ends times its duration."""
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

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        mean, covariance = net.estimate(maps, label[:, 1:])
        return self._judged(mean, covariance, label[:, :1])


class Segmentation(Task[Tensor]):
    """Training of occupancy."""

    network: type[Network] = SegmentationNet
    truth = (OCCUPANCY,)
    maps: tuple[str, ...] = ("range_azimuth", "elevation_aware")
    defaults = Settings(frames=1, epochs=5, batch=48, rate=1e-4, betas=(0.8, 0.9))
    #: Maximum error in range cells of a first surface that counts as found: 9 cm.
    near = 2

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left = augment.chosen(maps, generator)
        maps = torch.where(left, augment.mirrored(maps), maps)
        label = torch.where(left[:, :, 0, 0], augment.mirrored_columns(label, UNKNOWN), label)
        return augment.other_radar(maps, generator, doppler=False), label

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Tensor:
        return losses.surfaces(net(maps), label)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Tensor:
        logits = net(maps)
        return self._judged(losses.surfaces(logits, label), logits > 0, label == SURFACE)

    def _judged(self, loss: Tensor, occupied: Tensor, surface: Tensor) -> Float[Tensor, "item 3"]:
        """Return loss, number of first surfaces found near their true range, and number of first surfaces."""
        found, truth = first_cell(occupied), first_cell(surface)
        there = truth < surface.shape[1]
        near = ((found - truth).abs() <= self.near) & there
        return torch.stack([loss, near.sum(dim=1), there.sum(dim=1)], dim=1)

    def metrics(self, means: Tensor) -> dict[str, float]:
        loss, near, there = means.tolist()
        return {"loss": loss, "share_found_within_9_cm": near / max(there, 1e-9)}

    def calibrate(self, net: Network, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Calibrate by likelihood: the product of cell probabilities along a bearing is that of its first surface."""
        pairs = [(net(maps)[:, :, ::4], label[:, :, ::4]) for maps, label in batches]
        known = [label != UNKNOWN for _, label in pairs]
        logits = torch.cat([found[k] for (found, _), k in zip(pairs, known, strict=True)]).detach()
        truth = torch.cat([label[k] for (_, label), k in zip(pairs, known, strict=True)]).eq(SURFACE).float()
        fit = torch.tensor([1.0, 0.0], device=logits.device, requires_grad=True)
        optimiser = torch.optim.LBFGS([fit], line_search_fn="strong_wolfe", max_iter=30)

        def closure() -> Tensor:
            optimiser.zero_grad()
            loss = binary_cross_entropy_with_logits(logits * fit[0] + fit[1], truth)
            loss.backward()
            return loss

        with torch.enable_grad():
            optimiser.step(closure)
        net.get_buffer("scale").copy_(fit[0].detach())
        net.get_buffer("offset").copy_(fit[1].detach())
