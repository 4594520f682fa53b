"""Simulated recordings of a data set: contents, common properties of variants, refusals."""

import numpy as np
import pytest

from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.signal.maps import MAPS
from radarsim.cli import app
from radarsim.motion.walk import Walk
from radarsim.world.scene import Scene
from tests.dataset import hall


def test_a_recording_holds_what_was_asked_for(tmp_path):
    (task,) = hall.specification(tmp_path, sensors=["occupancy", "imu"], storage="heatmaps").tasks
    task.make(tmp_path)
    with Recording(tmp_path / "hall_cart_00.h5") as recording:
        assert len(recording) == 6 and recording.attributes["platform"] == "cart"
        for name in ("truth/pose", "truth/scan", "truth/occupancy", "imu/gyroscope", *(f"maps/{m}" for m in MAPS)):
            assert recording.has(name)
        assert not recording.has("radar/adc") and not recording.has("truth/depth")


def test_variants_of_a_recording_share_its_walk(tmp_path):
    """The crate of level 1 would change the plan of a walk, and heights are the same for all variants."""
    slow = {"radar": {"frame_period": 0.25}}
    variants = {
        "mild": slow,
        "severe": slow | {"level": 1, "attributes": {"severity": 1}},
        "coarse": {"radar": {"samples": 48, "frame_period": 0.75}, "frontend": {"noise": False}},
        "low": slow | {"mounting": [0.2, 0, -0.5, 0, 0, 0]},
        "high": slow | {"mounting": [0.2, 0, 0.1, 0, 0, 0]},
    }
    walks = {"recordings": hall.recordings(duration=2), "attributes": {"stress": "hall", "severity": 0}}
    seen = {}
    for task in hall.specification(tmp_path, variants=variants, **walks).tasks:
        task.make(tmp_path)
        assert task.is_finished(tmp_path)
        with Recording(task.path(tmp_path)) as recording:
            seen[task.name.split("_")[-1]] = (
                recording.read("truth/pose"), recording.adc(0, 2), recording.config, recording.attributes
            )  # fmt: skip
    poses = {name: pose for name, (pose, *_) in seen.items()}
    np.testing.assert_array_equal(poses["severe"], poses["mild"])
    walk = Walk("cart", 2.0, waypoints=np.array(hall.WAY))
    own = walk.through(Scene.load(f"{tmp_path / 'hall.yaml'}@1"), task.seed)
    assert np.abs(own.position(np.array([1.75])) - poses["mild"][-1, :3]).max() > 0.05
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
    (task,) = hall.specification(tmp_path, recordings=hall.recordings(duration=4, way=[[1, 2], [1.2, 2]])).tasks
    with pytest.raises(InputError, match="hall_cart_00: the way-points are reached after .* of 8 frames"):
        task.make(tmp_path)
    assert not list(tmp_path.glob("*.h5*"))


def test_a_cluster_that_is_not_there(tmp_path, capsys):
    words = ["dataset", hall.write(tmp_path), "-o", tmp_path / "out", "--ray", "127.0.0.1:9"]
    with pytest.raises(SystemExit) as exit_:
        run(app, "radarsim", [*map(str, words)])
    out, err = capsys.readouterr()
    assert exit_.value.code == 2 and "--ray 127.0.0.1:9: no cluster answers" in err
    assert "Traceback" not in err and "stopped" not in out


def test_a_building_without_room_is_named(tmp_path):
    (tmp_path / "cell.yaml").write_text(
        "objects:\n  - {name: floor, shape: box, size: [1, 1, 0.1], material: concrete}\n"
    )
    tour = {"building": "hall", "platform": "cart", "count": 1, "duration": 1.0}
    (task,) = hall.specification(tmp_path, buildings={"hall": "cell.yaml"}, recordings=[tour]).tasks
    with pytest.raises(InputError, match="hall_cart_00: scene cell, platform cart: no room to move"):
        task.make(tmp_path)
