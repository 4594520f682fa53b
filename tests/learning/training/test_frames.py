"""Recordings as a torch data set: windows, truth, splits, worker processes, and the how-to's example."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.learning.features.keeping import keep_maps
from radarize.learning.training.dataset import DEFAULT, FrameDataset
from radarize.signal.maps import MAPS, STEP
from tests.learning.training.walks import CONFIG, TURN, VELOCITY, walk

HOW_TO = Path(__file__).parents[3] / "docs" / "howto" / "train.md"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three recordings of samples, with a split."""
    folder = tmp_path_factory.mktemp("data")
    for k, name in enumerate("abc"):
        walk(folder / f"{name}.h5", seed=k)
    splits = {"random-0": {"train": ["a", "b"], "validation": [], "test": ["c"]}}
    (folder / "dataset.json").write_text(json.dumps({"splits": splits}))
    return folder


@pytest.fixture(scope="module")
def maps_folder(folder, tmp_path_factory):
    """The same recordings as heat maps."""
    kept = tmp_path_factory.mktemp("maps")
    for path in folder.glob("*.h5"):
        keep_maps(path, kept / path.name)
    return kept


def test_windows(folder):
    whole = FrameDataset(folder, window=3, spacing=2, stride=4)  # first frames 0, 4 of 12: the window reaches over 5
    assert len(whole) == 3 * 2
    item = whole[3]  # the second window of b
    assert list(item) == list(DEFAULT)
    with Recording(folder / "b.h5") as recording:
        times = recording.times
    assert np.allclose(
        FrameDataset(folder, fields=("time",), window=3, spacing=2, stride=4)[3]["time"], times[[4, 6, 8]]
    )
    assert item["range_azimuth"].shape == (3, 96, 80) and item["doppler_azimuth"].shape == (3, CONFIG.loops, 80)
    assert all(item[name].dtype == torch.float32 for name in DEFAULT)
    assert torch.allclose(item["velocity"], torch.tensor(VELOCITY).expand(3, 3))
    assert torch.allclose(item["turn"], torch.full((2,), 2 * TURN), atol=1e-5)  # also where yaw passes pi
    assert item["scan"].shape == (3, 88)
    assert len(FrameDataset(folder, window=12)) == 3
    with pytest.raises(InputError, match="no recording has 13 frames"):
        FrameDataset(folder, window=13)
    with pytest.raises(IndexError):
        whole[6]


def test_samples(folder):
    item = FrameDataset(folder, fields=("adc",), window=2, spacing=3)[9]  # the first window of b
    with Recording(folder / "b.h5") as recording:
        assert np.array_equal(item["adc"].numpy(), recording.adc(0, 4)[::3])


def test_samples_and_stored_maps_read_the_same(folder, maps_folder):
    fresh, stored = FrameDataset(folder), FrameDataset(maps_folder)
    assert len(fresh) == len(stored)
    for index in (0, 17, len(fresh) - 1):
        for name, values in fresh[index].items():
            assert (values - stored[index][name]).abs().max() <= (STEP if name in MAPS else 0)


def test_recordings_by_name(folder):
    one, two = FrameDataset(folder / "b.h5"), FrameDataset([folder / "b.h5", folder / "c.h5"])
    assert [path.stem for path in one.paths] == ["b"] and len(two) == 2 * len(one)
    assert torch.equal(one[3]["velocity"], FrameDataset(folder)[len(one) + 3]["velocity"])
    with pytest.raises(InputError, match="split is 'random-0', but single recordings are named"):
        FrameDataset(folder / "b.h5", "random-0")


def test_time_is_exact(tmp_path):
    """float32 has steps of two minutes for stamps since 1970."""
    path = walk(tmp_path / "a.h5", start=1.7e9)
    item = FrameDataset(path, fields=("time", "velocity"), window=4)[2]
    with Recording(path) as recording:
        assert item["time"].dtype == torch.float64 and item["velocity"].dtype == torch.float32
        assert np.array_equal(item["time"].numpy(), recording.times[2:6])


def test_cached_maps_are_made_once_and_the_same(folder, monkeypatch):
    from radarize.learning.training import dataset

    cached, fresh = (FrameDataset(folder, window=3, spacing=2, cache=kept) for kept in (True, False))
    made, maps_of = [], dataset.maps_of
    monkeypatch.setattr(dataset, "maps_of", lambda *arguments: made.append(arguments[1]) or maps_of(*arguments))
    found = [cached[index] for index in (0, 2, 0)]
    assert made == [0, 2, 4, 6]  # the windows 0, 2, 4 and 2, 4, 6
    for item, index in zip(found, (0, 2, 0), strict=True):
        assert all(torch.equal(values, fresh[index][name]) for name, values in item.items())


