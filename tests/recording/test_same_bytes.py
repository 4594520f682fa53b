"""A recording is a function of its scenario: its bytes do not depend on how it is made.

Batches, processes, kills, a cluster and sensors that are added later do not matter; neither does the order of frames.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from radarize.io.console import run
from radarize.io.recording import Recording
from radarize.learning.features.keeping import keep_maps
from radarsim.cli import app
from radarsim.dataset.run import INDEX, make
from radarsim.dataset.specification import Specification
from radarsim.dataset.task import Task
from radarsim.recording import batches
from radarsim.recording.add_sensors import add_sensors
from radarsim.recording.batches import Batches
from radarsim.recording.simulate import planned, simulate
from radarsim.scenario import Scenario
from radarsim.sensors.suite import Suite, chosen
from radarsim.world.scene import Scene
from tests.dataset import hall

COUNT = 6


@pytest.fixture(scope="module")
def specification(tmp_path_factory) -> Path:
    """Two recordings with all sensors; the radar swings on an arm."""
    arm = {"arm": {"mounting": [0.2, 0.05, 0.1, 2, 3, -1]}}
    walks = {"recordings": hall.recordings(["cart", "robot"]), "sensors": "all", "storage": "heatmaps"}
    return hall.write(tmp_path_factory.mktemp("specification"), variants=arm, **walks)


def plan_of(task: Task) -> dict[str, object]:
    """Arguments of `simulate` for a data set task's recording."""
    way = {"platform": task.platform, "duration": task.duration, "waypoints": np.array(task.waypoints)}
    same = {"scene": task.scene, "seed": task.seed, "radar": task.radar, "sensors": task.sensors}
    return way | same | {"mounting": task.variant.mounted}


@pytest.fixture(scope="module")
def plan(specification) -> dict[str, object]:
    """Plan of the first recording."""
    return plan_of(Specification.load(specification).tasks[0])


@pytest.fixture(scope="module")
def expected(plan, tmp_path_factory) -> Path:
    """All frames in one batch, by this process with all threads; the reference for all others."""
    path = simulate(output=tmp_path_factory.mktemp("expected") / "whole.h5", **plan)
    with Recording(path) as recording:
        assert len(recording) == COUNT <= batches.TOGETHER
    return path


@pytest.fixture(scope="module")
def scenario(plan) -> Scenario:
    return planned(**plan)[0]


def parts(path: Path) -> dict[str, object]:
    """Contents of a recording: attributes, and data sets with their descriptions."""
    with Recording(path) as recording:
        data = {name: (recording.describe(name), recording.read(name).tobytes()) for name in recording.names()}
        return data | {f"attribute {name}": value for name, value in recording.attributes.items()}


def differences(found: Path, expected: Path) -> list[str]:
    """Names of the parts in which two recordings differ."""
    one, other = parts(found), parts(expected)
    return sorted(name for name in one.keys() | other.keys() if str(one.get(name)) != str(other.get(name)))


def agree(found: Path, expected: Path) -> bool:
    """Whether all data sets of a recording equal those of one with more sensors."""
    whole = parts(expected)
    return all(whole[name] == part for name, part in parts(found).items() if not name.startswith("attribute"))


Way = Callable[[dict, Path, pytest.MonkeyPatch], object]


def frame_by_frame(plan, path, monkeypatch):
    """From a scene object; for so few frames only this process is used."""
    monkeypatch.setattr(batches, "TOGETHER", 1)
    monkeypatch.setattr(batches, "perform", None)
    simulate(output=path, workers=None, **plan | {"scene": Scene.load(plan["scene"])})


def by_two_processes(plan, path, monkeypatch):
    """In batches of two; this process computes none, and the others do not outlive the recording."""
    monkeypatch.setattr(batches, "TOGETHER", 2)
    monkeypatch.setattr(Batches, "made", None)
    simulate(output=path, workers=2, **plan)
    assert not active_children()


def after_a_kill(plan, path, monkeypatch):
    """Resumed without computing existing frames again, except two for comparison."""
    monkeypatch.setattr(batches, "TOGETHER", 2)
    until_killed(plan, path, 4)
    asked: list[np.ndarray] = []
    monkeypatch.setattr(Scenario, "frames", lambda *args, made=Scenario.frames: asked.append(args[1]) or made(*args))
    simulate(output=path, **plan)
    assert sum(map(len, asked)) == COUNT - 4 + 2
    assert sorted(each.name for each in path.parent.iterdir()) == [path.name]


def with_sensors_added_later(plan, path, monkeypatch):
    """Including sensors that use the radar's echoes and samples."""
    simulate(output=path, **plan | {"sensors": ()})
    add_sensors(path, planned(**plan)[0], chosen(plan["sensors"]))


class Killed(Exception):
    """Substitute for the end of the process: the file stays as it is on the disk at that time."""


