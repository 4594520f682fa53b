"""What the viewer is sent, read back from an .rrd file and compared with the recording and the run."""

import shutil
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarize.cli import app
from radarize.evaluation.viewer import view
from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.io.recording import Product, Recording, RecordingWriter, Stream
from radarize.io.tum import read_tum
from radarize.pipeline.runfolder import OccupancyMap, Scans
from radarize.radar.presets import PRESETS
from tests.evaluation.fake_run import write_run

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed (pip install 'radarize[viewer]')")
rrd = pytest.importorskip("rerun.chunk", reason="rerun-sdk is not installed (pip install 'radarize[viewer]')")

# The library turns its own errors into warnings.
pytestmark = pytest.mark.filterwarnings("error::UserWarning", "error::rerun.error_utils.RerunWarning")

COUNT = 20
CONFIG = PRESETS["radarize"].model_copy(update={"loops": 4})
CLOCK = 1.7e9
BIN = 40
CAUSES = ("direct", "floor_ceiling", "ghost_1", "ghost_2", "ghost_3", "through_slab", "moving", "leakage")


class Entities:
    """Columns of a file by entity, in order of time; times in seconds."""

    def __init__(self, path):
        self.found: dict[str, dict[str, list]] = {}
        self.times: dict[str, np.ndarray] = {}
        rows: dict[str, list] = {}
        for chunk in rrd.RrdReader(str(path)).stream():
            batch = chunk.to_record_batch()
            for row in batch.to_pylist():
                if chunk.is_static:
                    for name, value in row.items():
                        self.found.setdefault(chunk.entity_path, {})[name] = value
                else:
                    assert chunk.timeline_names == ["time"]
                    rows.setdefault(chunk.entity_path, []).append(row)
        for path, each in rows.items():
            each.sort(key=lambda row: row["time"])
            self.times[path] = np.array([row["time"].total_seconds() for row in each])
            for name in each[0]:
                self.found.setdefault(path, {})[name] = [row[name] for row in each]

    def __getitem__(self, key: tuple[str, str]):
        return self.found[key[0]][key[1]]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A tone at one range, straight ahead, and known truth of every kind."""
    path = tmp_path_factory.mktemp("view") / "walk.h5"
    rng = np.random.default_rng(0)
    n = CONFIG.samples
    beat = 800 * np.exp(2j * np.pi * BIN * np.arange(n) / n)
    adc = np.broadcast_to(np.stack([beat.real, beat.imag], axis=-1), (COUNT, *CONFIG.frame_shape))
    adc = np.rint(adc + rng.normal(0, 5, adc.shape)).astype(np.int16)
    times = CLOCK + CONFIG.frame_period * np.arange(COUNT)
    t = np.arange(COUNT)[:, None] / COUNT
    quaternions = Rotation.from_euler("z", t).as_quat()
    scan = np.where(rng.random((COUNT, 7)) < 0.3, np.inf, rng.uniform(1, 3, (COUNT, 7)))
    rows = {
        "truth/time": times + CONFIG.burst_center,
        "truth/pose": np.hstack([3 * t, np.sin(3 * t), 1 + 0 * t, quaternions]),
        "truth/velocity": rng.normal(size=(COUNT, 6)),
        "truth/scan": scan,
        "truth/cause": rng.choice(np.array([0, 2, 255], np.uint8), (COUNT, n, 5)),
        "truth/depth": rng.integers(0, 4000, (COUNT, 6, 8)).astype(np.uint16),
    }
    labels = {"truth/cause": CAUSES}
    streams = {k: Stream(v.shape[1:], v.dtype.str, "", "", labels=labels.get(k, ())) for k, v in rows.items()}
    fixed = {
        "truth/scan_azimuths": np.linspace(-1, 1, 7), "truth/floor_plan": np.array([[0, 0, 4, 0], [4, 0, 4, 3.0]]),
        "truth/depth_mount": np.array([0.1, 0, 0.05, 0, 0, 0, 1]), "truth/depth_intrinsics": np.array([5, 5, 4, 3.0]),
    }  # fmt: skip
    products = {k: Product(v, "", "") for k, v in fixed.items()}
    with RecordingWriter(path, CONFIG, streams=streams, products=products) as writer:
        writer.append(adc, times, rows=rows)
    return path


@pytest.fixture(scope="module")
def shown(recording):
    done = []
    path = view(recording, save=recording.with_suffix(".rrd"), progress=lambda *where: done.append(where))
    assert done == [(16, COUNT), (COUNT, COUNT)]
    return Entities(path)


def test_poses_are_on_the_time_line(recording, shown):
    with Recording(recording) as source:
        stamps, poses, velocity = (source.read(f"truth/{name}") for name in ("time", "pose", "velocity"))
    assert shown.times["/world/truth/radar"] == pytest.approx(stamps - CLOCK, abs=1e-6)
    places = np.array(shown["/world/truth/radar", "Transform3D:translation"]).reshape(-1, 3)
    turns = np.array(shown["/world/truth/radar", "Transform3D:quaternion"]).reshape(-1, 4)
    assert np.hstack([places, turns]) == pytest.approx(poses, abs=1e-6)
    assert np.array(shown["/world/truth/path", "LineStrips3D:strips"])[0][-1] == pytest.approx(poses[-1, :3], abs=1e-6)
    assert np.ravel(shown["/velocity/left/truth", "Scalars:scalars"]) == pytest.approx(velocity[:, 1])
    walls = np.array(shown["/world/floor_plan", "LineStrips3D:strips"])
    assert walls[1] == pytest.approx(np.array([[4, 0, 0], [4, 3, 0]]))


def test_scans_are_where_the_beams_end(recording, shown):
    with Recording(recording) as source:
        scans, azimuths = source.read("truth/scan"), source.read("truth/scan_azimuths")
    clouds = shown["/world/truth/radar/scan", "Points3D:positions"]
    assert len(clouds) == COUNT
    for cloud, scan in zip(clouds, scans, strict=True):
        hit = np.isfinite(scan)
        points = np.array(cloud).reshape(-1, 3)
        assert np.hypot(*points[:, :2].T) == pytest.approx(scan[hit], rel=1e-5)
        assert np.arctan2(points[:, 1], points[:, 0]) == pytest.approx(azimuths[hit], abs=1e-5)


def pixels(shown, path: str, kind: str, dtype=np.uint8) -> np.ndarray:
    form = shown[path, f"{kind}:format"][0]
    shape = (form["height"], form["width"])
    buffers = [np.array(blob[0], np.uint8).tobytes() for blob in shown[path, f"{kind}:buffer"]]
    return np.stack([np.frombuffer(buffer, dtype).reshape(*shape, -1) for buffer in buffers])


def test_heat_maps_show_the_echo(shown):
    """Far is up: the tone's row counted from below; straight ahead is the middle column."""
    maps = pixels(shown, "/radar/range_azimuth", "Image").astype(int)
    assert maps.shape == (COUNT, CONFIG.samples, 80, 3)
    row, column = np.unravel_index(maps.sum(axis=(0, 3)).argmax(), maps.shape[1:3])
    assert CONFIG.samples - 1 - row == BIN and column in (39, 40)
    assert pixels(shown, "/radar/doppler_azimuth", "Image").shape == (COUNT, CONFIG.loops, 80, 3)
    assert shown.times["/radar/range_azimuth"] == pytest.approx(
        CONFIG.frame_period * np.arange(COUNT) + CONFIG.burst_center, abs=1e-6
    )


