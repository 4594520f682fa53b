"""Training: networks learn the laws of synthetic maps; interrupts, several processes, and bad input."""

import csv
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.learning.features.grid import MapGrid, Resampling
from radarize.learning.features.occupancy import OCCUPANCY
from radarize.learning.features.table import VELOCITY, YAW, FeatureTable
from radarize.learning.nets import losses
from radarize.learning.nets.weights import header_of, load, read
from radarize.learning.task import find_task
from radarize.learning.training.team import Team
from radarize.learning.training.train import TrainOptions, train
from radarize.signal.depthlabel import SURFACE, UNKNOWN
from tests.learning.training.ridges import CONFIG, data_set, write

pytestmark = pytest.mark.usefixtures("one_thread")

ROOT = Path(__file__).parents[3]
TASKS = {kind: find_task(kind) for kind in ("translation", "rotation", "segmentation")}
QUICK = {
    "translation": replace(
        TASKS["translation"].defaults, width=8, frames=1, epochs=10, batch=32, rate=3e-3, schedule="cosine"
    ),
    "rotation": replace(TASKS["rotation"].defaults, width=8, epochs=10, batch=32, rate=3e-3, schedule="cosine"),
    "segmentation": replace(TASKS["segmentation"].defaults, width=4, epochs=3, batch=16, rate=3e-3),
}
TINY = replace(QUICK["translation"], width=2, epochs=4, batch=32)
LAWS = {kind: task.truth[0].name for kind, task in TASKS.items()}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return data_set(tmp_path_factory.mktemp("small"), "velocity", frames=60)


def judged(kind: str, weights: Path, recording: Path) -> dict[str, float]:
    """Metrics of a network on a recording it has not seen."""
    task = TASKS[kind]
    net, header = load(weights, task.network, CONFIG)
    table = task.table([recording])
    assert header.maps == tuple(table.maps)
    starts = table.starts((header.frames - 1) * max(header.spacings) + 1)
    frames = task.frames(starts, torch.full_like(starts, header.spacings[-1]), header.frames)
    with torch.no_grad():
        return task.metrics(task.judge(net, table.window(frames), task.label(table, frames)).double().mean(dim=0))


def hazards(weights: Path, recording: Path) -> tuple[float, float]:
    """Cells that hold the first surface, and how many of them the network expects."""
    net, header = load(weights, TASKS["segmentation"].network, CONFIG)
    table = FeatureTable.read([recording], header.maps, (OCCUPANCY,))
    label = table.truth["occupancy"]
    with torch.no_grad():
        likely = net.estimate(table.window(table.starts(1)[:, None]))
    return float((label == SURFACE).sum()), float(likely[label != UNKNOWN].sum())


@pytest.mark.parametrize("kind", TASKS)
def test_networks_learn(kind, tmp_path):
    data = data_set(tmp_path / "data", LAWS[kind], count=8, frames=60)
    weights = train(kind, data, tmp_path / "net.safetensors", settings=QUICK[kind])
    found = judged(kind, weights, write(tmp_path / "other.h5", LAWS[kind], seed=9))
    if kind == "segmentation":
        assert found["share_found_within_9_cm"] > 0.95
        surface, likely = hazards(weights, tmp_path / "other.h5")
        assert likely == pytest.approx(surface, rel=0.3)  # though surfaces weighed as much as all free cells
    else:
        error, trivial = (value for name, value in found.items() if name.startswith("rm"))
        assert error < 0.3 * trivial
        assert 0.4 < found["normalised_error_squared"] < 3
    with (tmp_path / "net.csv").open() as log:
        rows = list(csv.DictReader(log))
    assert len(rows) == QUICK[kind].epochs
    assert float(rows[-1]["loss"]) < float(rows[0]["loss"])
    assert sorted(path.name for path in tmp_path.glob("net.*")) == ["net.csv", "net.safetensors"]


def test_uncertainty_follows_what_is_seen(tmp_path):
    """For maps with noise only, the network estimates the covariance of the labels."""
    for k in range(4):  # mostly blank: one factor calibrates all covariances
        write(tmp_path / "data" / f"{k}.h5", "velocity", 100, k, blank=0.6)
    settings = replace(QUICK["translation"], epochs=12)
    weights = train("translation", tmp_path / "data", tmp_path / "net.safetensors", settings=settings)
    net, header = load(weights, TASKS["translation"].network)
    deviations = []
    for blank in (0, 1):
        path = write(tmp_path / f"{blank}.h5", "velocity", 100, 9, blank)
        table = FeatureTable.read([path], header.maps, (VELOCITY,))
        with torch.no_grad():
            covariance = net.estimate(table.window(table.starts(1)[:, None]))[1]
        deviations.append(covariance.diagonal(dim1=1, dim2=2).median(dim=0).values.sqrt().numpy())
    assert (deviations[1] > 1.3 * deviations[0]).all()
    assert deviations[1] == pytest.approx([1.2 / 3**0.5, 0.8 / 3**0.5], rel=0.4)  # of uniform distributions


