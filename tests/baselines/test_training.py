"""The baselines' trainings: that networks learn known laws, their labels and losses, and that files come back."""

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest
import torch
from scipy.spatial.transform import Rotation

from radarize.baselines.radarhd.network import DRAWN, columns
from radarize.baselines.radarhd.training import bins, drawn, pictured
from radarize.baselines.rnin.network import RninNet
from radarize.baselines.rnin.training import displaced, rotation
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets.export import export_onnx
from radarize.learning.nets.weights import Header, build, example, load, save
from radarize.learning.task import find_task
from radarize.learning.training.team import Team
from radarize.learning.training.train import train
from radarize.learning.training.trainer import Trainer
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import AZIMUTHS
from tests.baselines.walks_known import CONFIG, walk

pytestmark = pytest.mark.usefixtures("one_thread")

ROWS, PERIOD = 16, 1 / 15
GRID = MapGrid(rows=ROWS, step=0.2, azimuths=80, field=float(AZIMUTHS[-1] - AZIMUTHS[0]), frame_period=PERIOD)
TASKS = {kind: find_task(kind) for kind in ("radarhd", "milliego", "rnin")}
QUICK = {
    "radarhd": replace(TASKS["radarhd"].defaults, width=4, frames=3, epochs=6, batch=8, rate=5e-3),
    "milliego": replace(TASKS["milliego"].defaults, width=4, frames=3, epochs=6, batch=8, rate=5e-4),
    "rnin": replace(TASKS["rnin"].defaults, width=4, frames=3, epochs=10, batch=8, rate=3e-3),
}
ALONE = Team(0, 1, torch.device("cpu"))


def table(kind: str, seed: int, frames: int) -> FeatureTable:
    """Frames by a law that the kind's network can learn in seconds."""
    rng = np.random.default_rng(seed)
    tensor = torch.from_numpy
    if kind == "radarhd":  # one wall for a while, then another
        walls = frames // 20
        depth, slope = (
            np.repeat(rng.uniform(8, 12, (walls, 1)), 20, axis=0),
            rng.uniform(-2, 2, (walls, 1)).repeat(20, 0),
        )
        middle = (depth + slope * AZIMUTHS)[:, None]
        maps = 25 * np.exp(-0.5 * ((np.arange(ROWS)[:, None] - middle) / 0.7) ** 2) + rng.normal(0, 1, (1, ROWS, 80))
        scan = (depth + slope * BEARINGS).astype(np.float32)
        return FeatureTable({"range_azimuth": tensor(maps).half()}, {"scan": tensor(scan)}, [20] * walls, GRID, PERIOD)
    if kind == "rnin":  # who feels a push moves by it
        push = rng.normal(0, 1, (frames, 1, 3))
        sensed = np.concatenate([push + rng.normal(0, 0.1, (frames, 100, 3)), rng.normal(0, 0.1, (frames, 100, 3))], 2)
        truth = {"displacement": tensor(push[:, 0].astype(np.float32))}
        return FeatureTable({}, truth, [frames], None, PERIOD, {"levelled": tensor(sensed).half()})
    # Level motion in the xy plane: a step since three frames ago by the force, a turn by the angular velocity.
    force, turn = rng.normal(0, 2, (frames, 2)), rng.normal(0, 1, frames)
    poses, start = np.zeros((frames, 7)), np.zeros((3, 3))
    for k in range(frames):
        before = poses[k - 3] if k >= 3 else np.array([0, 0, 0, 0, 0, 0, 1.0])
        back = Rotation.from_quat(before[3:])
        poses[k, :3] = before[:3] + back.apply([*(0.1 * force[k]), 0])
        poses[k, 3:] = (back * Rotation.from_euler("z", 0.2 * turn[k])).as_quat()
    sensed = np.zeros((frames, 20, 6))
    sensed[..., :2], sensed[..., 2], sensed[..., 5] = force[:, None], 9.8, turn[:, None]
    panorama = (rng.random((frames, 64, 256)) < 0.001).astype(np.float16)
    assert not start.any()
    return FeatureTable({}, {"pose": tensor(poses)}, [frames], None, PERIOD,
                 {"panorama": tensor(panorama), "imu": tensor(sensed).half()})  # fmt: skip