def test_causes_and_depth_keep_their_values(recording, shown):
    with Recording(recording) as source:
        cause, depth = source.read("truth/cause"), source.read("truth/depth")
    assert np.array_equal(pixels(shown, "/radar/cause", "SegmentationImage")[..., 0], cause[:, ::-1, ::-1])
    context = shown["/radar/cause", "AnnotationContext:context"][0]
    labels = {item["class_id"]: item["class_description"]["info"]["label"] for item in context}
    assert labels == {**dict(enumerate(CAUSES)), 255: "noise"}
    colors = [item["class_description"]["info"]["color"] for item in context]
    assert len(set(colors)) == len(CAUSES) + 1
    camera = "/world/truth/radar/camera/depth"
    assert np.array_equal(pixels(shown, camera, "DepthImage", np.uint16)[..., 0], depth)
    assert shown[camera, "DepthImage:meter"] == [1000.0]


def test_a_run_lies_upon_the_truth(tmp_path):
    run = write_run(tmp_path / "run")
    shown = Entities(view(run, save=tmp_path / "run.rrd"))
    stamps, slam = read_tum(run / "trajectory.tum")
    _, truth = read_tum(run / "reference.tum")
    places = np.array(shown["/world/slam/radar", "Transform3D:translation"]).reshape(-1, 3)
    assert shown.times["/world/slam/radar"] == pytest.approx(stamps - stamps[0], abs=1e-6)
    assert places == pytest.approx(slam[:, :3], abs=1e-5)
    turn = np.array(shown["/world/slam", "Transform3D:mat3x3"]).reshape(3, 3).T  # column by column
    shift = np.ravel(shown["/world/slam", "Transform3D:translation"])
    assert places @ turn.T + shift == pytest.approx(truth[:, :3], abs=0.15)
    scans = Scans(run / "scans.h5")
    hit = np.isfinite(scans["ranges"]).sum(axis=1)
    clouds = shown["/world/slam/radar/scan", "Points3D:positions"]
    assert [len(cloud or ()) for cloud in clouds] == hit.tolist()
    found = OccupancyMap.read(run / "map.yaml")
    assert bytes(np.array(shown["/world/slam/map", "GridMap:data"][0], np.uint8)) == found.pixels.tobytes()
    assert shown["/world/slam/map", "GridMap:translation"][0][:2] == pytest.approx(found.origin[:2], abs=1e-5)
    assert "/world/odometry/path" in shown.found and "/velocity/forward/run" in shown.found


