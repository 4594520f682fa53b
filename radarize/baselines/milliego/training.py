"""Training of milliEgo with its paper's loss and hyper-parameters, except the width."""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation
from torch import Generator, Tensor, nn

from radarize.baselines.milliego.network import DEGREES, PAIR, SAMPLES, MilliEgoNet
from radarize.baselines.milliego.panorama import seen
from radarize.io.recording import Recording
from radarize.learning.features.table import POSE, FeatureTable, Reading
from radarize.learning.nets.weights import Network
from radarize.learning.task import Settings, Task
from radarize.odometry.inertial import Imu, instants


def _latest(recording: Recording, frames: slice) -> Float[np.ndarray, "frame sample 6"]:
    return Imu.of(recording).latest(instants(recording)[frames], SAMPLES).astype(np.float16)


class MilliEgo(Task[tuple[Tensor, ...]]):
    """Training task: motion between panoramas 0.2 s apart, translation (m) in the older one's axes, Euler angles
    (deg)."""

    network, truth = MilliEgoNet, (POSE,)
    sensed = (Reading("panorama", "radar/adc", seen), Reading("imu", "imu/time", _latest))
    share = 1 / 5
    least_frames = 2
    defaults = Settings(width=8, frames=6, epochs=201, batch=32, rate=1e-5, schedule="steps", patience=201)

    def optimise(self, parameters: Iterable[nn.Parameter], settings: Settings) -> torch.optim.Optimizer:
        return torch.optim.RMSprop(parameters, settings.rate)

    def spacings(self, frame_period: float) -> Sequence[int]:
        return (max(1, round(PAIR / frame_period)),)

    def inputs(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> tuple[Tensor, ...]:
        return tuple(table.sensed[name][frames].float() for name in self.reads)

    def label(self, table: FeatureTable, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item pair 6"]:
        poses = table.truth["pose"][frames].numpy()
        turned = Rotation.from_quat(poses[..., 3:].reshape(-1, 4)).as_matrix().reshape(*poses.shape[:2], 3, 3)
        back = np.swapaxes(turned[:, :-1], -1, -2)
        step = (back @ np.diff(poses[..., :3], axis=1)[..., None])[..., 0]
        turn = Rotation.from_matrix((back @ turned[:, 1:]).reshape(-1, 3, 3)).as_euler("xyz", degrees=True)
        return torch.from_numpy(np.concatenate([step, turn.reshape(step.shape)], axis=-1)).float()

    def augment(
        self, inputs: tuple[Tensor, ...], label: Tensor, generator: Generator
    ) -> tuple[tuple[Tensor, ...], Tensor]:
        """Mirror half of the items, left for right; the original does not, but has more walks."""
        panorama, imu = inputs
        left = torch.rand((len(label), 1, 1, 1), generator=generator, device=label.device) < 0.5
        panorama = torch.where(left, panorama.flip(3), panorama)
        imu = torch.where(left, imu * imu.new_tensor([1, -1, 1, -1, 1, -1]), imu)
        return (panorama, imu), torch.where(left[:, 0], label * label.new_tensor([1, -1, 1, -1, 1, -1]), label)

    def loss(self, net: nn.Module, inputs: tuple[Tensor, ...], label: Tensor) -> Float[Tensor, "item"]:
        return _milliego_loss(net(*inputs), label)

    def judge(self, net: Network, inputs: tuple[Tensor, ...], label: Tensor) -> Tensor:
        assert isinstance(net, MilliEgoNet)
        motion = net(*inputs)
        error, size = net.planar(motion[:, -1])[0] - _planar(label), _planar(label)
        numbers = [part.square().sum(dim=1) for each in (error, size) for part in each.split([2, 1], dim=1)]
        return torch.stack([_milliego_loss(motion, label), *numbers], dim=1)

    def metrics(self, means: Float[Tensor, "number"]) -> dict[str, float]:
        loss, *squares = means.tolist()
        names = ("rmse_m", "rmse_rad", "rms_step_m", "rms_turn_rad")
        return {"loss": loss} | {name: value**0.5 for name, value in zip(names, squares, strict=True)}

    def calibrate(self, net: Network, batches: Iterable[tuple[tuple[Tensor, ...], Tensor]]) -> None:
        """Set the covariance of all estimates to the mean squared validation error."""
        errors = [net.estimate(*inputs)[0] - _planar(label) for inputs, label in batches]
        net.get_buffer("error").copy_(torch.cat(errors).square().mean(dim=0).clamp_min(1e-6))


def _planar(label: Float[Tensor, "item pair 6"]) -> Float[Tensor, "item 3"]:
    """Return x, y (m) and yaw (rad) of the newest motion."""
    return torch.cat([label[:, -1, :2], label[:, -1, 5:] / DEGREES], dim=1)


def _milliego_loss(motion: Float[Tensor, "item pair 6"], label: Float[Tensor, "item pair 6"]) -> Float[Tensor, "item"]:
    squared = (motion - label).square().mean(dim=1)
    return squared[:, :3].mean(dim=1) + 0.001 * squared[:, 3:].mean(dim=1)
