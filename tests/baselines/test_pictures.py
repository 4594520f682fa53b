"""Points from polar pictures: roughening, labels, loss and points against plain loops, and a training that learns."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from radarize.baselines.pictures import roughening
from radarize.baselines.pictures.maps import BINS, PictureMaker
from radarize.baselines.pictures.memory import LASTS, Memory
from radarize.baselines.pictures.network import COLUMNS
from radarize.baselines.pictures.points import first_surfaces, points
from radarize.baselines.pictures.training import BIAS, UNKNOWN, biased, entropy, rolled, unpacked, zoomed
from radarize.learning.features.table import FeatureTable
from radarize.learning.task import find_task
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from tests.signal.test_polar import samples

#: rad, from column to column of a picture.
STEP = polar.AZIMUTHS[1] - polar.AZIMUTHS[0]


RADAR = PRESETS["radarhd"].model_copy(update={"loops": 1})


def heard(bins: list[float], items: int = 4, frames: int = 5, sine: float = 0.0) -> torch.Tensor:
    """What four antennas hear of an echo in each item's range bin, 40 dB above noise."""
    rng = np.random.default_rng(0)
    found = 0.005 * rng.normal(size=(items, frames, 1, BINS, 4, 2)) @ [1, 1j]
    for item, place in zip(found, bins, strict=True):
        apart = np.arange(BINS) - place
        over_range = np.sinc(apart) * np.exp(-1j * np.pi * apart)
        item += over_range[:, None] * np.exp(-1j * np.pi * sine * np.arange(4))
    return torch.view_as_real(torch.from_numpy(found).to(torch.complex64)).flatten(4)


def plain(antennas: torch.Tensor) -> torch.Tensor:
    """Pictures by the authors' threshold, with nothing drawn."""
    levels = roughening.levels(roughening.antennas_of(antennas))
    threshold = torch.full((len(levels), 1, 1, 1), 20 * math.log10(polar.THRESHOLD))
    return roughening.picture(levels, threshold)[:, :, None]


def test_plain_pictures_are_those_of_the_samples():
    """What training makes of antennas is what `radarize.signal.polar` makes of samples, to a grey level."""
    adc = samples([(2.5, 0.4, 400), (6.1, -0.8, 150), (8.0, 0.0, 60), (3.0, 1.0, 200)])
    made = PictureMaker(RADAR)(adc)
    antennas = torch.from_numpy(made["antennas"])[:, None, None].float()
    levels = roughening.levels(roughening.antennas_of(antennas))
    threshold = torch.full((len(levels), 1, 1, 1), 20 * math.log10(polar.THRESHOLD))
    found = roughening.picture(levels, threshold)[:, 0].numpy()
    assert ((found > 0) == (made["picture"] > 0)).mean() > 0.999
    assert np.quantile(np.abs(found - made["picture"]), 0.999) <= 2


def test_roughened_pictures_keep_as_much_as_real_ones():
    bins = [20, 60, 100, 200]
    antennas = heard(bins).repeat(16, 1, 1, 1, 1)
    found = roughening.rough(antennas, torch.Generator().manual_seed(1))
    again = roughening.rough(antennas, torch.Generator().manual_seed(1))
    assert torch.equal(found, again) and found.shape == (64, 5, 1, polar.ROWS, polar.COLUMNS)
    share = (found[:, -1, 0] > 0).float().mean(dim=(1, 2)).numpy()
    _, high = roughening.KEPT
    assert share.max() <= high + 0.06 and np.quantile(share, 0.1) < 0.07 and np.quantile(share, 0.9) > 0.1
    assert (found >= 0).all() and (found <= 255).all()
    # The echo stays the strongest row of most.
    best = found[:, -1, 0].sum(dim=2).argmax(dim=1).reshape(16, 4) - torch.tensor(bins)
    assert (best.abs() <= 1).float().mean() > 0.5


def test_added_echoes_are_as_antennas_hear_them():
    """A lone added echo turned to a spectrum: one range, one azimuth."""
    generator = torch.Generator().manual_seed(3)

    def draw(low, high, *shape):
        return low + (high - low) * torch.rand((1, *shape), generator=generator)

    def normal(*shape):
        return torch.zeros((1, *shape))

    count, roughening.ADDED = roughening.ADDED, 1
    try:
        found = max((roughening._added(2, draw, normal) for _ in range(8)), key=lambda each: float(each.abs().max()))
    finally:
        roughening.ADDED = count
    power = found[0, 0].abs().square()
    assert torch.allclose(power, power[:, :1].expand(-1, 4), atol=1e-6)  # one azimuth: antennas differ in phase alone
    assert power[:, 0].max() / power[:, 0].sum() > 0.35  # one range: a sinc
    steps = (found[0, 0, 1:, 0] * found[0, 0, :-1, 0].conj())[power[1:, 0] > 0.01 * power.max()]
    assert len(steps) and found.abs().max() <= 10 ** (roughening.LEVELS[1] / 20)