def test_what_cannot_be_shown_is_said_in_a_sentence(recording, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="no such file"):
        view(tmp_path / "nothing.h5", save=tmp_path / "x.rrd")
    with pytest.raises(InputError, match="has no trajectory.tum"):
        view(recording, tmp_path, tmp_path / "x.rrd")
    with RecordingWriter(tmp_path / "empty.h5", CONFIG):
        pass
    with pytest.raises(InputError, match="has no whole frame"):
        view(tmp_path / "empty.h5", save=tmp_path / "x.rrd")
    assert not list(tmp_path.glob("x.rrd*"))


def test_without_the_viewer_the_command_says_what_to_type(recording, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(SystemExit) as ended:
        run(app, "radarize", ["view", str(recording), "--save", str(tmp_path / "x.rrd")])
    assert ended.value.code == 2 and "type: pip install 'radarize[viewer]'" in capsys.readouterr().err


def test_one_antenna_has_no_maps(tmp_path):
    config = CONFIG.model_copy(update={"rx": (0,), "tx_order": (0,)})
    with RecordingWriter(tmp_path / "one.h5", config) as writer:
        writer.append(np.ones((2, *config.frame_shape), np.int16), np.arange(2) * config.frame_period)
    shown = Entities(view(tmp_path / "one.h5", save=tmp_path / "one.rrd"))
    assert not [path for path in shown.found if path.startswith("/radar/")]


def test_a_window_needs_a_screen(recording, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match="DISPLAY are not set; --save writes a file"):
        view(recording)


def test_the_viewer_is_found_without_an_activated_environment(recording, monkeypatch):
    """Typed as .venv/bin/radarize, with nothing of .venv on the path."""
    found = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setenv("PATH", "/usr/bin")
    monkeypatch.setattr(rerun.RecordingStream, "spawn", lambda *_, **__: found.append(shutil.which("rerun")))
    view(recording)
    assert Path(found[0]).parent == Path(sysconfig.get_path("scripts"))
