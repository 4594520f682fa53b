"""The artefact's labels, losses, networks and odometry against independent sums, and the way from data to a run."""

import json

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner

from radarize.baselines.published import labels
from radarize.baselines.published.maps import PublishedMaps, PublishedStream
from radarize.baselines.published.odometry import PublishedOdometry
from radarize.baselines.published.scans import PublishedScans, first_occupied
from radarize.baselines.published.training import pooled_dice
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.recording import Product, Recording, RecordingWriter, Stream
from radarize.io.tum import read_tum
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets.weights import Header, build, example, header_of, load, save
from radarize.learning.task import find_task
from radarize.pipeline.method import Inputs, Weights
from radarize.pipeline.methods import make_odometry, make_pipeline
from radarize.pipeline.pipeline import Pipeline
from radarize.pipeline.run import run
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor, Signal
from radarize.signal.bearings import BEARINGS
from tests.batches import stream

pytestmark = pytest.mark.usefixtures("one_thread")

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 8})
TASKS = {kind: find_task(f"published-{kind}") for kind in ("translation", "rotation", "segmentation")}
PINHOLE = (30.0, 30.0, 29.5, 9.5)
TURN = 0.02


def pictures(frames):
    """Depth of a wall ahead that is k cm further in picture k, mm."""
    return np.broadcast_to((1500 + 10 * np.arange(frames))[:, None, None], (frames, 20, 60)).astype(np.uint16)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Three recordings of a sensor that walks a circle, with depth pictures."""
    folder = tmp_path_factory.mktemp("data")
    for k in range(3):
        rng, frames = np.random.default_rng(k), 24
        yaw, zero = TURN * np.arange(frames) + 3.0, np.zeros(frames)
        rows = {
            "truth/time": np.arange(frames) * CONFIG.frame_period + CONFIG.burst_center,
            "truth/pose": np.column_stack(
                [np.sin(yaw), -np.cos(yaw), zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)]
            ),
            "truth/velocity": np.tile([TURN / CONFIG.frame_period, 0, 0, 0, 0, 0], (frames, 1)),
            "truth/depth": pictures(frames),
        }
        streams = {name: Stream(rows[name].shape[1:], rows[name].dtype.str, "", "") for name in rows}
        products = {"truth/depth_intrinsics": Product(np.array(PINHOLE), "pixels", "")}
        with RecordingWriter(folder / f"{k}.h5", CONFIG, streams=streams, products=products) as writer:
            adc = rng.normal(0, 50, (frames, *CONFIG.frame_shape)).astype(np.int16)
            writer.append(adc, np.arange(frames) * CONFIG.frame_period, rows=rows)
    return folder


def test_velocity_is_a_finite_difference_at_the_end_of_its_interval(data):
    """On a circle: the chord, seen from the heading before, is turned by half of the turn to the left."""
    (velocity,) = TASKS["translation"].truth
    table = FeatureTable.read([data / "0.h5"], ("published_range_azimuth_1",), (velocity,), maker=PublishedMaps)
    assert table.lengths == [10] and table.grid.frame_period == pytest.approx(2 * CONFIG.frame_period)
    step = 2 * TURN
    speed = 2 * np.sin(step / 2) / (2 * CONFIG.frame_period)
    expected = speed * np.array([np.cos(step / 2), np.sin(step / 2)])
    assert table.truth["published_velocity"].numpy() == pytest.approx(np.tile(expected, (10, 1)), abs=1e-5)


def test_a_tilted_sensor_moves_in_its_own_frame():
    turn = Rotation.from_euler("zyx", [0.4, 0.3, 0.1])
    pose = np.zeros((2, 7))
    pose[:, 3:] = turn.as_quat()
    pose[1, :3] = turn.apply([0.1, 0.02, 0.05])
    assert labels.finite_difference(pose, np.array([0, 0.1])) == pytest.approx(np.tile([1.0, 0.2], (2, 1)))


def test_occupancy_is_of_the_next_depth_picture(data):
    """Cells that hold a pixel of the slab and their neighbours, pixel by pixel; frame i goes with picture i + 1."""
    with Recording(data / "0.h5") as recording:
        found = labels.occupancy(recording, slice(0, 24, 2))
    depth = pictures(24) * 1e-3
    fx, fy, cx, cy = PINHOLE
    for i, label in enumerate(found):
        expected = np.zeros((96, 88), np.uint8)
        for v in range(20):
            for u in range(60):
                z = depth[min(2 * i + 1, 23), v, u]
                x, y, up = z, -(u - cx) / fx * z, -(v - cy) / fy * z
                cell, column = round(np.hypot(x, y) / (4.284375 / 95)), (np.degrees(np.arctan2(y, x)) + 43) / (86 / 87)
                if abs(up) < 0.03 and 1 <= cell < 95 and 1 <= round(column) < 87:
                    expected[cell : cell + 2, round(column) : round(column) + 2] = 1
        assert np.array_equal(label, expected)
        assert 100 < label.sum() < 200


def test_pooled_dice_knows_no_balance():
    """One minus the mean probability of the true class, whatever the classes' shares."""
    rng = torch.Generator().manual_seed(0)
    logits = torch.randn(3, 2, 5, 7, generator=rng)
    label = (torch.rand(3, 5, 7, generator=rng) < 0.1).to(torch.uint8)
    likely = logits.double().softmax(dim=1).numpy()
    right = np.where(label.numpy() == 1, likely[:, 1], likely[:, 0])
    assert pooled_dice(logits, label).item() == pytest.approx(1 - right.mean(), abs=1e-6)