def test_labels_are_the_lidars():
    picture = np.zeros((1, polar.ROWS, polar.BEAMS), bool)
    picture[0, 7, 40:43] = picture[0, 9, 511] = True
    found = unpacked(torch.from_numpy(np.packbits(picture, axis=2)))
    assert found.shape == (1, polar.ROWS, COLUMNS) and found.sum() == 2 and found[0, 7, 10] == found[0, 9, 127] == 1


def test_worlds_that_are_larger_turned_and_read_too_far():
    """Cell by cell: a row at r of a world 1.1 times as large is at 1.1 r; columns move to the left; the bias adds."""
    picture = torch.zeros((2, 1, polar.ROWS, polar.COLUMNS))
    picture[:, 0, 100, 30] = 1.0
    place = zoomed(picture, torch.tensor([1.1, 0.9])).nonzero()[:, 2].tolist()
    assert set(place) <= {90, 110, 111} and 90 in place
    turned = rolled(picture, torch.tensor([3, -40]), -1.0)
    assert turned[0, 0, 100, 33] == 1 and (turned[0, 0, :, :3] == -1).all() and (turned[0, 0, :, 3:] >= 0).all()
    assert turned[1].max() <= 0 and (turned[1, 0, :, -40:] == -1).all()
    assert biased(picture, torch.tensor([0.21, 0.34])).nonzero()[:, 3].tolist() == [105, 108]


