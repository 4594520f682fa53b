"""RNIN: displacement from an IMU alone, by what a walker's accelerations look like.

Chen et al., "RNIN-VIO: robust neural inertial navigation aided visual-inertial odometry in challenging scenes", ISMAR
2021; its network, without the filter that follows it there.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.learning.nets.resnet import stages
from radarize.learning.nets.weights import Network

#: s, of a window, and its samples.
LASTS, SAMPLES = 1.0, 100


class RninNet(Network):
    """Consecutive windows of IMU samples, levelled, to the displacement in each.

    Args:
        frames: windows, oldest first; ten in the original.
        maps: names of what it reads of a frame: the window that ends there.
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
        #: Logarithm of what standard deviations are multiplied with; training fits it on validation data.
        self.register_buffer("spread", torch.zeros(()))

    def forward(
        self, windows: Float[Tensor, "item window sample 6"]
    ) -> tuple[Float[Tensor, "item window 3"], Float[Tensor, "item window 3"]]:
        """Displacement in each window (m) and the logarithm of its standard deviation.

        Args:
            windows: specific force less gravity (m/s^2) and angular velocity (rad/s) on axes of which the third points
                up and that do not turn with the sensor; the answers are on the same.
        """
        x = windows.flatten(0, 1).transpose(1, 2)
        x = self.narrow(self.stages(self.stem(x)))
        x = self.memory(x.unflatten(0, windows.shape[:2]))[0]
        return self.mean(x), self.log_deviation(x)

    def estimate(
        self, windows: Float[Tensor, "item window sample 6"]
    ) -> tuple[Float[Tensor, "item 2"], Float[Tensor, "item 2 2"]]:
        """Horizontal displacement in the newest window, m, and its covariance."""
        mean, deviation = (found[:, -1, :2] for found in self(windows))
        return mean, torch.diag_embed((2 * (deviation + self.spread)).exp())


def _head(width: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for _ in range(2):
        layers += [nn.Linear(width, width), nn.ReLU(), nn.Dropout(0.2)]
    return nn.Sequential(*layers, nn.Linear(width, 3))
