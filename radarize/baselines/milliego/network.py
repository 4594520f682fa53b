"""milliEgo: motion from a radar's sparse points and an IMU, with cross-attention between both branches.

Lu et al., "milliEgo: single-chip mmWave radar aided egomotion estimation via deep sensor fusion", SenSys 2020.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.learning.nets.weights import Network

#: Time between the panoramas of a pair, s.
PAIR = 0.2
#: Rows and columns of a panorama.
ROWS, COLUMNS = 64, 256
#: IMU samples between two panoramas: specific force and angular velocity.
SAMPLES = 20
#: Channels over the width, kernel and stride of the radar's convolutions, which are those of FlowNetS's encoder
#: (Dosovitskiy et al., "FlowNet", 2015).
_ENCODER = ((1, 7, 2), (2, 5, 2), (4, 5, 2), (4, 3, 1), (8, 3, 2), (8, 3, 1), (8, 3, 2), (8, 3, 1), (16, 3, 2))
#: Degrees per radian: the network's rotations are in degrees.
DEGREES = 57.29577951308232
#: Rotation for an output of 1 of the last layer, deg: similar in size to a step in metres, so that both are learned.
_TURN = 10.0


class Heads(nn.Module):
    """Two output heads on the same features: translation (m) and Euler angles (deg)."""

    def __init__(self, inputs: int, width: int):
        super().__init__()
        self.translation, self.rotation = (
            nn.Sequential(
                nn.Linear(inputs, 2 * width), nn.LeakyReLU(0.1), nn.Linear(2 * width, width), nn.LeakyReLU(0.1),
                nn.Linear(width, 3),
            ) for _ in range(2)
        )  # fmt: skip

    def forward(self, x: Tensor) -> Float[Tensor, "*batch 6"]:
        return torch.cat([self.translation(x), _TURN * self.rotation(x)], dim=-1)


class MilliEgoNet(Network):
    """Network from pairs of panoramas and the IMU samples between them to the motion between the panoramas.

    Channels are weighted by gates: a squeeze-and-excitation gate on the radar's channels (Hu et al.,
    "Squeeze-and-excitation networks", 2018), then gates of each branch on the channels of the other.

    Args:
        frames: frames of a window, oldest first; one more than motions.
        maps: names of the inputs of a frame.
        width: channels of the first convolution; 64 in the original, with 33.98 M parameters.
    """

    kind, inputs = "milliego", ("panorama", "imu")
    scale: Float[Tensor, "6"]
    error: Float[Tensor, "3"]

    def __init__(self, frames: int, maps: Sequence[str] = ("panorama", "imu"), width: int = 64):
        super().__init__(frames, maps, width)
        self.shapes = ((frames, ROWS, COLUMNS), (frames, SAMPLES, 6))  # of an item's inputs
        channels, layers, (rows, columns) = 6, [], (ROWS, COLUMNS)
        for scale, kernel, stride in _ENCODER:
            layers += [nn.Conv2d(channels, scale * width, kernel, stride, kernel // 2), nn.LeakyReLU(0.1)]
            channels, rows, columns = scale * width, -(-rows // stride), -(-columns // stride)
        self.radar = nn.Sequential(*layers)
        self.squeeze = nn.Sequential(
            nn.Linear(channels, channels), nn.ReLU(), nn.Linear(channels, channels), nn.Sigmoid()
        )
        self.inertial = nn.LSTM(6, 2 * width, batch_first=True)
        self.of_radar = nn.Sequential(nn.Linear(2 * width, channels), nn.Sigmoid())  # gates, from the other branch
        self.of_inertial = nn.Sequential(nn.Linear(channels, 2 * width), nn.Sigmoid())
        features = channels * rows * columns + 2 * width * SAMPLES
        self.memory = nn.LSTM(features, 8 * width, 2, batch_first=True)
        self.heads = Heads(8 * width, width)
        #: Scale of the IMU's inputs, m/s^2 and rad/s: without it, gravity would saturate the LSTM's gates.
        self.register_buffer("scale", torch.tensor([10.0, 10.0, 10.0, 1.0, 1.0, 1.0]), persistent=False)
        #: Mean squared error on validation data: x, y (m^2), yaw (rad^2).
        self.register_buffer("error", torch.ones(3))
        if not self.error.is_meta:  # only sizes are wanted
            _begin(self)

    def features(
        self, panorama: Float[Tensor, "item 2 row column"], imu: Float[Tensor, "item sample 6"]
    ) -> Float[Tensor, "item feature"]:
        """Compute features of pairs of panoramas (0...1, older first) and IMU samples between them (m/s^2, rad/s)."""
        x = self.radar(panorama.repeat_interleave(3, dim=1))
        x = x * self.squeeze(x.mean(dim=(2, 3)))[:, :, None, None]
        y = self.inertial(imu / self.scale)[0]
        of_radar, of_inertial = self.of_radar(y[:, -1]), self.of_inertial(x.mean(dim=(2, 3)))
        return torch.cat([(x * of_radar[:, :, None, None]).flatten(1), (y * of_inertial[:, None]).flatten(1)], dim=1)

    def recall(self, features: Float[Tensor, "item pair feature"]) -> Float[Tensor, "item pair 6"]:
        """Estimate motions of consecutive pairs: translation (m) in the older frame's axes, Euler angles x y z
        (deg)."""
        return self.heads(self.memory(features)[0])

    def forward(
        self, panorama: Float[Tensor, "item frame row column"], imu: Float[Tensor, "item frame sample 6"]
    ) -> Float[Tensor, "item pair 6"]:
        """Estimate motions as `recall` does, from panoramas and the IMU samples up to each frame."""
        pairs = torch.stack([panorama[:, :-1], panorama[:, 1:]], dim=2)
        found = self.features(pairs.flatten(0, 1), imu[:, 1:].flatten(0, 1))
        return self.recall(found.unflatten(0, pairs.shape[:2]))

    def estimate(
        self, panorama: Float[Tensor, "item frame row column"], imu: Float[Tensor, "item frame sample 6"]
    ) -> tuple[Float[Tensor, "item 3"], Float[Tensor, "item 3 3"]]:
        """Estimate planar motion of the newest pair, x, y (m) and yaw (rad), and its covariance, which is constant."""
        return self.planar(self(panorama, imu)[:, -1])

    def planar(self, motion: Float[Tensor, "item 6"]) -> tuple[Float[Tensor, "item 3"], Float[Tensor, "item 3 3"]]:
        """Reduce motions to x, y (m) and yaw (rad), with the covariance of the validation errors."""
        mean = torch.cat([motion[:, :2], motion[:, 5:] / DEGREES], dim=1)
        return mean, torch.diag(self.error).expand(motion.shape[0], -1, -1)


def _begin(net: nn.Module) -> None:
    """Initialise weights by Glorot, He and orthogonal matrices. With torch's smaller defaults, the output of this many
    layers hardly depends on the input, and training does not converge."""
    for module in net.modules():
        if isinstance(module, nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, a=0.1)
        elif isinstance(module, nn.Linear):
            nn.init.xavier_uniform_(module.weight)
        elif isinstance(module, nn.LSTM):
            for name, values in module.named_parameters():
                if "bias" in name:
                    nn.init.zeros_(values)
                    gates = values.detach().chunk(4)
                    gates[1].fill_(0.5)  # forget gate; there are two biases, which sum to 1
                    continue
                for gate in values.detach().chunk(4):
                    nn.init.orthogonal_(gate) if "_hh_" in name else nn.init.xavier_uniform_(gate)