def test_augmented_labels_stay_on_their_echoes():
    """Whatever is drawn: where the label has its point, the picture has its echo, but for the bias."""
    task = find_task("pictures")
    label = torch.zeros((8, polar.ROWS, polar.BEAMS), dtype=torch.bool)
    label[:, 100, 232:280] = True  # 16 columns of pictures about the middle... the echo's own azimuth
    packed = torch.from_numpy(np.packbits(label.numpy(), axis=2))
    pictures, truth = task.augment(
        heard([100.0], items=1).repeat(8, 1, 1, 1, 1), packed, torch.Generator().manual_seed(2)
    )
    for picture, true in zip(pictures[:, -1, 0], truth, strict=True):
        rows, columns = (true == 1).nonzero().T.tolist()
        assert rows
        lit = picture[:, columns[len(columns) // 2] // 2].nonzero()[:, 0]
        off = (lit[:, None] - torch.tensor(sorted(set(rows)))[None]) * polar.RANGES[1]
        assert ((off > BIAS[0] - 0.1) & (off < BIAS[1] + 0.1)).any()


def test_loss_against_loops():
    generator = torch.Generator().manual_seed(0)
    logits = torch.randn((3, 257, COLUMNS), generator=generator).log_softmax(dim=1)
    label = (torch.rand((3, 256, COLUMNS), generator=generator) < 0.004).float()
    label[1, :, 5:9] = UNKNOWN
    loss = entropy(logits, label)
    for item in range(3):
        total, known = 0.0, 0
        for column in range(COLUMNS):
            if label[item, 0, column] == UNKNOWN:
                continue
            rows = label[item, :, column].nonzero()[:, 0]
            total -= logits[item, rows, column].mean() if len(rows) else logits[item, 256, column]
            known += 1
        assert loss[item] == pytest.approx(float(total) / known, rel=1e-5)


def test_points_are_as_dense_as_the_square_of_their_probability():
    """Every cell from `dense` on; of cells of 0.7 of it, half; of 0.25 of it, a sixteenth, spread so evenly that no two
    of them are next to each other; none where there is nothing."""
    probability = torch.zeros((4, 257, COLUMNS))
    for item, share in enumerate((1.0, 0.7, 0.25, 0.0)):
        probability[item, :-1] = 0.03 * share
    found = points(probability, 0.03)
    shares = found.float().mean(dim=(1, 2)).tolist()
    assert shares == pytest.approx([1.0, 0.49, 0.0625, 0.0], abs=1 / 64)
    blocks = found[2, :256].float().unfold(0, 4, 4).unfold(1, 4, 4).sum(dim=(2, 3))
    assert (blocks == 1).all()


def test_first_surfaces_are_within_a_fifth():
    probability = torch.zeros((1, 257, COLUMNS))
    probability[0, 40, :] = 0.15
    probability[0, 90, :64] = 0.5
    probability[0, -1] = 1 - probability[0, :-1].sum(dim=0)
    found = first_surfaces(probability)[0]
    assert np.allclose(found[:64], polar.RANGES[90]) and np.isinf(found[64:]).all()


def test_memory_fades_with_time_whatever_the_batches():
    """Each distribution counts by e^(-age / LASTS), against the sum written out; the first one takes what is left."""
    rng = np.random.default_rng(0)
    stamps = np.cumsum(rng.uniform(0.05, 0.4, 9))
    seen = torch.from_numpy(rng.random((9, 257, 4))).float()
    seen /= seen.sum(dim=1, keepdim=True)
    memory = Memory()
    found = torch.cat([memory.push(seen[:4], stamps[:4]), memory.push(seen[4:], stamps[4:])])
    assert torch.equal(found, Memory().push(seen, stamps))
    left = np.exp(-(stamps[-1] - stamps) / LASTS)
    weights = left - np.concatenate([[0.0], left[:-1]])
    expected = torch.einsum("k,krc->rc", torch.from_numpy(weights).float(), seen)
    assert torch.allclose(found[-1], expected, atol=1e-6)
    assert torch.allclose(found.sum(dim=1), torch.ones(9, 4), atol=1e-5)


def test_a_mirrored_window_has_mirrored_points():
    net = find_task("pictures").network(5, ("picture",), 4).eval()
    maps = torch.randint(0, 255, (2, 5, 1, polar.ROWS, polar.COLUMNS)).float()
    with torch.no_grad():
        found, mirrored = net.estimate(maps), net.estimate(maps.flip(-1))
    assert torch.allclose(found.flip(2), mirrored, atol=1e-6) and not torch.allclose(found, mirrored, atol=1e-5)


def test_it_learns_where_the_wall_is(one_thread):
    """A wall in the picture, and the lidar's point on it."""
    torch.manual_seed(0)
    task = find_task("pictures")
    settings = replace(task.defaults, width=4, rate=1e-2)
    rows = torch.tensor([40, 80, 120, 160])
    pictures = plain(heard(rows.tolist()))
    label = torch.zeros((4, polar.ROWS, COLUMNS))
    label[torch.arange(4), rows] = 1.0
    net = task.net(settings, None).train()
    optimiser = task.optimise(net.parameters(), settings)
    for _ in range(40):
        optimiser.zero_grad()
        task.loss(net, pictures, label).mean().backward()
        optimiser.step()
    with torch.inference_mode():  # as it trains: forty steps are few for running means
        likely = net.estimate(pictures)[:, :-1, 20:108]
        found = (likely == likely.amax(dim=1, keepdim=True)).float()
    row = (found * torch.arange(polar.ROWS)[:, None]).sum(dim=(1, 2)) / found.sum(dim=(1, 2)).clamp_min(1)
    assert (row - rows).abs().max() < 4


def test_recordings_of_the_simulator_are_read(tmp_path):
    """Antenna signals are computed from samples of one loop, labels are packed, and the header names pictures."""
    from radarize.io.recording import RecordingWriter, Stream

    with RecordingWriter(
        tmp_path / "a.h5", RADAR, streams={"truth/lidar": Stream((polar.ROWS, polar.BEAMS // 8), "u1", "", "")}
    ) as writer:
        rows = {"truth/lidar": np.zeros((6, polar.ROWS, polar.BEAMS // 8), np.uint8)}
        writer.append(samples([(3.0, 0.2, 300)], frames=6), 0.05 * np.arange(6), rows=rows)
    task = find_task("pictures")
    table = task.table([tmp_path / "a.h5"])
    assert isinstance(table, FeatureTable) and table.maps["antennas"].shape == (6, BINS, 8)
    header = task.header(task.defaults, table.grid)
    assert header.maps == ("picture",) and (header.grid.rows, header.grid.azimuths) == (polar.ROWS, polar.COLUMNS)
    assert header.grid.frame_period == 0.05
    again = task.table([tmp_path / "a.h5"], grid=header.grid)  # as a training reads that starts from weights
    assert again.grid == table.grid and again.maps["antennas"].equal(table.maps["antennas"])


def test_it_learns_turns(one_thread):
    """A scene that turns by some columns from picture to picture; left is positive."""
    torch.manual_seed(0)
    task = find_task("picture-turns")
    settings = replace(task.defaults, width=4, frames=2, rate=3e-3)
    net, rng = task.net(settings, None).train(), np.random.default_rng(0)
    optimiser = task.optimise(net.parameters(), settings)
    wide = torch.from_numpy(rng.random((16, 64, polar.COLUMNS + 8)) > 0.9).float() * 200

    def batch() -> tuple[torch.Tensor, torch.Tensor]:
        shift, which = rng.integers(-2, 3, 16), rng.permutation(16)
        first = torch.stack([wide[k, :, 4:-4] for k in which])
        second = torch.stack([wide[k, :, 4 + s : 4 + s + polar.COLUMNS] for k, s in zip(which, shift, strict=True)])
        # What lies at a greater azimuth before lies at a lesser one after a turn to the left.
        return torch.stack([first, second], dim=1)[:, :, None], torch.from_numpy(shift * STEP)[:, None].float()

    for _ in range(120):
        optimiser.zero_grad()
        task.loss(net, *batch()).mean().backward()
        optimiser.step()
    with torch.inference_mode():
        pictures, turn = batch()
        found = (net(pictures).mean - net(pictures.flip(4)).mean) / 2
    assert float((found - turn).square().mean().sqrt()) < 0.5 * STEP
