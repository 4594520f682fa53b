"""U-Net (Ronneberger et al., "U-Net: convolutional networks for biomedical image segmentation", 2015) of any width."""

from collections.abc import Iterable

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import max_pool2d, pad


def double_convolution(inputs: int, outputs: int, between: int | None = None) -> nn.Sequential:
    """Return two 3 x 3 convolutions that keep the size, with `between` channels between them, by default `outputs`."""
    channels = (inputs, between or outputs, outputs)
    layers: list[nn.Module] = []
    for before, after in zip(channels[:-1], channels[1:], strict=True):
        layers += [nn.Conv2d(before, after, 3, padding=1, bias=False), nn.BatchNorm2d(after), nn.ReLU()]
    return nn.Sequential(*layers)


class Up(nn.Module):
    """Upsampling step: doubles the size and joins the encoder's image of that size.

    Args:
        grow: layer that doubles the size.
        mix: layer that merges both images.
    """

    def __init__(self, grow: nn.Module, mix: nn.Module):
        super().__init__()
        self.grow, self.mix = grow, mix

    def forward(self, x: Tensor, beside: Tensor) -> Tensor:
        x = self.grow(x)
        rows, columns = (beside.shape[axis] - x.shape[axis] for axis in (2, 3))  # 1 where an odd size was halved
        return self.mix(torch.cat([beside, pad(x, (0, columns, 0, rows))], dim=1))


def through(x: Tensor, down: Iterable[nn.Module], up: Iterable[nn.Module]) -> Tensor:
    """Pass an image through the levels of an encoder, each of half the size, and of a decoder."""
    levels: list[Tensor] = []
    for convolution in down:
        levels.append(convolution(max_pool2d(levels[-1], 2) if levels else x))
    x = levels.pop()
    for each in up:
        x = each(x, levels.pop())
    return x


class UNet(nn.Module):
    """U-Net from images to images of the same size, at least 16 rows and columns.

    Args:
        inputs, outputs: channels.
        width: channels of the first level; the deepest of five has 16 times as many (paper: 64 and 1024).

    Attributes:
        coarse: see `ResNet18`.
    """

    def __init__(self, inputs: int, outputs: int, width: int = 16):
        super().__init__()
        widths = [width * 2**level for level in range(5)]
        self.down = nn.ModuleList(double_convolution(a, b) for a, b in zip([inputs, *widths[:-1]], widths, strict=True))
        self.up = nn.ModuleList(
            Up(nn.ConvTranspose2d(b, a, 2, 2), double_convolution(2 * a, a))
            for a, b in zip(widths[-2::-1], widths[:0:-1], strict=True)
        )
        self.head = nn.Conv2d(width, outputs, 1)
        self.coarse = False

    def forward(self, x: Float[Tensor, "item input row column"]) -> Float[Tensor, "item output row column"]:
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.coarse and self.training):
            x = through(x, self.down, self.up)
        return self.head(x.float())
