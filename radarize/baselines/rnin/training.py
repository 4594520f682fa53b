"""Training of RNIN with its paper's loss, augmentations and hyper-parameters, except the width.

The standard deviations are trained by their likelihood on top of the paper's squared error, without an effect on the
displacements.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation
from torch import Generator, Tensor, nn

from radarize.baselines.rnin.network import LASTS, SAMPLES, RninNet
from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.learning.features.table import FeatureTable, Reading
from radarize.learning.nets.weights import Network
from radarize.learning.task import Motion, Settings
from radarize.odometry.inertial import GRAVITY, Imu, instants


def _levelled(recording: Recording, frames: slice) -> Float[np.ndarray, "frame sample 6"]:
    return Imu.of(recording).levelled(instants(recording)[frames], SAMPLES).astype(np.float16)


def displacement(recording: Recording, frames: slice) -> Float[np.ndarray, "frame 3"]:
    """Return the true displacement in the window before each frame, m, on the levelled axes of the IMU."""
    known = recording.read("truth/time") if recording.has("truth/time") else instants(recording)
    ends = instants(recording)[frames]
    poses = recording.read("truth/pose")
    before, after = (
        np.column_stack([np.interp(t, known, poses[:, axis]) for axis in range(3)]) for t in (ends - LASTS, ends)
    )
    # The levelled axes differ from the world's by a heading, which follows from the true poses.
    yaw = np.interp(ends - LASTS, known, np.unwrap(planar(poses)[:, 2]))
    off = Rotation.from_rotvec(np.outer(Imu.of(recording).yaw(ends - LASTS) - yaw, [0, 0, 1]))
    return off.apply(after - before).astype(np.float32)


class Rnin(Motion):
    """Training task: displacements in consecutive windows of a second, on levelled axes, m."""

    network, sensed = RninNet, (Reading("levelled", "imu/time", _levelled),)
    truth = (Reading("displacement", "truth/pose", displacement),)
    error, size = "rmse_m", "rms_displacement_m"
    share = 1 / 10
    defaults = Settings(frames=10, epochs=100, batch=32, rate=1e-4)

    def spacings(self, frame_period: float) -> Sequence[int]:
        return (max(1, round(LASTS / frame_period)),)

    def inputs(self, table: FeatureTable, frames: Int[Tensor, "item window"]) -> Tensor:
        return table.sensed["levelled"][frames].float()

    def label(self, table: FeatureTable, frames: Int[Tensor, "item window"]) -> Float[Tensor, "item window 3"]:
        return table.truth["displacement"][frames]

    def augment(self, windows: Tensor, label: Tensor, generator: Generator) -> tuple[Tensor, Tensor]:
        """Add a random heading, biases of up to 0.1 m/s^2 and 0.002 rad/s, and a tilt of up to 5 deg."""
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

    def judge(self, net: Network, windows: Tensor, label: Tensor) -> Tensor:
        mean, covariance = net.estimate(windows)
        judged = self._judged(mean, covariance, label[:, -1, :2])
        judged[:, 0] = displaced(net(windows)[0], label)
        return judged


def displaced(mean: Float[Tensor, "item window 3"], label: Float[Tensor, "item window 3"]) -> Float[Tensor, "item"]:
    """Return squared errors of displacements plus eight times those of the position since the first window."""
    error = mean - label
    return (error.square() + 8 * error.cumsum(dim=1).square()).sum(dim=2).mean(dim=1)


def rotation(vector: Float[Tensor, "item 3"]) -> Float[Tensor, "item 3 3"]:
    """Convert rotation vectors to rotation matrices."""
    x, y, z = vector.unbind(1)
    zero = torch.zeros_like(x)
    return torch.linalg.matrix_exp(torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3))
