"""ResNet18 (He et al., "Deep residual learning for image recognition", 2016) of any width."""

from types import EllipsisType

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import relu


class Block(nn.Module):
    """Residual block of two convolutions, over 1 or 2 axes: 3 over time, 3 x 3 over images."""

    def __init__(self, inputs: int, outputs: int, stride: int, axes: int):
        super().__init__()
        convolution, norm = (nn.Conv1d, nn.BatchNorm1d) if axes == 1 else (nn.Conv2d, nn.BatchNorm2d)
        self.body = nn.Sequential(
            convolution(inputs, outputs, 3, stride, 1, bias=False), norm(outputs), nn.ReLU(),
            convolution(outputs, outputs, 3, 1, 1, bias=False), norm(outputs),
        )  # fmt: skip
        # A strided 1 x 1 convolution of less than 16 channels in channels-last format makes oneDNN write past its
        # memory in training (github.com/uxlfoundation/oneDNN/issues/6035); in that case every second cell is selected
        # before it.
        before = stride if inputs < 16 else 1
        self.every: tuple[EllipsisType | slice, ...] = (..., *[slice(None, None, before)] * axes)
        self.shortcut: nn.Module = nn.Identity()
        if stride != 1 or inputs != outputs:
            self.shortcut = nn.Sequential(convolution(inputs, outputs, 1, stride // before, bias=False), norm(outputs))

    def forward(self, x: Tensor) -> Tensor:
        return relu(self.body(x) + self.shortcut(x[self.every]))


def stages(width: int, axes: int = 2) -> nn.Sequential:
    """Return four stages of two blocks; each but the first halves the size and doubles the channels, from `width`
    on."""
    widths = [width, width, 2 * width, 4 * width, 8 * width]
    return nn.Sequential(
        *(
            nn.Sequential(Block(before, after, 1 if before == after else 2, axes), Block(after, after, 1, axes))
            for before, after in zip(widths[:-1], widths[1:], strict=True)
        )
    )


class ResNet18(nn.Module):
    """ResNet18 from images to numbers.

    Args:
        inputs: channels of an image.
        outputs: number of outputs.
        width: channels of the first stage; 64 in the original. Cost grows with its square.
        stride: stride of the first convolution, rows and columns; 2, 2 in the original.
        pool: whether a 2 x 2 maximum follows the first convolution, as in the original. Heat maps have 40 columns where
            photographs have 224, so less downsampling is possible.

    Attributes:
        coarse: whether training uses bfloat16 in convolutions, which is up to twice as fast.
    """

    def __init__(self, inputs: int, outputs: int, width: int = 16, stride: tuple[int, int] = (2, 2), pool: bool = True):
        super().__init__()
        self.stem = nn.Sequential(nn.Conv2d(inputs, width, 7, stride, 3, bias=False), nn.BatchNorm2d(width), nn.ReLU())
        if pool:
            self.stem.append(nn.MaxPool2d(3, 2, 1))
        self.stages = stages(width)
        self.head: nn.Module = nn.Linear(8 * width, outputs)
        self.coarse = False
        for module in self.modules():
            if isinstance(module, nn.Conv2d) and not module.weight.is_meta:  # weights on "meta" have sizes only
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, x: Float[Tensor, "item channel row column"]) -> Float[Tensor, "item output"]:
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.coarse and self.training):
            x = self.stages(self.stem(x))
        return self.head(torch.mean(x.float(), dim=(2, 3)))
