"""Frames are functions of their instants: batches, order, processes and interruptions do not matter."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from radarize.errors import InputError
from radarize.radar.presets import PRESETS
from radarize.recording import Recording
from radarsim.motion.trajectory import Motion, Mounting
from radarsim.motion.walk import Walk
from radarsim.receiver.frontend_config import Band, FrontEndConfig
from radarsim.recording.add_sensors import accompany
from radarsim.recording.batches import Batches
from radarsim.recording.simulate import record
from radarsim.rng import keyed_rng
from radarsim.scenario import Scenario
from radarsim.sensors.suite import Suite
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16})
COUNT = 12
SCENE = Scene.of(
    {
        "objects": [
            {
                "name": "floor",
                "shape": "rectangle",
                "size": [6, 4],
                "position": [3, 2, 0],
                "facing": [0, 0, 1],
                "material": "concrete",
            },
            {
                "name": "wall",
                "shape": "rectangle",
                "size": [4, 2.5],
                "position": [6, 2, 1.2],
                "facing": [-1, 0, 0],
                "material": "concrete",
            },
            {
                "name": "side",
                "shape": "rectangle",
                "size": [6, 2.5],
                "position": [3, 4, 1.2],
                "facing": [0, -1, 0],
                "material": "concrete",
            },
            {
                "name": "pipe",
                "shape": "cylinder",
                "radius": 0.05,
                "height": 2,
                "position": [5, 3, 1],
                "material": "metal",
            },
        ],
        "moving": [{"kind": "person", "name": "visitor", "path": [[3, 1], [5, 2.5]], "speed": 1.2}],
    },
    "room",
)


def room(*sensors: str, seed: int = 4, seconds: float = 1.3) -> Scenario:
    """Somebody in a room, and everything that noise, boards and phases are drawn for; the radar swings on an arm."""
    places, mounting = np.array([[0.8, 1.5], [1.9, 2.0]]), Mounting.of((0.2, 0.05, 0.1), (2, 3, -1))
    walk = Walk("cart", seconds, waypoints=places, mounting=mounting)
    return Scenario(SCENE, walk.through(SCENE, seed), CONFIG, FrontEndConfig(), seed, sensors)


def recorded(scenario: Scenario, path: Path, **options) -> Path:
    """All of its frames."""
    return record(Batches.of(scenario), path, **options)


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return room("all")


@pytest.fixture(scope="module")
def whole(scenario) -> np.ndarray:
    """The first frames in one go."""
    return scenario.frames(scenario.times[:COUNT]).samples


@pytest.mark.parametrize("size", [1, 3, 8])
def test_batches_do_not_matter(scenario, whole, size):
    parts = [scenario.frames(scenario.times[k : min(k + size, COUNT)]).samples for k in range(0, COUNT, size)]
    assert np.array_equal(np.concatenate(parts), whole)


def test_neither_does_the_order(scenario, whole):
    backwards = [scenario.frames(scenario.times[k : k + 1]).samples[0] for k in reversed(range(COUNT))]
    assert np.array_equal(backwards[::-1], whole)
    assert np.array_equal(scenario.frames(scenario.times[5:7]).samples, whole[5:7])  # and again


def test_sensors_see_the_same_in_any_batches(scenario):
    suite, times = Suite(scenario), scenario.times[:COUNT]
    once = suite.observe(scenario.frames(times))
    for size in (1, 3):
        rows = [suite.observe(scenario.frames(times[k : k + size]), k) for k in reversed(range(0, COUNT, size))][::-1]
        for name, expected in once.items():
            assert np.array_equal(np.concatenate([each[name] for each in rows]), expected, equal_nan=True), name


def test_without_a_filter_what_lies_beyond_the_range_folds():
    """A large metal wall faces an isotropic radar from `far`: its echo falls as 1 / R, and without a decimation filter
    it stands at the range less the unambiguous one; with one it is gone."""

    def profile(range: float, **changes) -> np.ndarray:
        wall = {"name": "wall", "shape": "rectangle", "size": [8, 8], "position": [range, 0, 0], "facing": [-1, 0, 0]}
        scene = Scene.of({"objects": [wall | {"material": "metal"}]}, "wall")
        board = FrontEndConfig.ideal(full_scale_dbm=-40, **changes)
        samples = Scenario(scene, Motion.still((0, 0, 0)), CONFIG, board).frames(np.array([0.0])).samples[0]
        beat = (samples[..., 0] + 1j * samples[..., 1])[0, 0, 0]
        return np.abs(np.fft.fft(beat * np.hanning(len(beat)), 16 * len(beat)))

    near, far = CONFIG.max_range / 2, 1.5 * CONFIG.max_range
    direct, folded = profile(near), profile(far)
    step = CONFIG.max_range / len(direct)
    assert abs(direct.argmax() - folded.argmax()) * step < 0.01 and abs(folded.argmax() * step - near) < 0.01
    assert folded.max() / direct.max() == pytest.approx(near / far, rel=0.05)
    assert profile(far, band=Band()).max() < 0.01 * folded.max()


def test_draws_differ_by_seed_purpose_and_instant():
    keys = [(s, p, t) for s in (0, 1) for p in ("noise", "depth") for t in (None, 0.0, 1e-9, 1 / 30, 200.0)]
    first = {keyed_rng(*key).random() for key in keys}
    assert len(first) == len(keys) and first == {keyed_rng(*key).random() for key in keys}


LATER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import numpy as np
from test_scenario import COUNT, room

scenario = room("imu")
np.save(sys.argv[2], scenario.frames(scenario.times[5:COUNT]).samples)
"""