def same(a: Path, b: Path) -> bool:
    """Whether two files hold the same weights, bit for bit."""
    (x, _), (y, _) = read(a), read(b)
    return x.keys() == y.keys() and all(torch.equal(x[name], y[name]) for name in x)


def test_resumed_is_uninterrupted(small, tmp_path):
    """Killed during the third epoch, then restarted with --resume."""
    whole = train("translation", small, tmp_path / "whole.safetensors", settings=TINY)
    code = f"""
import os, torch
torch.set_num_threads(1)
from radarize.learning.training.train import train
from radarize.learning.task import Settings
def stop(stage, done, total):
    if stage == "training" and done >= 0.6 * total:
        os.kill(os.getpid(), 9)
train("translation", {str(small)!r}, {str(tmp_path / "part.safetensors")!r}, settings={TINY!r}, progress=stop)
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == -9, done.stderr
    assert sorted(path.name for path in tmp_path.glob("part.*")) == ["part.checkpoint", "part.csv"]
    with pytest.raises(InputError, match="part.checkpoint: belongs to an interrupted training; .* --resume"):
        train("translation", small, tmp_path / "part.safetensors", settings=TINY)
    with pytest.raises(InputError, match="is of a training with seed 0, expected 1"):
        train(
            "translation",
            small,
            tmp_path / "part.safetensors",
            settings=replace(TINY, seed=1),
            options=TrainOptions(resume=True),
        )
    lines = []
    resumed = train(
        "translation",
        small,
        tmp_path / "part.safetensors",
        settings=TINY,
        options=TrainOptions(resume=True),
        log=lines.append,
    )
    assert lines[0] == "resuming after epoch 2"
    assert same(whole, resumed)
    assert header_of(whole).metrics == header_of(resumed).metrics
    assert not same(whole, train("translation", small, tmp_path / "c.safetensors", settings=replace(TINY, seed=1)))


def test_two_processes(small, tmp_path):
    """Two processes of torch's launcher end with the same weights, and the loss falls."""
    code = f"""
import hashlib, os
from dataclasses import replace
from radarize.learning.training import train as module
class Watched(module.Trainer):
    def train_epoch(self, *arguments):
        found = super().train_epoch(*arguments)
        digest = hashlib.sha256()
        for values in self.net.state_dict().values():
            digest.update(values.numpy().tobytes())
        with open({str(tmp_path)!r} + "/rank" + os.environ["RANK"], "a") as file:
            print(digest.hexdigest(), found["loss"], found["training_loss"], file=file)
        return found
module.Trainer = Watched
from radarize.learning.task import Settings
options = module.TrainOptions(device="cpu")
module.train("translation", {str(small)!r}, {str(tmp_path / "net.safetensors")!r}, settings={TINY!r}, options=options)
"""
    (tmp_path / "both.py").write_text(code)
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run([*command, tmp_path / "both.py"], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    first, second = ((tmp_path / f"rank{k}").read_text() for k in range(2))
    assert first == second and len(first.splitlines()) == TINY.epochs
    losses = [float(line.split()[2]) for line in first.splitlines()]
    assert losses[-1] < losses[0]
    load(tmp_path / "net.safetensors", TASKS["translation"].network, CONFIG)


def test_it_ends_when_it_gets_no_better(small, tmp_path, monkeypatch):
    monkeypatch.setattr(type(TASKS["translation"]), "metrics", lambda self, means: {"loss": 1.0})
    settings = replace(TINY, epochs=50, patience=2)
    weights = train("translation", small, tmp_path / "net.safetensors", settings=settings)
    assert header_of(weights).epochs == 3


def test_a_loss_that_is_not_finite_is_an_error(small, tmp_path, monkeypatch):
    finite = losses.likelihood
    monkeypatch.setattr(losses, "likelihood", lambda found, truth: finite(found, truth) * float("nan"))
    with pytest.raises(InputError, match="the loss is nan in epoch 1, step 1: it diverged, expected a smaller --rate"):
        train("translation", small, tmp_path / "net.safetensors", settings=TINY)


def test_workers_read_the_same(small):
    paths = sorted(small.glob("*.h5"))
    alone, together = (
        FeatureTable.read(paths, ("doppler_azimuth",), (VELOCITY, YAW), workers=workers) for workers in (1, 2)
    )
    assert alone.lengths == together.lengths == [60, 60, 60]
    assert torch.equal(alone.maps["doppler_azimuth"], together.maps["doppler_azimuth"])
    assert all(torch.equal(alone.truth[name], together.truth[name]) for name in ("velocity", "yaw"))
    with Recording(paths[1]) as recording:
        assert np.array_equal(alone.maps["doppler_azimuth"][60:120], recording.rows("maps/doppler_azimuth", 0, 60))
    assert alone.starts(59).tolist() == [0, 1, 60, 61, 120, 121]  # no window reaches into the next recording
    assert Team(0, 1, torch.device("cpu")).share(torch.nn.Identity()) is not None


def test_maps_lie_where_the_network_is_and_truth_here(small):
    table = FeatureTable.read(sorted(small.glob("*.h5")), ("doppler_azimuth",), (VELOCITY, YAW))
    there = table.on(torch.device("meta"))
    frames = torch.tensor([[0, 1], [3, 4]])
    assert there.window(frames).device.type == "meta"
    assert there.window(frames).shape == table.window(frames).shape
    assert there.truth is table.truth and there.starts(2).equal(table.starts(2))


def test_the_command(tmp_path):
    data = data_set(tmp_path / "data", "velocity", frames=60)
    (data / "dataset.json").write_text('{"splits": {"random-0": {"train": ["0"], "validation": ["2"], "test": ["1"]}}}')
    arguments = ["train", "translation", "--data", str(data), "-o", str(tmp_path / "net.safetensors")]
    arguments += ["--split", "random-0"]
    tiny = ["--width", "2", "--frames", "1", "--epochs", "1", "--batch", "32", "--seed", "1", "--device", "cpu"]
    done = CliRunner().invoke(app, [*arguments, *tiny])
    assert done.exit_code == 0 and done.stdout.strip() == str(tmp_path / "net.safetensors")
    assert "rmse_m_s" in done.stderr
    header = load(tmp_path / "net.safetensors", TASKS["translation"].network, CONFIG)[1]
    assert (header.width, header.epochs, header.seed, header.data, header.split) == (2, 1, 1, "data", "random-0")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"kind": "flight"}, "task is 'flight', expected one of milliego, picture-turns, pictures"),
        ({"settings": replace(TINY, batch=0)}, "batch is 0, expected a positive number"),
        ({"settings": replace(TINY, frames=70)}, "training has 0 windows of 70 frames"),
        ({"kind": "rotation", "settings": replace(TINY, frames=1)}, "frames is 1, expected at least 2"),
        ({"kind": "published-rotation", "settings": replace(TINY, frames=1)}, "frames is 1, expected at least 2"),
        ({"kind": "picture-turns", "settings": replace(TINY, frames=1)}, "frames is 1, expected at least 2"),
        ({"options": TrainOptions(device="abacus")}, "device is 'abacus', expected cpu or cuda"),
        ({"output": Path("net.pt")}, "output is net.pt, expected a file NAME.safetensors"),
        ({"options": TrainOptions("random-0")}, "dataset.json: no such file, expected a data set"),
        ({"data": Path("nowhere")}, "nowhere: holds no recordings"),
    ],
)
def test_what_cannot_be_used_is_named(small, tmp_path, change, expected):
    arguments = {
        "kind": "translation",
        "data": small,
        "output": tmp_path / "net.safetensors",
        "settings": TINY,
    } | change
    with pytest.raises(InputError, match=expected):
        train(**arguments)


