"""Scans from occupancy probabilities: position of the first surface, and effect of the threshold."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from radarize.io.recording import Recording
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.segmentation import SegmentationNet
from radarize.learning.nets.weights import Header, build, example, save
from radarize.pipeline.method import Inputs
from radarize.pipeline.networked import segmentation
from radarize.radar.presets import PRESETS
from radarize.scans.segmentation import EDGE_OFFSET, HALF_WIDTH, SegmentationScans, at_column_centers, first_surface
from radarize.signal.batch import Preprocessor, Signal
from radarize.signal.bearings import BEARINGS
from radarsim.sensors.scan import RAYS, Cell, Occupancy
from tests.batches import of_spectrum
from tests.io.importers.public import captures

CONFIG = PRESETS["radarize"]


class FixedNetwork:
    """A network with a constant output."""

    def __init__(self, likely: np.ndarray):
        self.likely = torch.tensor(likely)

    def estimate(self, maps: torch.Tensor) -> torch.Tensor:
        return self.likely.expand(len(maps), -1, -1)


def test_first_surface_against_a_loop():
    """Compared with loops over cells: the distribution of the first occupied cell, and its most likely window of five
    cells."""
    likely = np.random.default_rng(0).beta(0.05, 0.5, (2, 30, 4))
    found = first_surface(likely, 0.4)
    for frame in range(2):
        for bearing in range(4):
            left, first = 1.0, []
            for h in likely[frame, :, bearing]:
                first.append(h * left)
                left *= 1 - h
            rows = [range(max(0, k - HALF_WIDTH), min(30, k + HALF_WIDTH + 1)) for k in range(30)]
            mass = [sum(first[i] for i in row) for row in rows]
            best = int(np.argmax(mass))
            expected = sum(i * first[i] for i in rows[best]) / mass[best] if mass[best] >= 0.4 else np.inf
            assert found[frame, bearing] == pytest.approx(expected)


@pytest.mark.parametrize("degrees", [0, 30, 60, -60])
def test_ranges_of_oblique_walls(degrees):
    """With the label as output of the network, ranges are those at the centre of a column, not of its nearest ray; at
    60 deg the difference is 2 cm."""
    normal, away = np.deg2rad(degrees), np.linspace(0.8, 1.4, 60)[:, None]
    label = Occupancy.label(
        SimpleNamespace(scenario=SimpleNamespace(config=CONFIG)), wall(away[..., None], normal, RAYS)
    )
    found = first_surface(np.where(label == Cell.SURFACE, 0.99, 1e-4), 0.5)
    ranges, true = found * CONFIG.range_resolution - CONFIG.range_bias, wall(away, normal, BEARINGS)
    there = np.isfinite(ranges) & (true < 4)
    error, before = at_column_centers(ranges)[there] - true[there], ranges[there] - true[there]
    assert abs(error.mean()) < 0.001
    assert np.sqrt(np.mean(error**2)) == pytest.approx(CONFIG.range_resolution / 12**0.5, rel=0.05)  # whole bins
    assert abs(degrees) < 60 or before.mean() < -0.015


def test_the_outermost_ray_is_the_labels():
    assert RAYS.max(axis=1) - BEARINGS == pytest.approx(EDGE_OFFSET * np.diff(BEARINGS)[0])


def wall(away, normal, bearings):
    """Ranges of a plane at a distance, m, whose normal has the given bearing."""
    across = np.cos(bearings - normal)
    return np.where(across > 0.05, away / np.maximum(across, 0.05), 100.0)


def test_a_step_in_range_is_no_wall():
    ranges = np.array([[1.0, 1.1, 1.2, 3.0, np.inf, 2.0, 2.0, np.inf]])
    expected = [[1 + 0.0375, 1.1 + 0.0375, 1.2 + 0.0375, 3.0, np.inf, 2.0, 2.0, np.inf]]
    assert at_column_centers(ranges) == pytest.approx(np.array(expected))
    assert at_column_centers(ranges[:, ::-1]) == pytest.approx(np.array(expected)[:, ::-1])


@pytest.fixture
def untrained(tmp_path):
    """Weights of an untrained network."""
    header = Header(
        kind="segmentation", frames=1, maps=("range_azimuth", "elevation_aware"), width=2,
        grid=MapGrid.of(CONFIG, "range_azimuth"),
    )  # fmt: skip
    net = build(SegmentationNet, header)
    net(*example(net, header))
    return save(net.eval(), header, tmp_path / "s.safetensors")


def test_ghosts_behind_a_surface_and_guesses_are_not_returned(untrained):
    signal = Signal(CONFIG)
    ranges = signal.heatmaps.ranges
    scans = SegmentationScans(CONFIG, untrained)
    zeros = torch.zeros(2, CONFIG.samples, CONFIG.loops, 12, dtype=torch.complex64)
    batch = of_spectrum(signal, zeros, np.arange(2) * CONFIG.frame_period)
    assert scans.extract(batch).shape == (2, len(BEARINGS))

    likely = np.full((1, CONFIG.samples, len(BEARINGS)), 1e-4)
    likely[0, 29:32, 10] = 0.4, 0.8, 0.5  # a surface
    likely[0, 60, 10] = 0.99  # a ghost behind it
    likely[0, 40, 20] = 0.45  # a guess
    scans._net = FixedNetwork(likely)
    found = scans.extract(batch)
    step = ranges[1] - ranges[0]
    assert np.allclose(found[:, 10], ranges[30], atol=step / 2)
    assert np.isinf(found[:, 20]).all() and np.isfinite(found).sum() == 2
    assert first_surface(likely, 0.4)[0, 20] == pytest.approx(40, abs=0.5)
    alone = SegmentationScans(CONFIG, untrained, first=False)
    alone._net = FixedNetwork(likely)
    found = alone.extract(batch)
    assert np.allclose(found[:, 10], ranges[60], atol=step / 2) and np.isfinite(found).sum() == 2


class FixedScans:
    """Scan extractor with given ranges."""

    def __init__(self, ranges: np.ndarray):
        self.ranges = ranges

    def extract(self, batch):
        return np.tile(self.ranges, (len(batch), 1))


def test_echoes_beyond_the_range_of_the_network(untrained):
    """Ranges are in metres whatever the range bins of the radar; nearer echoes are left to the network."""
    radar = PRESETS["long-range"]
    far = np.full(len(BEARINGS), np.inf)
    far[[10, 20, 30]] = 8.0, 9.0, 3.0
    likely = np.full((1, CONFIG.samples, len(BEARINGS)), 1e-4)
    likely[0, 44:47, 10] = 0.4, 0.9, 0.4
    signal = Signal(radar)
    batch = of_spectrum(
        signal, torch.zeros(2, radar.samples, radar.loops, 12, dtype=torch.complex64), np.arange(2) / 30
    )
    scans = SegmentationScans(radar, untrained, beyond=FixedScans(far))
    scans._net = FixedNetwork(likely)
    found = scans.extract(batch)
    assert np.allclose(found[:, 10], 45 * CONFIG.range_resolution, atol=0.5 * CONFIG.range_resolution)
    assert (found[:, 20] == 9.0).all() and np.isinf(found[:, 30]).all() and np.isfinite(found).sum() == 4
    near = SegmentationScans(CONFIG, untrained, beyond=FixedScans(far))  # no range beyond the network's
    near._net = FixedNetwork(likely)
    batch = of_spectrum(Signal(CONFIG), torch.zeros(1, CONFIG.samples, CONFIG.loops, 12, dtype=torch.complex64), [0.0])
    assert np.isfinite(near.extract(batch)).sum() == 1


def test_documented_echoes_of_real_captures_are_seen(recordings, tmp_path):
    """With the shipped network, which is trained on neither these radars nor real frames: an object at 1.57 m ahead of
    a 60 GHz board, on all bearings within 3 deg but one at most, and two people at 2.93 m in front of a 77 GHz board,
    and nothing else."""
    found = {}
    for name, path in captures(recordings, tmp_path).items():
        if name != "pcap":  # one antenna
            with Recording(path) as recording:
                inputs = Inputs(recording.config)
                batch = Preprocessor(inputs.signal).process(recording.adc(0, 1), recording.times[:1])
                (found[name],) = segmentation(inputs).extract(batch)
    ahead = found["studio"][np.abs(BEARINGS) < np.radians(3)]
    seen = ahead[np.isfinite(ahead)]
    assert len(seen) >= len(ahead) - 1 and seen == pytest.approx(np.full(len(seen), 1.57), abs=0.06)
    people = found["people"][np.isfinite(found["people"])]
    assert len(people) and people == pytest.approx(np.full(len(people), 2.93), abs=0.15)