def test_another_process_makes_the_later_half_of_a_recording(whole, tmp_path):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", LATER, Path(__file__).parent, tmp_path / "later.npy"]
    subprocess.run(command, env=environment, check=True)
    assert np.array_equal(np.load(tmp_path / "later.npy"), whole[5:])


class Killed(Exception):
    """Stands for the end of the process: the file is left as it lies on the disk then."""


def until_killed(scenario: Scenario, path: Path, frames: int) -> Path:
    """What a run leaves that is killed after so many frames."""

    def progress(done: int, _: int) -> None:
        if done >= frames:
            shutil.copy(path.with_name(path.name + ".part"), path.with_name("left"))
            raise Killed

    with pytest.raises(Killed):
        recorded(scenario, path, progress=progress)
    return path.with_name("left").rename(path.with_name(path.name + ".part"))


def test_a_killed_recording_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """To the same bytes, without making anew what is there but for two frames that are compared."""
    scenario = room("imu", "points", "tracking", "depth")
    expected = recorded(scenario, tmp_path / "whole.h5").read_bytes()
    part = until_killed(scenario, tmp_path / "a.h5", 33)
    with Recording(part) as left:
        kept = len(left)
    assert 30 <= kept < len(scenario.times)
    asked: list[np.ndarray] = []
    monkeypatch.setattr(Scenario, "frames", lambda *args, made=Scenario.frames: asked.append(args[1]) or made(*args))
    recorded(scenario, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == expected
    assert sum(map(len, asked)) < len(scenario.times) - kept + 3
    assert sorted(path.name for path in tmp_path.glob("a.h5*")) == ["a.h5"]


def test_processes_beside_each_other_make_the_same_bytes(tmp_path, monkeypatch):
    """Of every stream, however short the recording that somebody wants them for; and none outlives it."""
    scenario = room("all", seconds=0.8)
    expected = recorded(scenario, tmp_path / "a.h5").read_bytes()
    assert recorded(scenario, tmp_path / "b.h5", workers=None).read_bytes() == expected  # too short to start any
    monkeypatch.setattr(Batches, "made", None)  # this process makes none
    assert recorded(scenario, tmp_path / "a.h5", workers=2).read_bytes() == expected
    assert not active_children()


def test_what_fails_in_another_process_is_said_here(tmp_path):
    far = SceneObject("far", shapes.rectangle((90, 0, 0), (1, 1), (-1, 0, 0)), MATERIALS["metal"])
    scenario = replace(room(), scene=Scene("away", [far]))
    with pytest.raises(InputError, match="scene away: no frame has an echo"):
        recorded(scenario, tmp_path / "a.h5", workers=2)
    assert not active_children() and not (tmp_path / "a.h5").exists()


def test_what_another_run_has_left_is_not_gone_on_with(tmp_path):
    """Another seed, and another world of the same name, which only its frames tell."""
    scenario = room()
    expected = recorded(scenario, tmp_path / "whole.h5").read_bytes()
    emptier = Scene("room", [item for item in SCENE.objects if item.name != "pipe"], SCENE.movers)
    emptier = Scenario(emptier, scenario.motion, CONFIG, FrontEndConfig(), scenario.seed)
    for other in (room(seed=5), emptier):
        until_killed(other, tmp_path / "a.h5", 33)
        recorded(scenario, tmp_path / "a.h5")
        assert (tmp_path / "a.h5").read_bytes() == expected


def test_sensors_added_later_are_those_made_at_once(scenario, tmp_path):
    """Even those that look at the radar's echoes and samples."""
    names = ("tracking", "imu", "points", "ghosts", "depth")
    bare = room(seconds=0.5)
    later = accompany(recorded(bare, tmp_path / "later.h5"), bare, names)
    with Recording(later) as one, Recording(recorded(room(*names, seconds=0.5), tmp_path / "once.h5")) as other:
        assert sorted(one.names()) == sorted(other.names())
        for name in other.names():
            assert np.array_equal(one.read(name), other.read(name), equal_nan=True), name
        assert np.array_equal(one.adc(0, len(one)), other.adc(0, len(other)))