def test_recordings_of_two_radars_or_broken_truth_are_refused(tmp_path):
    good = write(tmp_path / "a.h5", "velocity", 5)
    from tests.learning.training.walks import walk

    with pytest.raises(InputError, match="b.h5: has maps of rows 8 instead of 16 as in a.h5, expected one radar's"):
        FeatureTable.read([good, walk(tmp_path / "b.h5")], ("doppler_azimuth",), (VELOCITY,))
    import h5py

    with h5py.File(good, "r+") as file:
        file["truth/velocity"][:] = np.nan
    with pytest.raises(InputError, match="a.h5: /truth/velocity lacks values or has no numbers"):
        FeatureTable.read([good], ("doppler_azimuth",), (VELOCITY,))


def test_windows_with_unknown_truth_or_readings_are_left_out(tmp_path):
    """As when a tracking camera loses tracking, or an IMU stalls."""
    import h5py

    paths = [write(tmp_path / name, "velocity", 8) for name in ("a.h5", "b.h5")]
    with h5py.File(paths[0], "r+") as file:
        file["truth/velocity"][3, 1] = np.nan
        file["truth/pose"][7] = np.nan
    table = FeatureTable.read(paths, ("doppler_azimuth",), (VELOCITY, YAW))
    assert table.starts(1).tolist() == [0, 1, 2, 4, 5, 6, *range(8, 16)]
    assert table.starts(3).tolist() == [0, 4, *range(8, 14)]
    table = replace(table, sensed={"imu": torch.zeros(16, 15, 6)})
    table.sensed["imu"][9, 3, 0] = torch.nan
    assert table.starts(1).tolist() == [0, 1, 2, 4, 5, 6, 8, *range(10, 16)]
    walk_with_gap = data_set(tmp_path / "data", "velocity", frames=60)
    for path in sorted(walk_with_gap.glob("*.h5")):
        with h5py.File(path, "r+") as file:
            file["truth/velocity"][20:25] = np.nan
    train("translation", walk_with_gap, tmp_path / "net.safetensors", settings=TINY)


