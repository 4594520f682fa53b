"""Points from polar pictures: roughening, labels, loss and points against plain loops, and a training that learns."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from radarize import polar
from radarize.features.table import Table
from radarize.methods.pictures import roughening
from radarize.methods.pictures.maps import FLOOR
from radarize.methods.pictures.network import COLUMNS
from radarize.methods.pictures.points import points
from radarize.methods.pictures.training import entropy, unpacked
from radarize.methods.registry import find_task


def levels(rows: list[int], items: int = 4, frames: int = 5) -> torch.Tensor:
    """A wall at each item's row, 40 dB above the rest."""
    found = torch.full((items, frames, 1, polar.ROWS, polar.COLUMNS), FLOOR)
    found[:, :, :, 6:, 8:56] = -40.0
    for item, row in zip(found, rows, strict=True):
        item[:, :, row, 8:56] = 0.0
    return found


def plain(levels: torch.Tensor) -> torch.Tensor:
    """Pictures by the authors' threshold, with nothing drawn but the middle of the bias."""
    threshold = torch.full((len(levels), 1, 1, 1), 20 * math.log10(polar.THRESHOLD))
    found = roughening.picture(levels[:, :, 0].float(), threshold)
    return roughening.shifted(found, torch.full((len(levels),), sum(roughening.BIAS) // 2))[:, :, None]


def test_plain_pictures_are_the_authors():
    """Kept within 26 dB and scaled per frame, read farther by the rig's bias."""
    found = plain(levels([20, 60, 100, 200]))
    for picture, row in zip(found[:, -1, 0], (20, 60, 100, 200), strict=True):
        assert set(picture.nonzero()[:, 0].tolist()) == {row + sum(roughening.BIAS) // 2} and picture.max() == 255


def test_roughened_pictures_keep_as_much_as_real_ones():
    maps = levels([20, 60, 100, 200]).repeat(16, 1, 1, 1, 1)
    maps = maps + 4 * torch.randn(maps.shape, generator=torch.Generator().manual_seed(0)) * (maps > FLOOR)
    found = roughening.rough(maps, torch.Generator().manual_seed(1))
    again = roughening.rough(maps, torch.Generator().manual_seed(1))
    assert torch.equal(found, again) and found.shape == maps.shape
    share = (found[:, -1, 0] > 0).float().mean(dim=(1, 2)).numpy()
    _, high = roughening.KEPT
    assert share.max() <= high + 0.06 and np.quantile(share, 0.1) < 0.07 and np.quantile(share, 0.9) > 0.1
    assert (found >= 0).all() and (found <= 255).all()
    # The wall stays the strongest row of most, within the spread of the bias.
    best = found[:, -1, 0].sum(dim=2).argmax(dim=1).reshape(16, 4) - torch.tensor([20, 60, 100, 200])
    assert ((best >= roughening.BIAS[0]) & (best <= roughening.BIAS[1])).float().mean() > 0.6


def test_labels_are_the_lidars():
    picture = np.zeros((1, polar.ROWS, polar.BEAMS), bool)
    picture[0, 7, 40:43] = picture[0, 9, 511] = True
    found = unpacked(torch.from_numpy(np.packbits(picture, axis=2)))
    assert found.shape == (1, polar.ROWS, COLUMNS) and found.sum() == 2 and found[0, 7, 10] == found[0, 9, 127] == 1


def test_loss_and_points_against_loops():
    generator = torch.Generator().manual_seed(0)
    logits = torch.randn((3, 257, COLUMNS), generator=generator).log_softmax(dim=1)
    label = (torch.rand((3, 256, COLUMNS), generator=generator) < 0.004).float()
    loss, found = entropy(logits, label), points(logits.exp(), 0.5)
    for item in range(3):
        total = 0.0
        for column in range(COLUMNS):
            rows = label[item, :, column].nonzero()[:, 0]
            total -= logits[item, rows, column].mean() if len(rows) else logits[item, 256, column]
            likely = logits[item, :, column].exp()
            there = found[item, :, column].nonzero()[:, 0].tolist()
            if 1 - likely[256] < 0.5:
                assert not there
            else:
                half = likely[:256].sum() / 2
                assert len(there) == 1 and likely[: there[0]].sum() < half <= likely[: there[0] + 1].sum() + 1e-6
        assert loss[item] == pytest.approx(float(total) / COLUMNS, rel=1e-5)


def test_it_learns_where_the_wall_is(one_thread):
    """A wall in the picture, and the lidar's point on it."""
    torch.manual_seed(0)
    task = find_task("pictures")
    settings = replace(task.defaults, width=4, rate=1e-2)
    rows = torch.tensor([40, 80, 120, 160])
    pictures = plain(levels(rows.tolist()))
    label = torch.zeros((4, polar.ROWS, COLUMNS))
    label[torch.arange(4), rows] = 1.0
    net = task.net(settings, None).train()
    optimiser = task.optimise(net.parameters(), settings)
    for _ in range(40):
        optimiser.zero_grad()
        task.loss(net, pictures, label).mean().backward()
        optimiser.step()
    with torch.inference_mode():  # as it trains: forty steps are few for running means
        found = points(net.estimate(pictures), 0.5)[:, :, 20:108].float()
    row = (found * torch.arange(polar.ROWS)[:, None]).sum(dim=(1, 2)) / found.sum(dim=(1, 2)).clamp_min(1)
    assert (row - rows).abs().max() < 4


def test_recordings_of_the_simulator_are_read(tmp_path):
    """Levels are made of samples of one loop; labels come packed."""
    from radarize.recording import RecordingWriter, Stream
    from tests.test_polar import RADAR, samples

    with RecordingWriter(
        tmp_path / "a.h5", RADAR, streams={"truth/lidar": Stream((polar.ROWS, polar.BEAMS // 8), "u1", "", "")}
    ) as writer:
        rows = {"truth/lidar": np.zeros((6, polar.ROWS, polar.BEAMS // 8), np.uint8)}
        writer.append(samples([(3.0, 0.2, 300)], frames=6), 0.05 * np.arange(6), rows=rows)
    task = find_task("pictures")
    table = task.table([tmp_path / "a.h5"])
    assert isinstance(table, Table) and table.maps["levels"].shape == (6, polar.ROWS, polar.COLUMNS)
    assert table.maps["levels"].max() == 0 and table.maps["levels"].min() == FLOOR
    assert task.header(task.defaults, table.grid).maps == ("picture",)