def until_killed(plan: dict, path: Path, frames: int) -> None:
    """Partial recording of a run that is killed after a number of frames."""
    part, left = path.with_name(path.name + ".part"), path.with_name("left")

    def progress(done: int, _: int) -> None:
        if done >= frames:
            with Recording(part) as recording:
                assert len(recording) == frames
            shutil.copy(part, left)
            raise Killed

    with pytest.raises(Killed):
        simulate(output=path, progress=progress, **plan)
    left.rename(part)


@pytest.mark.parametrize(
    "way",
    [frame_by_frame, by_two_processes, after_a_kill, with_sensors_added_later],
)
def test_a_recording_made_another_way(way: Way, plan, expected, tmp_path, monkeypatch):
    way(plan, tmp_path / "a.h5", monkeypatch)
    assert not differences(tmp_path / "a.h5", expected)


def test_frames_in_any_order(scenario, expected):
    """Backwards, two at a time: samples, and rows of all sensors."""
    suite, times, firsts = Suite(scenario), scenario.times, range(0, COUNT, 2)
    frames = {k: scenario.frames(times[k : k + 2]) for k in reversed(firsts)}
    rows = {k: suite.observe(each, k) for k, each in frames.items()}
    with Recording(expected) as recording:
        assert np.array_equal(np.concatenate([frames[k].samples for k in firsts]), recording.adc(0, COUNT))
        for name, stream in suite.streams.items():
            found = np.concatenate([rows[k][name] for k in firsts]).astype(stream.dtype)
            assert np.array_equal(found, recording.read(name), equal_nan=found.dtype.kind == "f"), name


def test_sensors_do_not_change_each_other_but_the_seed_does(plan, expected, tmp_path):
    some = simulate(output=tmp_path / "some.h5", **plan | {"sensors": ["imu", "depth"]})
    names = parts(some).keys()
    assert {"imu/gyroscope", "truth/depth", "radar/adc"} <= names and "truth/cause" not in names
    assert agree(some, expected)
    other = simulate(output=tmp_path / "other.h5", **plan | {"seed": 5, "sensors": ()})
    assert {"radar/adc", "truth/pose"} <= set(differences(other, some))


@pytest.mark.parametrize("other", ["seed", "world"])
def test_what_another_run_has_left_is_not_gone_on_with(other, plan, expected, tmp_path, monkeypatch):
    """A partial recording of another seed, or of another world of the same name, detected by its frames."""
    monkeypatch.setattr(batches, "TOGETHER", 2)
    plan = plan | {"sensors": ()}
    (tmp_path / "hall.yaml").write_text("".join(line for line in hall.HALL.splitlines(True) if "pipe" not in line))
    until_killed(plan | {"seed": {"seed": 5}, "world": {"scene": tmp_path / "hall.yaml"}}[other], tmp_path / "a.h5", 4)
    assert agree(simulate(output=tmp_path / "a.h5", **plan), expected)


@pytest.fixture(scope="module")
def maps(specification, plan, expected, tmp_path_factory) -> dict[str, Path]:
    """Data set with heat maps of the recordings that `simulate` makes."""
    folder = tmp_path_factory.mktemp("maps")
    first, second = Specification.load(specification).tasks
    whole = {first.name: expected, second.name: simulate(output=folder / "second.h5", **plan_of(second))}
    return {f"{name}.h5": keep_maps(raw, folder / f"{name}.h5") for name, raw in whole.items()}


def same(folder: Path, maps: dict[str, Path]) -> None:
    assert sorted(path.name for path in folder.iterdir()) == sorted([INDEX, *maps])
    for name, path in maps.items():
        assert differences(folder / name, path) == ["attribute task"]


def test_a_data_set_that_was_killed(specification, maps, tmp_path, capsys):
    """The process and its worker are killed in the second recording; the first one is kept."""
    typed = ["dataset", str(specification), "-o", str(tmp_path), "--workers", "1"]
    command = [sys.executable, "-m", "radarsim.cli", *typed]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    first, second = (tmp_path / name for name in maps)
    waited = time.monotonic() + 120
    while not list(tmp_path.glob(f"{second.name}.*part")):
        assert time.monotonic() < waited and process.poll() is None
        time.sleep(0.005)
    process.kill()
    process.wait()
    assert first.exists() and not second.exists()
    stamp = first.stat().st_mtime_ns
    with pytest.raises(SystemExit) as ended:
        run(app, "radarsim", typed)
    printed = capsys.readouterr()
    assert ended.value.code == 0, printed.err
    assert "1 recordings made, 1 already there" in printed.out and f"{second.stem}: " in printed.out
    assert first.stat().st_mtime_ns == stamp
    same(tmp_path, maps)


def test_a_data_set_by_a_ray_cluster(cluster, specification, maps, tmp_path):
    seen = []
    outcome = make(
        Specification.load(specification), tmp_path, ray=cluster, progress=lambda *p: seen.append(p), log=lambda _: None
    )
    assert len(outcome.made) == 2 and seen[-1] == (2 * COUNT, 2 * COUNT)
    same(tmp_path, maps)
