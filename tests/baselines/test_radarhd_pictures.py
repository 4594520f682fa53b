"""RadarHD's network on pictures: what it sees and answers, its loss, its rule for points, and a training."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.nn.functional import pad

import radarize
from radarize.baselines.pictures.maps import PictureMaker
from radarize.baselines.pictures.training import UNKNOWN, chamfer, unpacked
from radarize.baselines.radarhd.network import DRAWN, SEEN, RadarHdNet, RadarHdPictureNet, columns
from radarize.baselines.radarhd.pictures import LEAST, known
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets.unet import through
from radarize.learning.nets.weights import load, save
from radarize.learning.task import find_task
from radarize.learning.training.team import Team
from radarize.learning.training.trainer import Trainer
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from tests.baselines.test_pictures import RADAR, heard

pytestmark = pytest.mark.usefixtures("one_thread")

TASK = find_task("radarhd-pictures")
#: Of a training: a second of frames every 0.2 s.
QUICK = replace(TASK.defaults, width=4, frames=2, epochs=2, batch=2, rate=1e-2)


@torch.no_grad()
def repeating(frames: int = 2) -> RadarHdPictureNet:
    """A network that draws the newest picture as it is, certain of each cell of more than half of the largest grey: all
    of its filters are nothing, but for the middle of those along the shortest way."""
    net = RadarHdPictureNet(frames, ("picture",), 4).eval()
    for values in net.parameters():
        if values.ndim == 4:
            values.zero_()
    for block, channel in ((net.down[0], frames - 1), (net.up[-1].mix, 0), *((each.mix, 0) for each in net.sharpen)):
        block[0].weight[0, channel, 1, 1] = block[3].weight[0, 0, 1, 1] = 1
    net.head.weight[0, 0] = 40
    net.head.bias.fill_(-20)
    return net


def weights(net: RadarHdPictureNet, path: Path) -> Path:
    """Its file, as training writes it."""
    settings = replace(TASK.defaults, width=4, frames=net.frames)
    return save(net, TASK.header(settings, MapGrid.of(RADAR, "antennas", PictureMaker)), path)


def test_pictures_become_pictures_of_the_same_half_circle(tmp_path):
    """An edge stays at its azimuth, between the radar's columns as finely as the lidar's are."""
    net, header = load(weights(repeating(), tmp_path / "net.safetensors"), RadarHdPictureNet, PRESETS["radarhd"])
    assert (header.kind, header.maps, header.grid.rows, header.grid.azimuths) == (
        "radarhd-pictures",
        ("picture",),
        256,
        64,
    )
    pictures = torch.zeros((1, 2, 1, polar.ROWS, polar.COLUMNS))
    pictures[0, 0] = 255
    pictures[0, 1, 0, 76, 20:44] = 255
    found = net.estimate(pictures)
    assert found.shape == (1, polar.ROWS, polar.BEAMS) and 0 <= found.min() and found.max() <= 1
    rows, beams = (found[0] > net.least).nonzero().T
    assert set(rows.tolist()) == {76}
    seen, between = polar.BEAM_AZIMUTHS[beams.numpy()], polar.AZIMUTHS[1] - polar.AZIMUTHS[0]
    assert seen[0] == pytest.approx(polar.AZIMUTHS[20] - between / 2, abs=between / 8)
    assert seen[-1] == pytest.approx(polar.AZIMUTHS[43] + between / 2, abs=between / 8)


def test_shipped_weights_for_maps_say_what_they_said():
    """To the bit: against what is seen of maps written out, and the same layers."""
    net, header = load(Path(radarize.__file__).parent / "learning" / "weights" / "radarhd.safetensors", RadarHdNet)
    rows, azimuths = header.grid.rows, header.grid.azimuths
    noise = torch.Generator().manual_seed(0)
    maps = 10 * torch.randn((2, header.frames, 1, rows, azimuths), generator=noise)
    place = np.radians(np.arange(-59.25, 60.0, 1.5))
    resampling = np.stack([np.interp(columns(SEEN), place, row) for row in np.eye(azimuths)])
    image = (maps @ torch.tensor(resampling, dtype=torch.float32))[:, :, 0, 6:]
    image = (1 + (image - image.amax(dim=(2, 3), keepdim=True)) / (-20 * np.log10(0.05))).clamp_min(0)
    with torch.inference_mode():
        expected = net.head(net.sharpen(through(pad(image, (0, 0, 6, 0)), net.down, net.up)))[:, 0].sigmoid()
        assert torch.equal(net.estimate(maps), expected) and expected.shape == (2, rows, DRAWN)


def test_loss_against_loops():
    """0.9 cross-entropy + 0.1 Dice loss; the output in unknown columns has no effect."""
    noise = torch.Generator().manual_seed(0)
    logits, label = torch.randn((2, 8, 6), generator=noise), (torch.rand((2, 8, 6), generator=noise) < 0.3).float()
    label[1, :, 4:] = UNKNOWN
    found = known(logits, label)
    for item in range(2):
        entropy = shared = total = 0.0
        for row in range(8):
            for column in range(6):
                true, likely = float(label[item, row, column]), float(torch.sigmoid(logits[item, row, column]))
                if true == UNKNOWN:
                    continue
                entropy -= np.log(likely if true else 1 - likely) / 48
                shared, total = shared + likely * true, total + likely + true
        assert float(found[item]) == pytest.approx(0.9 * entropy + 0.1 * (1 - (2 * shared + 1) / (total + 1)), rel=1e-4)
    assert torch.equal(known(logits + 3 * (label == UNKNOWN), label), found)


def table(rows: list[float], frames: int = 5) -> FeatureTable:
    """Recordings of a wall each, as antennas hear it and a lidar sees it."""
    antennas = heard(rows, items=len(rows), frames=frames).flatten(0, 2).half()
    lidar = np.zeros((len(rows), frames, polar.ROWS, polar.BEAMS), bool)
    for each, row in zip(lidar, rows, strict=True):
        each[:, int(row), 200:312] = True
    packed = torch.from_numpy(np.packbits(lidar, axis=3)).flatten(0, 1)
    grid = MapGrid.of(RADAR, "antennas", PictureMaker)
    return FeatureTable({"antennas": antennas}, {"lidar": packed}, [frames] * len(rows), grid, 0.2)


def test_it_is_trained_on_what_ours_is_trained_on(monkeypatch):
    """The same items, but that labels have all beams; steps make the loss smaller."""
    shown = table([60.0, 120.0])
    frames = torch.tensor([[0, 1], [6, 7]])
    ours, same = (
        task.augment(task.inputs(shown, frames), task.label(shown, frames), torch.Generator().manual_seed(3))
        for task in (find_task("pictures"), TASK)
    )
    assert torch.equal(ours[0], same[0]) and same[1].shape == (2, polar.ROWS, polar.BEAMS)
    assert torch.equal((ours[1] == 1).any(dim=1), (same[1] == 1).any(dim=1).unflatten(1, (-1, 4)).any(dim=2))
    monkeypatch.setattr(type(TASK), "share", 1.0)
    trainer = Trainer(TASK, QUICK, shown, table([90.0]), Team(0, 1, torch.device("cpu")))
    while not trainer.finished:
        trainer.train_epoch()
    assert trainer.history[1]["loss"] < trainer.history[0]["loss"]
    assert trainer.finish()["chamfer_m"] > 0 and float(trainer.net.least) in LEAST


def test_the_threshold_is_that_of_the_nearest_points():
    """The fitted probability separates likely cells with points of the lidar from less likely ones without."""
    label = np.zeros((1, polar.ROWS, polar.BEAMS), bool)
    label[0, 80, 100:400] = True

    class Constant(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.register_buffer("least", torch.tensor(0.5))

        def estimate(self, maps):
            found = torch.zeros((1, polar.ROWS, polar.BEAMS))
            found[0, 80, 100:400], found[0, 150, 100:400] = 0.33, 0.22
            return found

    net, packed = Constant(), torch.from_numpy(np.packbits(label, axis=2))
    TASK.calibrate(net, [(heard([80.0], items=1, frames=2), packed)])
    assert 0.22 < float(net.least) < 0.33
    apart = chamfer(net.estimate(None) > 0.5, unpacked(packed, DRAWN))
    assert apart.tolist() == pytest.approx([polar.REACH / 2])  # no points: nothing is near