#: Bins of 2/3 the size over Doppler, and of half the size over range.
OTHER = CONFIG.model_copy(update={"loops": 24, "samples": 32})


def test_maps_of_any_radar_are_brought_to_a_grid(tmp_path):
    """Maps are resampled as in operation; those of a radar with the network's grid are unchanged."""
    paths = [write(tmp_path / "a.h5", "velocity", 5), write(tmp_path / "b.h5", "velocity", 6, config=OTHER)]
    grid = MapGrid.of(CONFIG, "doppler_azimuth")
    table = FeatureTable.read(paths, ("doppler_azimuth",), (VELOCITY,), grid=grid)
    assert table.grid == grid and list(table.lengths) == [5, 6]
    with Recording(paths[0]) as own, Recording(paths[1]) as other:
        assert np.array_equal(table.maps["doppler_azimuth"][:5], own.read("maps/doppler_azimuth"))
        made = torch.from_numpy(other.read("maps/doppler_azimuth")).float()[:, None]
        shown = Resampling(grid, MapGrid.of(OTHER, "doppler_azimuth"), centred=True)(made)[:, 0]
        assert torch.allclose(table.maps["doppler_azimuth"][5:].float(), shown, atol=0.02)


def test_a_training_begins_with_weights_and_sees_any_radar(small, tmp_path):
    """A training continues from the weights of another: without further steps it is equally good."""
    settings = replace(QUICK["translation"], epochs=20)  # after 10 some processors have an error near that of guessing
    first = train("translation", small, tmp_path / "first.safetensors", settings)
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for k, config in enumerate((CONFIG, OTHER, OTHER)):
        write(mixed / f"{k}.h5", "velocity", 60, seed=20 + k, config=config)
    short = replace(QUICK["translation"], width=3, frames=5, epochs=1, rate=1e-6)
    again = train("translation", mixed, tmp_path / "again.safetensors", short, TrainOptions(start=first))
    before, header = header_of(first), header_of(again)
    assert (header.width, header.frames, header.grid) == (before.width, before.frames, before.grid)
    assert header.data == "small0, then mixed" and header.epochs == before.epochs + 1
    # Two recordings of 60 frames each time, for of three one validates.
    assert before.hours == pytest.approx(120 * CONFIG.frame_period / 3600, abs=1e-4)
    assert header.hours == pytest.approx(2 * before.hours, abs=1e-4)
    held = write(tmp_path / "held.h5", "velocity", 60, seed=30)
    errors = [judged("translation", path, held)["rmse_m_s"] for path in (first, again)]
    assert errors[0] < 0.3 and abs(errors[1] - errors[0]) < 0.05  # of 0.8 m/s RMS
    with pytest.raises(InputError, match="is a network for 'translation' .*expected one for 'rotation'"):
        train("rotation", mixed, tmp_path / "turns.safetensors", options=TrainOptions(start=first))


@pytest.mark.parametrize("there", [False, True])
def test_a_processor_without_bfloat16_is_reported(small, tmp_path, monkeypatch, there):
    """Emulated, it takes several times as long as float32."""
    monkeypatch.setattr("torch.cpu.get_capabilities", lambda: {"avx2": True, "avx512_bf16": there})
    lines: list[str] = []
    settings = replace(TINY, epochs=1, precision="bfloat16")
    train("translation", small, tmp_path / "a.safetensors", settings, TrainOptions(device="cpu"), log=lines.append)
    assert any("bfloat16" in line for line in lines) is not there