class Fixed(torch.nn.Module):
    """A network that returns given values, first forward, then in reversed time."""

    def __init__(self, answer):
        super().__init__()
        self.answer = answer

    def forward(self, maps):
        return self.answer


def test_losses():
    translation, rotation = TASKS["translation"], TASKS["rotation"]
    maps, label = torch.zeros(2, 1, 2, 4, 4), torch.tensor([[1.0, 0.0], [0.0, 2.0]])
    estimate = torch.tensor([[1.0, 1.0], [2.0, 2.0]])
    assert translation.loss(Fixed(estimate), maps, label).tolist() == pytest.approx([(5 / 4) ** 0.5] * 2)
    both = torch.tensor([[0.3], [0.1], [-0.1], [0.0]])
    expected = [(0.2 - 0.3) ** 2 + (-0.2 + 0.1) ** 2, (0.1 - 0.1) ** 2 + (-0.1 - 0.0) ** 2]
    found = rotation.loss(Fixed(both), torch.zeros(2, 2, 3, 4, 4), torch.tensor([[0.2], [0.1]]))
    assert found.tolist() == pytest.approx(expected)


def test_augmentations():
    """Doppler is flipped and time is swapped, with the label's sign; occupancy is mirrored column by column."""
    generator = torch.Generator().manual_seed(0)
    maps = torch.rand(64, 2, 3, 6, 8, generator=generator)
    for kind, axis in (("translation", 3), ("rotation", 1)):
        found, label = TASKS[kind].augment(maps, torch.ones(64, 1), generator)
        signs = [torch.equal(a, b.flip(axis - 1)) for a, b in zip(found, maps, strict=True)]
        assert torch.equal(label[:, 0], torch.tensor([-1.0 if back else 1.0 for back in signs]))
        assert 16 < sum(signs) < 48
    label = torch.randint(0, 2, (64, 6, 8), generator=generator, dtype=torch.uint8)
    found, mirrored = TASKS["segmentation"].augment(maps, label, generator)
    flipped = [torch.equal(a, b.flip(3)) for a, b in zip(found, maps, strict=True)]
    assert [torch.equal(a, b.flip(1)) for a, b in zip(mirrored, label, strict=True)] == flipped and 16 < sum(flipped)