@pytest.mark.parametrize("kind", TASKS)
def test_networks_learn(kind, monkeypatch):
    torch.manual_seed(0)  # of dropout
    task = TASKS[kind]
    monkeypatch.setattr(type(task), "spacings", lambda self, period: (3,) if kind == "milliego" else (1,))
    monkeypatch.setattr(type(task), "share", 1.0)
    trainer = Trainer(task, QUICK[kind], table(kind, 0, 400 if kind == "milliego" else 240), table(kind, 1, 120), ALONE)
    while not trainer.finished:
        trainer.train_epoch()
    found = trainer.finish()
    if kind == "radarhd":
        assert found["share_found_within_9_cm"] > 0.9 and found["share_right_of_returned"] > 0.9
    elif kind == "rnin":
        assert found["rmse_m"] < 0.8 * found["rms_displacement_m"]
        assert found["normalised_error_squared"] == pytest.approx(1, abs=0.1)
    else:
        assert found["rmse_m"] < 0.85 * found["rms_step_m"] and found["rmse_rad"] < 0.6 * found["rms_turn_rad"]


def test_labels_of_milliego_are_motions_seen_from_the_older_frame():
    task, rng = TASKS["milliego"], np.random.default_rng(0)
    place, turned = rng.normal(0, 1, (5, 3)), Rotation.random(5, random_state=0)
    poses = np.column_stack([place, turned.as_quat()])
    some = FeatureTable({}, {"pose": torch.from_numpy(poses)}, [5], None, PERIOD)
    label = task.label(some, torch.tensor([[0, 2, 4], [1, 2, 3]])).numpy()
    for item, pair, a, b in ((0, 0, 0, 2), (0, 1, 2, 4), (1, 0, 1, 2)):
        assert label[item, pair, :3] == pytest.approx(turned[a].inv().apply(place[b] - place[a]), abs=1e-5)
        euler = Rotation.from_euler("xyz", label[item, pair, 3:], degrees=True)
        assert (turned[a] * euler * turned[b].inv()).magnitude() == pytest.approx(0, abs=1e-5)


def test_augmentation_transforms_inputs_and_labels_equally():
    """The specific force is set to the label; after augmentation both are still equal, except bias and tilt."""
    generator = torch.Generator().manual_seed(0)
    label = torch.randn(64, 3, 3, generator=generator)
    windows = torch.cat([label, torch.zeros_like(label)], dim=2)[:, :, None].expand(-1, -1, 100, -1)
    found, rotated = TASKS["rnin"].augment(windows, label, generator)
    off = (found[..., :3] - rotated[:, :, None]).norm(dim=3)
    assert off.max() < 0.18 + 2 * np.sin(np.radians(5)) * (9.81 + 5)  # bias, and gravity on tilted axes
    assert rotated.norm(dim=2) == pytest.approx(label.norm(dim=2), abs=1e-4)
    assert rotated[..., 2] == pytest.approx(label[..., 2], abs=1e-5) and (rotated - label).abs().max() > 1
    vectors = torch.randn(5, 3, generator=generator)
    assert rotation(vectors).numpy() == pytest.approx(Rotation.from_rotvec(vectors.numpy()).as_matrix(), abs=1e-5)


def test_losses_by_hand():
    error = torch.tensor([[[1.0, 0, 0], [1.0, 0, 0], [-2.0, 0, 0]]])
    expected = (1 + 1 + 4 + 8 * (1 + 4 + 0)) / 3
    assert displaced(error, torch.zeros_like(error)).item() == pytest.approx(expected)
    label = torch.full((1, 88), 5.0)
    picture = drawn(label, ROWS)
    good, bad = pictured(20 * picture - 10, label), pictured(10 - 20 * picture, label)
    assert good.item() < 1e-3 and bad.item() == pytest.approx(0.9 * 10 + 0.1, abs=0.05)


