"""The baselines' trainings: their papers' losses, augmentations and hyper-parameters, but for the width.

Where the papers tell errors apart only by their squares, uncertainty is learned without touching what is told.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation
from torch import Generator, Tensor, nn
from torch.nn.functional import adaptive_max_pool2d, binary_cross_entropy_with_logits

from radarize.baselines.inertial import GRAVITY
from radarize.baselines.milliego import DEGREES
from radarize.baselines.radarhd import DRAWN, columns
from radarize.baselines.rnin import LASTS
from radarize.mapping.scans import BEARINGS
from radarize.nets.maps import Maps
from radarize.training import augment
from radarize.training.table import Table
from radarize.training.tasks import Inputs, Motion, Settings, Task, first_cell

#: s, from one of milliEgo's panoramas to the next.
PAIR = 0.2


class RadarHd(Task):
    """Pictures of first surfaces, drawn from the true scan: the lidar of the original.

    Labels are scans in range bins, -1 where nothing is in reach.
    """

    kind, truth, maps = "radarhd", ("scan",), ("range_azimuth",)
    defaults = Settings(frames=41, epochs=120, batch=6, rate=1e-4)
    share = 1 / 20
    #: Cells of range by which a first surface may be off to count as found: 9 cm.
    near = 2

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        return torch.optim.Adam(parameters, settings.rate, settings.betas, weight_decay=5e-4)

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        left = augment.chosen(maps, generator)
        maps = torch.where(left, augment.mirrored(maps), maps)
        return maps, torch.where(left.flatten(1), augment.mirrored_columns(label[:, None], -1)[:, 0], label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return pictured(net(maps), label)

    def judge(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        logits = net(maps)
        return torch.cat([pictured(logits, label)[:, None], self._counts(logits, label, net.least)], dim=1)

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, near, told, there = means.tolist()
        return {
            "loss": loss,
            "share_found_within_9_cm": near / max(there, 1e-9),
            "share_right_of_returned": near / max(told, 1e-9),
        }

    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Maps, Tensor]]) -> None:
        """Choose the probability from which the first cell on a bearing is returned: the best F1 of returned ranges."""
        choices = torch.arange(0.1, 0.95, 0.05)
        counts = torch.zeros(len(choices), 3)
        for maps, label in batches:
            logits = net(maps)
            counts += torch.stack([self._counts(logits, label, least).sum(dim=0).cpu() for least in choices])
        near, told, there = counts.T
        net.least.fill_(choices[(2 * near / (told + there).clamp_min(1)).argmax()])

    def _counts(self, logits: Tensor, label: Tensor, least: Tensor) -> Float[Tensor, "item 3"]:
        """Bearings with a range that is right, with any, and that should have one."""
        rows, bearings = logits.shape[1], len(BEARINGS)
        found = first_cell(adaptive_max_pool2d(logits, (rows, bearings)) > torch.logit(least))
        told, there = found < rows, label >= 0
        near = told & there & ((found - label).abs() <= self.near + 0.5)
        return torch.stack([near.sum(dim=1), told.sum(dim=1), there.sum(dim=1)], dim=1)


def drawn(label: Float[Tensor, "item bearing"], rows: int) -> Float[Tensor, "item range direction"]:
    """Pictures of scans: in every column 1 in the cell of the nearest bearing's range bin, or, where two neighbouring
    bearings see the same surface, of what lies between them."""
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
    """0.9 cross-entropy and 0.1 Dice of pictures against scans in range bins."""
    truth, likely = drawn(label, logits.shape[1]), torch.sigmoid(logits)
    entropy = binary_cross_entropy_with_logits(logits, truth, reduction="none").mean(dim=(1, 2))
    shared, total = (likely * truth).sum(dim=(1, 2)), (likely + truth).sum(dim=(1, 2))
    return 0.9 * entropy + 0.1 * (1 - (2 * shared + 1) / (total + 1))


class MilliEgo(Task):
    """Motions between panoramas 0.2 s apart: translation (m) in the older one's axes, and Euler angles (deg)."""

    kind, sensed, truth = "milliego", ("panorama", "imu"), ("pose",)
    share = 1 / 5
    defaults = Settings(width=8, frames=6, epochs=201, batch=32, rate=1e-5, schedule="steps", patience=201)

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        return torch.optim.RMSprop(parameters, settings.rate)

    def spacings(self, frame_period: float) -> Sequence[int]:
        return (max(1, round(PAIR / frame_period)),)

    def inputs(self, table: Table, frames: Int[Tensor, "item frame"]) -> Inputs:
        return tuple(table.sensed[name][frames].float() for name in self.sensed)

    def label(self, table: Table, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item pair 6"]:
        poses = table.truth["pose"][frames].numpy()
        turned = Rotation.from_quat(poses[..., 3:].reshape(-1, 4)).as_matrix().reshape(*poses.shape[:2], 3, 3)
        back = np.swapaxes(turned[:, :-1], -1, -2)
        step = (back @ np.diff(poses[..., :3], axis=1)[..., None])[..., 0]
        turn = Rotation.from_matrix((back @ turned[:, 1:]).reshape(-1, 3, 3)).as_euler("xyz", degrees=True)
        return torch.from_numpy(np.concatenate([step, turn.reshape(step.shape)], axis=-1)).float()

    def augment(self, inputs: Inputs, label: Tensor, generator: Generator) -> tuple[Inputs, Tensor]:
        """Half of the items are mirrored, left for right; the original has enough walks to do without."""
        panorama, imu = inputs
        left = torch.rand((len(label), 1, 1, 1), generator=generator, device=label.device) < 0.5
        panorama = torch.where(left, panorama.flip(3), panorama)
        imu = torch.where(left, imu * imu.new_tensor([1, -1, 1, -1, 1, -1]), imu)
        return (panorama, imu), torch.where(left[:, 0], label * label.new_tensor([1, -1, 1, -1, 1, -1]), label)

    def loss(self, net: nn.Module, inputs: Inputs, label: Tensor) -> Float[Tensor, "item"]:
        return _milliego_loss(net(*inputs), label)

    def judge(self, net: nn.Module, inputs: Inputs, label: Tensor) -> Tensor:
        motion = net(*inputs)
        error, size = net.planar(motion[:, -1])[0] - _planar(label), _planar(label)
        numbers = [part.square().sum(dim=1) for each in (error, size) for part in each.split([2, 1], dim=1)]
        return torch.stack([_milliego_loss(motion, label), *numbers], dim=1)

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, *squares = means.tolist()
        names = ("rmse_m", "rmse_rad", "rms_step_m", "rms_turn_rad")
        return {"loss": loss} | {name: value**0.5 for name, value in zip(names, squares, strict=True)}

    def calibrate(self, net: nn.Module, batches: Iterable[tuple[Inputs, Tensor]]) -> None:
        """Keep the validation error as everyone's."""
        errors = [net.estimate(*inputs)[0] - _planar(label) for inputs, label in batches]
        net.error.copy_(torch.cat(errors).square().mean(dim=0).clamp_min(1e-6))


def _planar(label: Float[Tensor, "item pair 6"]) -> Float[Tensor, "item 3"]:
    """x, y (m) and yaw (rad) of the newest motion."""
    return torch.cat([label[:, -1, :2], label[:, -1, 5:] / DEGREES], dim=1)


def _milliego_loss(motion: Float[Tensor, "item pair 6"], label: Float[Tensor, "item pair 6"]) -> Float[Tensor, "item"]:
    squared = (motion - label).square().mean(dim=1)
    return squared[:, :3].mean(dim=1) + 0.001 * squared[:, 3:].mean(dim=1)


class Rnin(Motion):
    """Displacements in consecutive windows of a second, on level axes, m."""

    kind, sensed, truth = "rnin", ("levelled",), ("displacement",)
    error, size = "rmse_m", "rms_displacement_m"
    share = 1 / 10
    defaults = Settings(frames=10, epochs=100, batch=32, rate=1e-4)

    def spacings(self, frame_period: float) -> Sequence[int]:
        return (max(1, round(LASTS / frame_period)),)

    def inputs(self, table: Table, frames: Int[Tensor, "item window"]) -> Inputs:
        return table.sensed["levelled"][frames].float()

    def label(self, table: Table, frames: Int[Tensor, "item window"]) -> Float[Tensor, "item window 3"]:
        return table.truth["displacement"][frames]

    def augment(self, windows: Tensor, label: Tensor, generator: Generator) -> tuple[Inputs, Tensor]:
        """Any heading, biases of up to 0.1 m/s^2 and 0.002 rad/s, and axes off level by up to 5 deg."""
        count = len(label)
        yaw, way, size = (torch.rand(count, generator=generator, device=label.device) for _ in range(3))
        turn = rotation(torch.tensor([0.0, 0, 1], device=label.device) * 2 * torch.pi * yaw[:, None])
        axis = torch.stack([torch.cos(2 * torch.pi * way), torch.sin(2 * torch.pi * way), torch.zeros_like(way)], dim=1)
        tilt = rotation(axis * torch.deg2rad(5 * size)[:, None])
        bias = 2 * torch.rand((count, 1, 1, 6), generator=generator, device=label.device) - 1
        bias = bias * bias.new_tensor([0.1] * 3 + [0.002] * 3)
        gravity = windows.new_tensor([0, 0, GRAVITY])
        force, angular = (windows + bias).split(3, dim=3)
        force, angular = (torch.einsum("iab,iwsb->iwsa", tilt @ turn, each) for each in (force + gravity, angular))
        return torch.cat([force - gravity, angular], dim=3), torch.einsum("iab,iwb->iwa", turn, label)

    def loss(self, net: nn.Module, windows: Tensor, label: Tensor) -> Float[Tensor, "item"]:
        mean, log_deviation = net(windows)
        error = (mean - label).detach()
        likelihood = 0.5 * (error * (-log_deviation).exp()).square() + log_deviation
        return displaced(mean, label) + likelihood.sum(dim=2).mean(dim=1)

    def judge(self, net: nn.Module, windows: Tensor, label: Tensor) -> Tensor:
        judged = self._judged(*net.estimate(windows), label[:, -1, :2])
        judged[:, 0] = displaced(net(windows)[0], label)
        return judged


def displaced(mean: Float[Tensor, "item window 3"], label: Float[Tensor, "item window 3"]) -> Float[Tensor, "item"]:
    """Squared errors of displacements, and eight times those of the way since the first window."""
    error = mean - label
    return (error.square() + 8 * error.cumsum(dim=1).square()).sum(dim=2).mean(dim=1)


def rotation(vector: Float[Tensor, "item 3"]) -> Float[Tensor, "item 3 3"]:
    """Rotation matrices of rotation vectors."""
    x, y, z = vector.unbind(1)
    zero = torch.zeros_like(x)
    return torch.linalg.matrix_exp(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3))


#: Tasks by name.
BASELINE_TASKS = {task.kind: task() for task in (RadarHd, MilliEgo, Rnin)}
