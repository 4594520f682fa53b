"""The baselines' networks have the sizes of their papers, counted here layer by layer."""

import pytest
import torch

from radarize.baselines.milliego.network import MilliEgoNet
from radarize.baselines.radarhd.network import RadarHdNet, RadarHdPictureNet
from radarize.baselines.rnin.network import RninNet


def parameters(net: torch.nn.Module) -> int:
    return sum(values.numel() for values in net.parameters())


@pytest.mark.parametrize(
    ("net", "millions"),
    [
        (lambda: RadarHdNet(41, ("range_azimuth",), 64), 17.51),
        (lambda: RadarHdPictureNet(41, ("picture",), 64), 17.51),
        (lambda: MilliEgoNet(6, width=64), 33.98),
        (lambda: RninNet(10, width=64), 5.36),
    ],
)
def test_sizes_are_the_papers(net, millions):
    with torch.device("meta"):
        assert round(parameters(net()) / 1e6, 2) == millions
