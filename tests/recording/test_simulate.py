"""Whole simulated recordings: readable, and consistent with their ground truth."""

from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.presets import PRESETS
from radarsim.motion.planner import plan_motion
from radarsim.propagation.path_types import PathType
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.recording.simulate import simulate
from radarsim.sensors.by_path_type import PARTS
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A few frames of the office, handheld."""
    return simulate("office", tmp_path_factory.mktemp("sim") / "walk.h5", duration=0.17, seed=6)


def test_the_recording_describes_itself(walk):
    with Recording(walk) as recording:
        assert len(recording) == 5
        assert recording.attributes["scene"] == "office" and recording.attributes["seed"] == 6
        assert np.allclose(np.diff(recording.times), 33.333e-3)
        assert recording.valid(0, 5).all()
        time = recording.read("truth/time")
        assert np.allclose(time - recording.times, recording.config.burst_center)


def test_truth_is_consistent(walk):
    """Velocity is the derivative of position, in the sensor's frame."""
    with Recording(walk) as recording:
        time, pose, velocity = (recording.read(f"truth/{n}") for n in ("time", "pose", "velocity"))
    between = np.diff(pose[:, :3], axis=0) / np.diff(time)[:, None]
    turned = Rotation.from_quat(pose[:-1, 3:]).inv().apply(between)
    assert turned == pytest.approx((velocity[:-1, :3] + velocity[1:, :3]) / 2, abs=0.02)


def test_true_scan_meets_the_floor_plan(walk):
    """The ends of the true scan lie on the walls of the true plan."""
    with Recording(walk) as recording:
        pose, scan = recording.read("truth/pose")[0], recording.read("truth/scan")[0]
        azimuths, plan = recording.read("truth/scan_azimuths"), recording.read("truth/floor_plan")
    forward = Rotation.from_quat(pose[3:]).apply([1.0, 0, 0])
    bearing = np.arctan2(forward[1], forward[0]) + azimuths
    seen = np.isfinite(scan)
    ends = pose[:2] + scan[seen, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)[seen]
    start, end = plan[:, :2], plan[:, 2:]
    along = end - start
    share = np.clip(np.einsum("esd,sd->es", ends[:, None] - start, along) / np.sum(along**2, axis=1), 0, 1)
    distance = np.linalg.norm(ends[:, None] - start - share[..., None] * along, axis=2).min(axis=1)
    assert seen.any() and np.quantile(distance, 0.95) < 0.02


def test_causes_are_counted(walk):
    with Recording(walk) as recording:
        echoes, power = recording.read("truth/echoes"), recording.read("truth/echo_power")
    assert (echoes[:, 0] > 500).all() and (echoes[:, 2] > 20).any()
    assert (power[:, 0] > power[:, 2]).mean() > 0.9  # ghosts are the weaker echoes


def test_iq_by_cause_adds_up(tmp_path):
    """Without noise, phase noise and clipping, the parts' sum is the recording itself, to rounding."""
    settings = FrontEndConfig.of(PRESETS["radarize"].board, noise=False, phase_noise=None)
    settings.save(tmp_path / "quiet.yaml")
    path = simulate(
        "office", tmp_path / "x.h5", duration=0.05, seed=3, frontend=tmp_path / "quiet.yaml", sensors=["adc-by-cause"]
    )
    with Recording(path) as recording:
        parts = recording.read("truth/adc_by_cause").astype(np.float32)
        adc = recording.adc(0, len(recording)).astype(np.float32)
        about = recording.describe("truth/adc_by_cause")["about"]
        count = recording.read("truth/echoes")
    assert parts.shape == (len(adc), len(PARTS), *adc.shape[1:])
    assert all(p.name.lower() in about for p in PathType) and "leakage" in about
    inside = np.abs(adc).max(axis=-1, keepdims=True) < 32767
    error = (parts.sum(axis=1) - adc) * inside
    # half a count of rounding, and float16's 11 bits of each part
    assert np.sqrt(np.mean(error**2)) < 0.5
    assert np.abs(error).max() < 1 + 2**-10 * np.abs(parts).max()
    for k in range(len(PathType)):
        assert np.any(parts[:, k]) == np.any(count[:, k])


@pytest.mark.parametrize(("name", "size"), [("corridor", (40, 9.6)), ("floor", (50, 30))])
def test_large_scenes_can_be_walked(name, size):
    """The benchmark's buildings have their size, up to corners out of square, and a tour through them."""
    scene = Scene.load(name)
    assert np.ptp(scene.bounds, axis=0)[:2] == pytest.approx(size, rel=0.005)
    assert plan_motion(scene, "handheld", 5.0, np.random.default_rng(0)).duration == 5.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"duration": float("nan")}, "duration is nan"),
        ({"duration": 1e-3}, "at least one frame"),
        ({"platform": "drone"}, "drone"),
        ({"radar": "nothing.cfg"}, "nothing.cfg"),
        ({"frontend": Path("nowhere.yaml")}, "nowhere.yaml"),
        ({"scene": "nowhere"}, "nowhere"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(tmp_path, arguments, words):
    with pytest.raises(InputError) as caught:
        simulate(**{"scene": "office", "output": tmp_path / "x.h5", "duration": 1.0, **arguments})
    assert words in str(caught.value) and "\n" not in str(caught.value)
    assert not (tmp_path / "x.h5").exists()


def test_failures_of_another_process_are_reported(tmp_path):
    (tmp_path / "still.tum").write_text("".join(f"{t} 0 0 0 0 0 0 1\n" for t in range(5)))
    far = SceneObject("far", shapes.rectangle((90, 0, 0), (1, 1), (-1, 0, 0)), MATERIALS["metal"])
    with pytest.raises(InputError, match="scene away: no frame has an echo"):
        simulate(Scene("away", [far]), tmp_path / "x.h5", trajectory=tmp_path / "still.tum", duration=1.1, workers=2)
    assert not active_children() and not (tmp_path / "x.h5").exists()
