"""Real recordings of a data set: killed and resumed, on local processes and on a Ray cluster, the same bytes."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from fakes import FakeSpecification, fake

from radarize.errors import InputError
from radarize.features.maps import MAPS
from radarize.recording import Recording
from radarsim.dataset.run import INDEX, make
from radarsim.dataset.specification import Specification
from radarsim.motion.walk import Walk
from radarsim.world.scene import Scene

PLAIN = {
    "name": "tiny",
    "seed": 1,
    "buildings": {"office": {"kind": "office", "seed": 3}},
    "recordings": [{"building": "office", "platform": ["cart", "robot"], "count": 1, "duration": 0.5}],
    "sensors": ["occupancy", "imu"],
    "storage": "heatmaps",
}


def differences(found: Path, expected: Path) -> dict[str, list[str]]:
    """Recordings that are not the same to the byte, and what of them differs: attributes, data sets, or their layout.

    Raises:
        OSError: either folder has a file, apart from the index, that the other has not.
    """
    names = {path.name for folder in (found, expected) for path in folder.iterdir()} - {INDEX}
    return {
        name: _parts(found / name, expected / name)
        for name in sorted(names)
        if (found / name).read_bytes() != (expected / name).read_bytes()
    }


def _parts(found: Path, expected: Path) -> list[str]:
    with Recording(found) as a, Recording(expected) as b:
        attributes = [name for name, value in a.attributes.items() if value != b.attributes.get(name)]
        data = [name for name in a.names() if not b.has(name) or a.read(name).tobytes() != b.read(name).tobytes()]
        return attributes + data or ["layout"]


@pytest.fixture(scope="module")
def specification(tmp_path_factory):
    path = tmp_path_factory.mktemp("spec") / "tiny.yaml"
    path.write_text(yaml.safe_dump(PLAIN))
    return path


@pytest.fixture(scope="module")
def undisturbed(specification, tmp_path_factory):
    """Made in this process, with all its threads; all others must give the same bytes."""
    folder = tmp_path_factory.mktemp("undisturbed")
    for task in Specification.load(specification).tasks:
        task.make(folder)
    return folder


def test_a_recording_holds_what_was_asked_for(undisturbed):
    assert sorted(path.name for path in undisturbed.iterdir()) == ["office_cart_00.h5", "office_robot_00.h5"]
    with Recording(undisturbed / "office_cart_00.h5") as recording:
        assert len(recording) == 15 and recording.attributes["platform"] == "cart"
        for name in ("truth/pose", "truth/scan", "truth/occupancy", "imu/gyroscope", *(f"maps/{m}" for m in MAPS)):
            assert recording.has(name)
        assert not recording.has("radar/adc") and not recording.has("truth/depth")


HALL = """
objects:
  - {name: floor, shape: rectangle, size: [6, 4], position: [3, 2, 0], facing: [0, 0, 1], material: vinyl}
  - {name: wall, shape: rectangle, size: [4, 2.5], position: [6, 2, 1.25], facing: [-1, 0, 0], material: wood}
levels:
  - objects: [{name: crate, shape: box, size: [0.5, 0.5, 2], position: [2.2, 2.9, 1.01], material: metal}]
