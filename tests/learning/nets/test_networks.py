"""The networks: sizes by formula, invariances, and normal distributions."""

import numpy as np
import pytest
import torch
from torch.nn.functional import conv1d, conv2d, relu

from radarize.learning.nets.correlation import Correlation, Moved
from radarize.learning.nets.gaussian import Gaussian
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.learning.nets.resnet import Block, ResNet18
from radarize.learning.nets.segmentation import SegmentationNet
from radarize.learning.nets.unet import UNet
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import AZIMUTHS

NETS = {net.kind: net for net in (TranslationNet, RotationNet, SegmentationNet)}


def parameters(net: torch.nn.Module) -> int:
    return sum(values.numel() for values in net.parameters())


def resnet_parameters(inputs: int, outputs: int, w: int) -> int:
    """Convolutions have k^2 weights per pair of channels, batch normalisation two per channel."""
    count = 49 * inputs * w + 2 * w
    for before, after in ((w, w), (w, 2 * w), (2 * w, 4 * w), (4 * w, 8 * w)):
        count += 9 * before * after + 3 * 9 * after * after + 4 * 2 * after
        count += before * after + 2 * after if before != after else 0
    return count + 8 * w * outputs + outputs


@pytest.mark.parametrize(("inputs", "outputs", "width"), [(3, 1000, 64), (3, 2, 64), (8, 5, 16)])
def test_resnet_is_the_textbooks(inputs, outputs, width):
    assert parameters(ResNet18(inputs, outputs, width)) == resnet_parameters(inputs, outputs, width)


def test_resnet_of_the_paper_has_11_million_parameters():
    """11,689,512 for a thousand classes of photographs (He et al.; torchvision lists the same)."""
    assert parameters(ResNet18(3, 1000, 64)) == 11_689_512
    assert parameters(ResNet18(3, 1000, 64)) - 513_000 == 11_176_512
    wide = TranslationNet(1, ("doppler_azimuth",), 64)
    assert parameters(wide) == 2 * resnet_parameters(3, 5, 64)  # two looks
    assert parameters(TranslationNet(3, ("a", "b"), 16)) < 1_440_000  # 2.9 MB in float16


@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize(("channels", "stride"), [(3, 1), (16, 2)])
def test_a_shortcut_is_a_convolution_with_a_stride(axes, channels, stride):
    """Equal output, although blocks with few channels avoid the layer in which oneDNN writes past its memory."""
    block = Block(channels, 20, 2, axes).double().eval()
    x = torch.randn(2, channels, *(9, 12)[:axes], dtype=torch.float64)
    mix, norm = block.shortcut
    strided = (conv1d, conv2d)[axes - 1](x, mix.weight, stride=2)
    assert torch.allclose(block(x), relu(block.body(x) + norm(strided)), rtol=1e-12)
    assert mix.stride == (stride,) * axes


def test_unet_is_the_textbooks():
    """31.04 M for width 64, three channels and two classes, with batch normalisation."""
    widths = [64, 128, 256, 512, 1024]
    count = 64 * 2 + 2
    for before, after in zip([3, *widths[:-1]], widths, strict=True):
        count += 9 * (before + after) * after + 4 * after
    for w in widths[:-1]:
        count += 4 * 2 * w * w + w + 9 * (2 * w + w) * w + 4 * w
    assert parameters(UNet(3, 2, 64)) == count == 31_037_698


@pytest.mark.parametrize(("rows", "columns"), [(96, 88), (24, 40), (17, 31)])
def test_unet_keeps_any_size(rows, columns):
    assert UNet(2, 1, 2)(torch.zeros(2, 2, rows, columns)).shape == (2, 1, rows, columns)


@pytest.mark.parametrize("dimensions", [1, 2])
def test_gaussian(dimensions):
    """Compared with torch's multivariate normal distribution."""
    torch.manual_seed(0)
    found = Gaussian.of(torch.randn(50, Gaussian.numbers(dimensions)), dimensions)
    truth = torch.randn(50, dimensions)
    expected = torch.distributions.MultivariateNormal(found.mean, found.covariance).log_prob(truth)
    constant = dimensions / 2 * np.log(2 * np.pi)
    assert torch.allclose(found.negative_log_likelihood(truth), -expected - constant, atol=1e-4)


def test_the_likelihood_finds_mean_and_covariance():
    """Samples of a known distribution are fitted, with and without the weighting."""
    torch.manual_seed(0)
    factor = torch.tensor([[0.5, 0.0], [-0.3, 0.2]])
    truth = torch.randn(500, 2) @ factor.T + torch.tensor([1.0, -2.0])
    for beta in (0.0, 0.5):
        numbers = torch.zeros(1, Gaussian.numbers(2), requires_grad=True)
        optimiser = torch.optim.Adam([numbers], 0.03)
        for _ in range(300):
            found = Gaussian.of(numbers.expand(len(truth), -1), 2)
            loss = found.negative_log_likelihood(truth, beta).mean()
            optimiser.zero_grad(), loss.backward(), optimiser.step()
        found = Gaussian.of(numbers.detach(), 2)
        assert torch.allclose(found.mean[0], truth.mean(dim=0), atol=0.02)
        assert torch.allclose(found.covariance[0], torch.cov(truth.T), atol=0.02)