def networks(folder, width=2, config=CONFIG, name="published-{}.safetensors"):
    """Random ones of all kinds, as files."""
    for kind, task in TASKS.items():
        header = Header(
            kind=kind, setting="published", frames=task.defaults.frames, maps=task.maps, width=width,
            grid=MapGrid.of(config, task.maps[0], PublishedMaps),
        )  # fmt: skip
        torch.manual_seed(3)
        net = build(task.network, header)
        net(example(net, header)[0] / 10)  # moves the batch normalisation's statistics
        save(net.eval(), header, folder / name.format(kind))
    return folder


def test_sizes():
    """What networks of the paper's widths read, and who trains them."""
    for kind, task in TASKS.items():
        assert len(task.maps) * task.defaults.frames == {"translation": 2, "rotation": 6, "segmentation": 6}[kind]
    found = {kind: task.optimiser.__name__ for kind, task in TASKS.items()}
    assert found == {"translation": "Adam", "rotation": "AdamW", "segmentation": "Adam"}


def test_the_chain_is_four_interleaved_ones_and_euler_steps(data, tmp_path):
    """In batches of any size, against one loop over all frames."""
    weights = networks(tmp_path)
    with Recording(data / "0.h5") as recording:
        adc, times = recording.adc(0, 24), recording.times
    maps = PublishedMaps(CONFIG)(adc, frames=slice(4, None, 2))  # the first ones have no map of five frames
    nets = {kind: load(weights / f"published-{kind}.safetensors", task.network)[0] for kind, task in TASKS.items()}

    def seen(kind):
        return torch.stack([torch.from_numpy(maps[name]).float() for name in nets[kind].maps], dim=1)

    headings = np.array([3.0, 3.1, 3.3, 3.2])
    with torch.no_grad():
        velocity = nets["translation"](seen("translation")[:, None]).numpy()
        ranges = seen("rotation")
        yaw = list(headings - headings[0])
        for n in range(4, 10):
            a, b = ranges[n - 4], ranges[n]
            forth, back = (nets["rotation"](torch.stack(pair)[None]).item() for pair in ((a, b), (b, a)))
            yaw.append(yaw[n - 4] + (forth - back) / 2)
    place = np.zeros((10, 2))
    for n in range(1, 10):
        c, s = np.cos(yaw[n - 1]), np.sin(yaw[n - 1])
        step = 2 * CONFIG.frame_period * velocity[n]
        place[n] = place[n - 1] + [c * step[0] - s * step[1], s * step[0] + c * step[1]]

    likely = nets["segmentation"].estimate(seen("segmentation")[:, None]).detach().numpy()
    scans = np.full((24, len(BEARINGS)), np.inf)
    scans[4::2] = first_occupied(likely)
    signal = Signal(CONFIG)
    for size in (1, 5, 24):
        maps = PublishedStream(CONFIG)
        odometry = PublishedOdometry(maps, nets["translation"], nets["rotation"], headings)
        scanner = PublishedScans(maps, nets["segmentation"])
        batches = list(stream(Preprocessor(signal), adc, times, size=size))
        tracks = [odometry.update(one) for one in batches]
        poses = np.concatenate([track.pose for track in tracks])
        assert np.concatenate([track.time for track in tracks]) == pytest.approx(times[4::2] + CONFIG.burst_center)
        assert poses[:, :2] == pytest.approx(place, abs=1e-5)
        assert np.exp(1j * poses[:, 2]) == pytest.approx(np.exp(1j * np.array(yaw)), abs=1e-5)
        # Of the same batches, whose maps are made once.
        assert np.concatenate([scanner.extract(one) for one in batches]) == pytest.approx(scans, abs=1e-5)


