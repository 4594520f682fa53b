"""A network that classifies pictures as real or simulated, with cross-validation over walks.

Its balanced accuracy measures realism: 50 % is chance, the ideal. Walks are divided into folds; one of the training
    folds
is the validation set for early stopping.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor, nn

from benchmarks.likeness.pictures import Bursts

#: Number of folds of the cross-validation.
FOLDS = 5
#: Training: learning rate, batch size, maximum number of epochs, and of epochs without improvement.
RATE, BATCH, EPOCHS, PATIENCE = 1e-3, 64, 16, 4


def network(channels: int, width: int = 16) -> nn.Sequential:
    """Return a network of five strided convolutions, and mean and maximum pooling over the picture."""

    def layer(least: int, most: int, size: int) -> list[nn.Module]:
        return [nn.Conv2d(least, most, size, stride=2, padding=size // 2), nn.GroupNorm(4, most), nn.ReLU()]

    sizes = [width, width * 2, width * 4, width * 4, width * 8]
    return nn.Sequential(
        *layer(channels, sizes[0], 5),
        *(module for least, most in zip(sizes[:-1], sizes[1:], strict=True) for module in layer(least, most, 3)),
        _Pooled(), nn.Dropout(0.3), nn.Linear(2 * sizes[-1], 1), nn.Flatten(0),
    )  # fmt: skip


class _Pooled(nn.Module):
    """Mean and maximum over the picture."""

    def forward(self, found: Float[Tensor, "n channel row column"]) -> Float[Tensor, "n 2channel"]:
        return torch.cat([found.mean(dim=(2, 3)), found.amax(dim=(2, 3))], dim=1)


@dataclass(frozen=True)
class Judged:
    """Results of a discriminator on test folds.

    Attributes:
        accuracy: balanced accuracy of each fold.
        real, simulated: output (> 0: simulated) for the samples of each walk.
    """

    accuracy: Float[np.ndarray, "fold"]
    real: list[Float[np.ndarray, "sample"]]
    simulated: list[Float[np.ndarray, "sample"]]


def single(bursts: Bursts) -> UInt8[np.ndarray, "sample 1 range azimuth"]:
    """Return samples of single pictures."""
    return bursts.reshape(-1, 1, *bursts.shape[2:])


def pairs(bursts: Bursts) -> UInt8[np.ndarray, "sample 2 range azimuth"]:
    """Return samples of two pictures 0.2 s apart (`pictures.OFFSETS`)."""
    return np.concatenate([bursts[:, [0, 2]], bursts[:, [3, 4]]])


def judge(real: list[UInt8[np.ndarray, "..."]], simulated: list[UInt8[np.ndarray, "..."]], seed: int) -> Judged:
    """Train and test on each fold.

    Args:
        real, simulated: samples of each walk.
        seed: seed of folds, networks and their training.
    """
    walks = [*real, *simulated]
    label = np.repeat([0, 1], [len(real), len(simulated)])
    rng = np.random.default_rng(seed)
    fold = np.concatenate([rng.permutation(len(some)) % FOLDS for some in (real, simulated)])
    outputs: list = [None] * len(walks)
    accuracy = []
    for k in range(FOLDS):
        test, held = fold == k, fold == (k + 1) % FOLDS
        model = _trained(*_gathered(walks, label, ~test & ~held), *_gathered(walks, label, held), seed + k)
        for walk in np.flatnonzero(test):
            outputs[walk] = _output(model, torch.from_numpy(walks[walk]))
        accuracy.append(_balanced([outputs[w] for w in np.flatnonzero(test)], label[test]))
    return Judged(np.array(accuracy), outputs[: len(real)], outputs[len(real) :])


def _gathered(walks: list, label: np.ndarray, some: np.ndarray) -> tuple[Tensor, Tensor]:
    index = np.flatnonzero(some)
    samples = torch.from_numpy(np.concatenate([walks[w] for w in index]))
    return samples, torch.from_numpy(np.repeat(label[index], [len(walks[w]) for w in index]).astype(np.float32))


def _trained(x: Tensor, y: Tensor, x_held: Tensor, y_held: Tensor, seed: int) -> nn.Module:
    """Train until the validation loss no longer falls; return the network of the best epoch."""
    torch.manual_seed(seed)
    model = network(x.shape[1])
    optimizer = torch.optim.AdamW(model.parameters(), RATE, weight_decay=1e-2)
    # Both classes have the same weight.
    weight = torch.where(y > 0, (1 - y.mean()) / y.mean(), 1.0)
    best, state, waited = np.inf, None, 0
    for _ in range(EPOCHS):
        model.train()
        for index in torch.randperm(len(x)).split(BATCH):
            samples = x[index].float() / 255
            samples = torch.where(torch.rand(len(index), 1, 1, 1) < 0.5, samples, samples.flip(3))
            loss = nn.functional.binary_cross_entropy_with_logits(model(samples), y[index], weight[index])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        found = nn.functional.binary_cross_entropy_with_logits(torch.from_numpy(_output(model, x_held)), y_held).item()
        waited += 1
        if found < best:
            best, waited, state = found, 0, {k: v.clone() for k, v in model.state_dict().items()}
        if waited >= PATIENCE:
            break
    model.load_state_dict(state)
    return model


@torch.no_grad()
def _output(model: nn.Module, x: Tensor) -> Float[np.ndarray, "sample"]:
    model.eval()
    return torch.cat([model(part.float() / 255) for part in x.split(256)]).numpy()


def _balanced(outputs: list[np.ndarray], label: np.ndarray) -> float:
    """Return the mean over both classes of the share classified correctly."""
    shares = [np.concatenate([o > 0 for o, k in zip(outputs, label, strict=True) if k == kind]) for kind in (0, 1)]
    return float((np.mean(~shares[0]) + np.mean(shares[1])) / 2)