def test_squared_errors_of_an_honest_distribution():
    torch.manual_seed(0)
    found = Gaussian.of(torch.randn(1, 5).expand(20000, -1), 2)
    truth = torch.distributions.MultivariateNormal(found.mean, found.covariance).sample()
    assert found.errors_squared(truth).mean() == pytest.approx(2, rel=0.05)


@pytest.mark.parametrize("kind", NETS)
def test_gain_does_not_matter(kind):
    torch.manual_seed(0)
    net = NETS[kind](2, ("a", "b"), 4).eval()
    maps = 10 * torch.randn(3, 2, 2, 32, 80)
    travel = (torch.zeros(3, 2),) if kind == "rotation" else ()
    for a, b in zip(net.estimate(maps, *travel), net.estimate(maps + 17, *travel), strict=True):
        assert torch.allclose(a, b, atol=1e-4)


def test_a_turn_back_is_the_turn_negated():
    torch.manual_seed(0)
    net = RotationNet(2, ("range_azimuth",), 4).eval()
    maps = 10 * torch.randn(3, 2, 1, 96, 80)
    travel = torch.tensor([[0.2, 0.0], [0.1, -0.1], [0.0, 0.3]])
    (there, one), (back, other) = net.estimate(maps, travel), net.estimate(maps.flip(1), -travel)
    assert torch.allclose(there, -back, atol=1e-6) and torch.allclose(one, other)
    assert there.shape == (3, 1) and one.shape == (3, 1, 1) and (one > 0).all()


def test_the_second_look_sees_the_ridge_flat_and_in_the_middle():
    """Holds also for a velocity at which a part of the ridge aliases."""
    step, rows = 0.1146, 32
    net = TranslationNet(1, ("doppler_azimuth",), 4, step)
    for forward, left in ((0.7, -0.3), (1.75, 0.9), (-1.2, 0.0)):
        closing = forward * np.cos(AZIMUTHS) + left * np.sin(AZIMUTHS)
        off = (np.arange(rows)[:, None] - rows // 2 - closing / step + rows / 2) % rows - rows / 2
        image = torch.tensor(np.exp(-0.5 * (off / 1.5) ** 2), dtype=torch.float32)[None, None]
        flat = net._rolled(image, torch.tensor([[forward, left]]))[0, 0]
        expected = np.exp(-0.5 * (np.arange(-net.near, net.near + 1) / 1.5) ** 2)
        assert np.abs(flat.numpy() - expected[:, None]).max() < 0.06  # linear interpolation at the crest
        shifted = net._rolled(image, torch.tensor([[forward - step, left]]))[0, 0, :, 40]
        assert shifted.argmax() == net.near + 1


def test_maps_from_a_step_away():
    """A point keeps its position in the world, compared with its position seen from there."""
    ranges = np.arange(96)[:, None] * 0.0446

    def pole(ahead: float, left: float) -> torch.Tensor:
        off = (ranges - np.hypot(ahead, left)) / 0.15, (AZIMUTHS - np.arctan2(left, ahead)) / 0.1
        return torch.tensor(np.exp(-0.5 * off[0] ** 2 - 0.5 * off[1] ** 2), dtype=torch.float32)[None, None]

    for forward, left in ((0.3, -0.2), (-0.2, 0.1), (0.0, 0.3)):
        seen = Moved(0.0446)(pole(2.0, 0.5), torch.tensor([[forward, left]]))
        expected = pole(2.0 - forward, 0.5 - left)
        at, there = (np.unravel_index(int(maps.argmax()), (96, 80)) for maps in (seen, expected))
        assert np.abs(np.subtract(at, there)).max() <= 1
        assert (seen - expected).abs().max() < 0.2  # its polar width changes with its distance


def test_correlation_is_the_sum_of_products():
    """Compared with loops over steps, shifts and cells; cells shifted out of the map do not count."""
    torch.manual_seed(0)
    layer = Correlation(1, 10, features=1, turns=3, steps=1)
    layer.features = torch.nn.Identity()
    maps = torch.randn(1, 2, 1, 5, 10)
    found = layer(maps, reversed_too=True)
    assert found.shape == (2, 3, 5, 7) and torch.equal(layer(maps), found[:1])
    for half, (newest, other) in enumerate(((1, 0), (0, 1))):
        centred = maps - maps.mean(dim=4, keepdim=True)
        a, b = (torch.nn.functional.normalize(centred[0, k], dim=0, eps=0.1)[0] for k in (newest, other))
        for step in (-1, 0, 1):
            for row in range(5):
                for turn in range(-3, 4):
                    cells = [(row + step, c + turn, c) for c in range(10)]
                    inside = [(r, c, d) for r, c, d in cells if 0 <= r < 5 and 0 <= c < 10]
                    total = sum(float(a[r, c] * b[row, d]) for r, c, d in inside) / 10**0.5
                    assert float(found[half, step + 1, row, turn + 3]) == pytest.approx(total, abs=1e-5)


def test_segmentation_sees_the_columns_of_its_bearings():
    net = SegmentationNet(1, ("range_azimuth",), 4).eval()
    shown = torch.tensor(AZIMUTHS, dtype=torch.float32) @ net.resampling
    assert np.allclose(shown, BEARINGS, atol=1e-6)
    found = net.estimate(torch.zeros(2, 1, 1, 96, 80))
    assert found.shape == (2, 96, 88) and ((found > 0) & (found < 1)).all()