"""


def test_variants_of_a_recording_share_its_walk(tmp_path):
    """The crate of level 1 would push a walk of its own aside, and heights are on one and the same."""
    (tmp_path / "hall.yaml").write_text(HALL)
    group = {"building": "hall", "platform": "cart", "count": 1, "duration": 2, "waypoints": [[1, 2.4], [5, 2.4]]}
    slow = {"radar": {"frame_period": 0.1}}
    variants = {
        "mild": slow,
        "severe": slow | {"level": 1, "attributes": {"severity": 1}},
        "coarse": {"radar": {"samples": 48, "frame_period": 0.3}, "frontend": {"noise": False}},
        "low": slow | {"mounting": [0.2, 0, -0.5, 0, 0, 0]},
        "high": slow | {"mounting": [0.2, 0, 0.1, 0, 0, 0]},
    }
    (tmp_path / "spec.yaml").write_text(
        yaml.safe_dump(PLAIN | {"buildings": {"hall": "hall.yaml"}, "recordings": [group], "storage": "raw"}
                       | {"variants": variants, "attributes": {"stress": "hall", "severity": 0}})
    )  # fmt: skip
    seen = {}
    for task in Specification.load(tmp_path / "spec.yaml").tasks:
        task.make(tmp_path)
        assert task.is_finished(tmp_path)
        with Recording(task.path(tmp_path)) as recording:
            seen[task.name.split("_")[-1]] = (
                recording.read("truth/pose"), recording.adc(0, 2), recording.config, recording.attributes
            )  # fmt: skip
    poses = {name: pose for name, (pose, *_) in seen.items()}
    np.testing.assert_array_equal(poses["severe"], poses["mild"])
    walk = Walk("cart", 2.0, waypoints=np.array(group["waypoints"]))
    own = walk.through(Scene.load(f"{tmp_path / 'hall.yaml'}@1"), task.seed)
    assert np.abs(own.position(np.array([1.9])) - poses["mild"][-1, :3]).max() > 0.05
    np.testing.assert_allclose(poses["coarse"], poses["mild"][::3][: len(poses["coarse"])], atol=2e-3)
    np.testing.assert_allclose(poses["high"][:, :2], poses["low"][:, :2], atol=0.02)
    np.testing.assert_allclose(poses["high"][:, 2] - poses["low"][:, 2], 0.6, atol=0.01)
    assert np.ptp(poses["mild"][:, 0]) > 0.05
    assert (seen["severe"][1] != seen["mild"][1]).any()
    assert seen["coarse"][2].samples == 48 and 'noise":false' in seen["coarse"][3]["front_end"]
    facts = seen["severe"][3]
    assert (facts["scene"], facts["stress"], facts["severity"]) == ("hall@1", "hall", 1)
    assert seen["mild"][3]["severity"] == 0


def test_too_short_a_walk_is_refused(tmp_path):
    (tmp_path / "hall.yaml").write_text(HALL)
    group = {"building": "hall", "platform": "cart", "count": 1, "duration": 4, "waypoints": [[1, 2], [2, 2]]}
    (tmp_path / "spec.yaml").write_text(
        yaml.safe_dump(PLAIN | {"buildings": {"hall": "hall.yaml"}, "recordings": [group]})
    )
    (task,) = Specification.load(tmp_path / "spec.yaml").tasks
    with pytest.raises(InputError, match="hall_cart_00: the way-points are passed after .* of 120 frames"):
        task.make(tmp_path)
    assert not list(tmp_path.glob("*.h5*"))


def test_killed_and_resumed(specification, undisturbed, tmp_path):
    command = [Path(sys.executable).parent / "radarsim", "dataset", specification, "-o", tmp_path, "--workers", "1"]
    run = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    waited = time.monotonic() + 120
    while not list(tmp_path.glob("office_robot_00.h5.*part")):
        assert time.monotonic() < waited and run.poll() is None
        time.sleep(0.005)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert (tmp_path / "office_cart_00.h5").exists() and not (tmp_path / "office_robot_00.h5").exists()
    stamp = (tmp_path / "office_cart_00.h5").stat().st_mtime_ns
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "1 recordings made, 1 were there" in done.stdout and "office_robot_00: 0." in done.stdout
    assert (tmp_path / "office_cart_00.h5").stat().st_mtime_ns == stamp
    assert (tmp_path / INDEX).read_bytes() and not differences(tmp_path, undisturbed)


def test_a_ray_cluster_makes_the_same_bytes(cluster, specification, undisturbed, tmp_path):
    seen = []
    outcome = make(
        Specification.load(specification), tmp_path, ray=cluster, progress=lambda *p: seen.append(p), say=lambda _: None
    )
    assert sorted(outcome.made) == ["office_cart_00", "office_robot_00"] and seen[-1] == (30, 30)
    assert (tmp_path / INDEX).read_bytes() and not differences(tmp_path, undisturbed)


def test_ray_begins_the_task_of_a_killed_worker_again(cluster, tmp_path):
    """And names the one that no worker survives."""
    tasks = fake("a", "killed once"), fake("b"), fake("x", "fails")
    outcome = make(FakeSpecification(*tasks), tmp_path, ray=cluster, say=lambda _: None)
    assert sorted(outcome.made) == ["a", "b"] and outcome.failed == {"x": "x: no room to move"}
    assert (tmp_path / "a.tried").exists()
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 4
    assert not list(tmp_path.glob("*.part"))


def test_a_cluster_that_is_not_there(tmp_path, specification):
    code = (
        "import sys\nfrom radarsim.cli import main\n"
        f"sys.argv = ['radarsim', 'dataset', {str(specification)!r}, '-o', {str(tmp_path)!r}, '--ray', '127.0.0.1:9']\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 2 and "--ray 127.0.0.1:9: no cluster answers" in done.stderr
    assert "Traceback" not in done.stderr and "stopped" not in done.stdout


def test_a_building_without_room_is_named(tmp_path):
    scene = tmp_path / "cell.yaml"
    scene.write_text("objects:\n  - {name: floor, shape: box, size: [1, 1, 0.1], material: concrete}\n")
    path = tmp_path / "spec.yaml"
    path.write_text(yaml.safe_dump(PLAIN | {"buildings": {"office": "cell.yaml"}}))
    task = Specification.load(path).tasks[0]
    with pytest.raises(InputError, match="office_cart_00: scene cell, platform cart: no room to move"):
        task.make(tmp_path)
