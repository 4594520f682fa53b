"""Scans from occupancy: where the first surface is, and what the threshold does."""

import numpy as np
import torch

from radarize.mapping.scans import BEARINGS
from radarize.mapping.segmentation import Segmentation
from radarize.nets.weights import Grid, Header, build, example, save
from radarize.radar.presets import PRESETS
from radarize.training.maps import MapMaker

CONFIG = PRESETS["radarize"]


class Says:
    """A network with one answer."""

    def __init__(self, likely: np.ndarray):
        self.likely = torch.tensor(likely)

    def estimate(self, maps: torch.Tensor) -> torch.Tensor:
        return self.likely.expand(len(maps), -1, -1)


def test_the_first_likely_cell_is_the_surface(tmp_path):
    header = Header(
        kind="segmentation", frames=1, maps=("range_azimuth", "elevation_aware"), width=2,
        grid=Grid.of(CONFIG, "range_azimuth"),
    )  # fmt: skip
    net = build(header)
    net(*example(header))
    maker = MapMaker(CONFIG)
    scans = Segmentation(maker, save(net.eval(), header, tmp_path / "s.safetensors"))
    spectrum = torch.zeros(2, CONFIG.samples, CONFIG.loops, 12, dtype=torch.complex64)
    assert scans.scan(spectrum).shape == (2, len(BEARINGS))

    likely = np.full((1, CONFIG.samples, len(BEARINGS)), 0.01)
    likely[0, 29:32, 10] = 0.4, 0.9, 0.4  # a surface
    likely[0, 60, 10] = 0.99  # a ghost behind it
    likely[0, 40, 20] = 0.45  # a guess
    scans._windows.net = Says(likely)
    found = scans.scan(spectrum)
    step = maker.heatmaps.ranges[1] - maker.heatmaps.ranges[0]
    assert np.allclose(found[:, 10], maker.heatmaps.ranges[30], atol=step / 100)
    assert np.isinf(found[:, 20]).all() and np.isfinite(found).sum() == 2
    scans.least = 0.4
    assert np.allclose(scans.scan(spectrum)[:, 20], maker.heatmaps.ranges[40], atol=step / 2)
