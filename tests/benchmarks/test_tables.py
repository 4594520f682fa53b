"""Metrics of the benchmarks' tables on simulated recordings."""

from pathlib import Path

import numpy as np
import pytest

from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.frame_errors import FrameErrors
from radarize.evaluation.benchmark.runs import figures
from radarize.evaluation.motion import velocity_errors
from radarize.pipeline.run import run
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """A second of the bare office, which has a short start-up time, with path types."""
    bare = Scene.of({"building": {"kind": "office", "seed": 7}, "clutter": 0, "unevenness": 0}, "office")
    path = tmp_path_factory.mktemp("data") / "office.h5"
    return simulate(bare, path, duration=1.0, seed=4, sensors=["ghosts"])


@pytest.fixture(scope="module")
def judged(recording, tmp_path_factory) -> tuple[Path, dict]:
    """A run, and its metrics."""
    folder = run(recording, tmp_path_factory.mktemp("run"), odometry="doppler", scans="first-echo").path
    return folder, figures(folder, recording)


def test_scene_and_path_length_of_a_recording(recording, judged):
    (case,) = DataSet.load(recording.parent).cases
    assert (case.path, case.building, case.platform) == (recording, "office", "handheld")
    assert (case.walk.scene, case.walk.seed, case.walk.simulated) == ("office", 4, True)
    assert case.walk.metres == pytest.approx(judged[1]["odometry"]["distance"], rel=0.05)


def test_frame_errors_agree_with_the_metrics(judged):
    folder, found = judged
    frames = FrameErrors.read(folder)
    velocity = velocity_errors(frames.velocity, frames.true_velocity, frames.covariance)
    assert velocity["rmse"] == pytest.approx(found["velocity"]["rmse"], rel=1e-5)
    # Errors of single steps and of windows of eight frames belong to the same path.
    steps, _ = frames.yaw_errors(0)
    assert len(steps) == len(frames.velocity) - 1
    path = np.cumsum([0, *steps])
    windows, variance = frames.yaw_errors(8 * frames.period)
    np.testing.assert_allclose(windows, path[8:] - path[:-8], atol=1e-6)
    at_once = frames.errors.motions(frames.poses, np.arange(len(variance)), 8)[:, 2, 2]
    np.testing.assert_allclose(variance, at_once, rtol=1e-6)
    assert found["quantiles"]["odometry"][-1] == pytest.approx(found["odometry"]["ate"]["position"]["max"], abs=1e-4)


def test_both_associations_agree_if_every_pose_has_a_true_one(judged):
    _, found = judged
    for name in ("odometry", "slam"):
        nearest = found["nearest"][name]["ate"]["position"]["mean"]
        assert nearest == pytest.approx(found[name]["ate"]["position"]["mean"], rel=1e-3)
    assert found["nearest"]["open"]["matched"] == found["slam"]["matched"]


def test_wrong_returns_have_a_path_type(judged):
    _, found = judged
    wrong = 1 - found["scans"]["within_10cm"]
    assert 0.05 < wrong < 0.6
    assert sum(found["sources"].values()) == pytest.approx(wrong, abs=1e-6)
    assert found["sources"]["ghosts"] < 0.1