def test_a_pipeline_keeps_what_was_used(data, tmp_path):
    """Every second frame from the fifth on; scans and poses of the rest are none."""
    inputs = Inputs(CONFIG, weights=Weights(networks(tmp_path)))
    pipeline, preprocessor = make_pipeline(inputs, "published", "published"), Preprocessor(inputs.signal)
    with Recording(data / "0.h5") as recording:
        results = list(pipeline.run(stream(preprocessor, recording.adc(0, 9), recording.times[:9], size=1)))
    assert isinstance(pipeline, Pipeline) and [len(result.frames) for result in results] == [0, 0, 0, 0, 1, 0, 1, 0, 1]
    assert np.concatenate([result.frames for result in results]).tolist() == [4, 6, 8]
    assert sum(len(result.track.pose) for result in results) == sum(len(result.ranges) for result in results) == 3


def test_scans_are_the_first_occupied_cells():
    likely = np.zeros((1, 96, 88))
    likely[0, 40, 30], likely[0, 60, 30], likely[0, 20, 31] = 0.6, 0.9, 0.5
    scan = first_occupied(likely)[0]  # -13.3 deg in the label's 30th column, -13 deg in the scan's 31st
    assert np.flatnonzero(np.isfinite(scan)).tolist() == [31] and scan[31] == pytest.approx(40 * 4.284 / 95)


def test_from_data_to_a_run(data, tmp_path):
    """`radarize train` of all three and `radarize run` with what they wrote; nothing is learned from so little."""
    for kind in TASKS:
        named = ["train", f"published-{kind}"] if kind == "rotation" else ["train", kind, "--settings", "published"]
        arguments = [*named, "--data", str(data), "--width", "2", "--epochs", "1"]
        arguments += ["--batch", "4", "-o", str(tmp_path / f"published-{kind}.safetensors"), "--device", "cpu"]
        done = CliRunner().invoke(app, arguments)
        assert done.exit_code == 0, done.output
        header = load(tmp_path / f"published-{kind}.safetensors", TASKS[kind].network, CONFIG)[1]
        assert header.setting == "published" and header.grid.frame_period == pytest.approx(2 / 30, rel=1e-3)
    assert header_of(tmp_path / "published-rotation.safetensors").spacings == (1, 2, 3, 4)
    output = tmp_path / "run"
    arguments = ["run", str(data / "0.h5"), "-o", str(output), "--settings", "published", "--weights", str(tmp_path)]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    methods = json.loads((output / "run.json").read_text())["methods"]
    assert methods == {"odometry": "published", "scans": "published"}
    times, poses = read_tum(output / "odometry.tum")
    assert len(times) == 10
    yaw = 2 * np.arctan2(poses[:4, 5], poses[:4, 6])
    assert np.diff(yaw) == pytest.approx(2 * TURN, abs=1e-6)  # from the truth
    assert CliRunner().invoke(app, ["evaluate", str(output)]).exit_code == 0


def test_what_does_not_fit_is_refused(data, tmp_path):
    for choice in ({"odometry": "published"}, {"scans": "published"}, {"odometry": "published", "scans": "published"}):
        with pytest.raises(InputError, match="published odometry and scans come without weights"):
            run(data / "0.h5", tmp_path / "run", **({"odometry": "doppler", "scans": "threshold"} | choice))
    arguments = ["run", str(data / "0.h5"), "-o", str(tmp_path / "run"), "--settings", "published"]
    done = CliRunner().invoke(app, [*arguments, "--odometry", "doppler"])
    assert isinstance(done.exception, InputError)
    assert "--odometry is 'doppler', expected none with --settings published" in str(done.exception)
    with pytest.raises(InputError, match="translation.safetensors: no such file"):
        run(data / "0.h5", tmp_path / "run", odometry="published", scans="published", weights=tmp_path)
    networks(tmp_path)
    with pytest.raises(InputError, match="does not fit this radar, which has rows 64 instead of 96"):
        other = Inputs(CONFIG.model_copy(update={"samples": 64}), weights=Weights(tmp_path))
        make_odometry(other, "published")
    done = CliRunner().invoke(app, ["train", "translation", "--settings", "old", "--data", ".", "-o", "a.safetensors"])
    assert done.exit_code != 0