def test_pictures_of_scans():
    """A sloping wall without gaps, a jump as a jump, and nothing where nothing is."""
    label = torch.full((1, 88), -1.0)
    label[0, :40] = torch.linspace(3, 10, 40)
    label[0, 40:60] = 14.0
    picture = drawn(label, ROWS)[0]
    direction = np.degrees(columns(DRAWN))
    seen = direction < np.degrees(BEARINGS[59]) + 0.4
    assert picture.sum(dim=0).numpy() == pytest.approx(seen.astype(float))
    rows = picture.argmax(dim=0).numpy()
    slope = direction < np.degrees(BEARINGS[39]) - 0.1
    expected = 3 + 7 * (direction + 44) / 39
    assert rows[slope] == pytest.approx(np.clip(expected[slope], 3, None), abs=0.51)
    assert set(rows[seen & (direction > np.degrees(BEARINGS[40]) + 0.1)]) == {14}


def test_bins_of_a_recording(tmp_path):
    biased = CONFIG.model_copy(update={"range_bias": 0.1})
    scan = np.array([[1.0, np.inf]])
    with RecordingWriter(tmp_path / "a.h5", biased, streams={"truth/scan": Stream((2,), "f4", "m", "")}) as writer:
        writer.append(np.zeros((1, *biased.frame_shape), np.int16), np.zeros(1), rows={"truth/scan": scan})
    with Recording(tmp_path / "a.h5") as recording:
        assert bins(recording, slice(None))[0] == pytest.approx([1.1 / biased.range_resolution, -1])


def test_ranges_of_another_radar_are_bins_of_the_networks_grid(tmp_path):
    """What is in a bin of its picture is as far off as the map's row there, whatever the radar's own bins are."""
    task, step, scan = TASKS["radarhd"], 1.7 * CONFIG.range_resolution, np.array([[0.5, 1.5, 2.9, np.inf]])
    with RecordingWriter(tmp_path / "a.h5", CONFIG, streams={"truth/scan": Stream((4,), "f4", "m", "")}) as writer:
        samples = np.random.default_rng(0).normal(0, 100, (1, *CONFIG.frame_shape)).astype(np.int16)
        writer.append(samples, np.zeros(1), rows={"truth/scan": scan})
    grid = MapGrid.of(CONFIG, "range_azimuth").model_copy(update={"step": step, "rows": int(2.5 / step)})
    table = FeatureTable.read([tmp_path / "a.h5"], ["range_azimuth"], task.truth, grid=grid)
    assert table.maps["range_azimuth"].shape[1] == grid.rows
    assert table.truth["scan"].numpy() == pytest.approx(np.array([[0.5 / step, 1.5 / step, -1, -1]]))


@pytest.mark.parametrize("kind", TASKS)
def test_files_come_back_and_onnx_says_the_same(kind, tmp_path):
    task = TASKS[kind]
    grid = GRID if task.maps else None
    header = Header(kind=kind, frames=3, maps=task.reads, width=4, grid=grid)
    torch.manual_seed(0)
    net = build(task.network, header).eval()
    again, read = load(save(net, header, tmp_path / "net.safetensors"), task.network)
    inputs = example(again, header)
    expected = again.estimate(*inputs)
    expected = expected if isinstance(expected, tuple) else (expected,)
    assert read == header
    pytest.importorskip("onnxscript", reason="the extra onnx is not installed")
    session = onnxruntime.InferenceSession(export_onnx(again, header, tmp_path / "net.onnx"))
    names = [each.name for each in session.get_inputs()]
    for found, values in zip(session.run(None, dict(zip(names, map(np.asarray, inputs), strict=True))), expected,
                             strict=True):  # fmt: skip
        assert found == pytest.approx(values.detach().numpy(), abs=1e-4)


def test_trained_from_recordings_and_resumed(tmp_path):
    """Of an IMU alone, whatever the radar; a recording without one is named."""
    for k in range(3):
        walk(tmp_path / "data" / f"{k}.h5", frames=150)
    settings = replace(QUICK["rnin"], frames=2, epochs=2, batch=8)
    whole = train("rnin", tmp_path / "data", tmp_path / "net.safetensors", settings=settings)
    net, header = load(whole, RninNet, CONFIG)
    assert header.grid is None and header.maps == ("levelled",) and header.spacings == (30,)
    assert torch.isfinite(net.estimate(torch.zeros(1, 2, 100, 6))[0]).all()
    walk(tmp_path / "data" / "3.h5", frames=150, with_imu=False)
    with pytest.raises(InputError, match="3.h5: has no /imu/time"):
        train("rnin", tmp_path / "data", tmp_path / "other.safetensors", settings=settings)
