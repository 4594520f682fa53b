"""RNIN: displacement from an IMU alone, learned from the accelerations of walking people.

Chen et al., "RNIN-VIO: robust neural inertial navigation aided visual-inertial odometry in challenging scenes", ISMAR
2021; the network, without the filter of the paper.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.learning.nets.resnet import stages
from radarize.learning.nets.weights import Network

#: Length of a window, s, and number of its samples.
LASTS, SAMPLES = 1.0, 100


class RninNet(Network):
    """Network from consecutive windows of levelled IMU samples to the displacement in each.

    Args:
        frames: number of windows, oldest first; ten in the original.
        maps: name of the input of a frame: the window that ends there.
        width: channels of the first stage; 64 in the original, with 5.36 M parameters.
    """

    kind, inputs = "rnin", ("windows",)

    def __init__(self, frames: int, maps: Sequence[str] = ("levelled",), width: int = 64):
        super().__init__(frames, maps, width)
        self.shapes = ((frames, SAMPLES, 6),)  # of an item's inputs
        self.stem = nn.Sequential(nn.Conv1d(6, width, 7, 2, 3, bias=False), nn.BatchNorm1d(width), nn.ReLU())
        self.stages = stages(width, axes=1)
        steps = -(-SAMPLES // 16)
        self.narrow = nn.Sequential(
            nn.Conv1d(8 * width, 2 * width, 1, bias=False), nn.BatchNorm1d(2 * width), nn.ReLU(), nn.Flatten()
        )
        self.memory = nn.LSTM(2 * width * steps, 4 * width, batch_first=True)
        self.mean, self.log_deviation = (_head(4 * width) for _ in range(2))
        #: Logarithm of a factor of the standard deviations; fitted on validation data.
        self.register_buffer("spread", torch.zeros(()))

    def forward(
        self, windows: Float[Tensor, "item window sample 6"]
    ) -> tuple[Float[Tensor, "item window 3"], Float[Tensor, "item window 3"]]:
        """Estimate the displacement in each window (m) and the logarithm of its standard deviation.

        Args:
            windows: specific force minus gravity (m/s^2) and angular velocity (rad/s), on levelled axes (z up) that do
                not rotate with the sensor. Displacements are on the same axes.
        """
        x = windows.flatten(0, 1).transpose(1, 2)
        x = self.narrow(self.stages(self.stem(x)))
        x = self.memory(x.unflatten(0, windows.shape[:2]))[0]
        return self.mean(x), self.log_deviation(x)

    def estimate(
        self, windows: Float[Tensor, "item window sample 6"]
    ) -> tuple[Float[Tensor, "item 2"], Float[Tensor, "item 2 2"]]:
        """Estimate the horizontal displacement in the newest window, m, and its covariance."""
        mean, deviation = (found[:, -1, :2] for found in self(windows))
        return mean, torch.diag_embed((2 * (deviation + self.spread)).exp())


def _head(width: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for _ in range(2):
        layers += [nn.Linear(width, width), nn.ReLU(), nn.Dropout(0.2)]
    return nn.Sequential(*layers, nn.Linear(width, 3))