def test_one_definition_of_a_map(folder):
    """The Doppler-azimuth map of the data set, of networks and of `rz.doppler_azimuth` is the same, axes included."""
    import radarize as rz
    from radarize.signal.maps import AZIMUTHS, FLOOR

    frames = rz.torch_dataset(folder / "a.h5", features=["doppler_azimuth", "range_azimuth"])
    source = rz.load(folder / "a.h5")
    doppler = rz.doppler_azimuth(source[4], method="capon", azimuths=AZIMUTHS, limited=True)
    ranges = rz.range_azimuth(source[4], method="capon", azimuths=AZIMUTHS)
    for name, power in (("doppler_azimuth", doppler), ("range_azimuth", ranges)):
        decibels = 10 * np.log10(np.maximum(power.values, 10 ** (FLOOR / 10)))
        assert np.abs(frames[4][name][0].numpy() - decibels).max() <= STEP / 2 + 1e-3
        axes = frames.axes[name]
        rows = axes.step * (np.arange(axes.rows) - (axes.rows // 2 if axes.centred else 0))
        offset = CONFIG.range_bias if name == "range_azimuth" else 0
        assert power[power.dims[0]].values == pytest.approx(rows - offset)
        assert power.azimuth.values == pytest.approx(axes.azimuths)


def test_splits(folder):
    assert [path.stem for path in FrameDataset(folder, "random-0").paths] == ["a", "b"]
    assert [path.stem for path in FrameDataset(folder, "random-0", "test").paths] == ["c"]


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_worker_processes(maps_folder, method):
    """Works after the parent has read too: children do not use its open files."""
    frames = FrameDataset(maps_folder, fields=("range_azimuth", "turn"), stride=2)
    alone = [frames[k] for k in range(len(frames))]
    loader = DataLoader(frames, batch_size=4, num_workers=2, multiprocessing_context=method)
    batches = list(loader)
    for name in ("range_azimuth", "turn"):
        together = torch.cat([batch[name] for batch in batches])
        assert torch.equal(together, torch.stack([item[name] for item in alone]))


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"fields": ("speed",)}, "fields names 'speed', expected some of: range_azimuth"),
        ({"fields": ("occupancy",)}, r"a.h5: has no /truth/occupancy; there are .*truth/scan"),
        ({"window": 0}, "window, spacing and stride are 0, 1, 1"),
        ({"split": "random-7"}, "has no split 'random-7', expected one of: random-0"),
        ({"split": "random-0", "part": "all"}, "part is 'all', expected one of: train, validation, test"),
        ({"split": "random-0", "part": "validation"}, "random-0/validation is empty"),
    ],
)
def test_what_is_missing_is_named(folder, arguments, expected):
    with pytest.raises(InputError, match=expected):
        FrameDataset(folder, **arguments)


def test_folders_that_are_no_data_set(folder, maps_folder, tmp_path):
    with pytest.raises(InputError, match="holds no recordings"):
        FrameDataset(tmp_path)
    walk(tmp_path / "real.h5", truth=False)
    with pytest.raises(InputError, match="real.h5: has no /truth/velocity"):
        FrameDataset(tmp_path)
    assert FrameDataset(tmp_path, fields=("range_azimuth",))[0]["range_azimuth"].shape == (2, 96, 80)
    with pytest.raises(InputError, match="dataset.json: no such file, expected a data set with splits"):
        FrameDataset(tmp_path, "random-0")
    splits = {"random-0": {"train": ["real", "x", "y"]}}
    (tmp_path / "dataset.json").write_text(json.dumps({"splits": splits}))
    with pytest.raises(InputError, match="lacks x.h5 and 1 more of random-0/train"):
        FrameDataset(tmp_path, "random-0")
    with pytest.raises(InputError, match="has no /radar/adc"):
        FrameDataset(maps_folder, fields=("adc",))


def test_the_example_of_the_readme_trains(folder, monkeypatch, capsys):
    """The example as printed runs on these recordings, and the loss falls."""
    code = next(c for c in re.findall(r"```python\n(.*?)```", HOW_TO.read_text(), re.S) if "torch_dataset(" in c)
    assert len([line for line in code.splitlines() if line.strip()]) <= 12
    torch.manual_seed(0)
    exec(compile(code.replace('"small"', repr(str(folder))), HOW_TO.name, "exec"), {})
    losses = [float(line.split()[-1]) for line in capsys.readouterr().out.splitlines()]
    assert losses[-1] < 0.5 * losses[0]
