"""Evaluation of whole runs in a room with known errors."""

import json

import h5py
import numpy as np
import pytest

from radarize.evaluation.evaluate import evaluate
from radarize.evaluation.mapping import distance_to_plan, segment_points
from radarize.io.errors import InputError
from radarize.pipeline.runfolder import OccupancyMap, RunFolder
from radarize.pipeline.runfolder.occupancy import read_pgm
from tests.evaluation.fake_run import PLAN, write_run


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run") / "walk")


def test_metrics_of_a_known_run(run):
    metrics = evaluate(run)
    assert not (run / "metrics.json").exists()
    RunFolder(run).write_metrics(metrics)
    assert json.loads((run / "metrics.json").read_text()) == metrics
    # The trajectory wanders by centimetres; the odometry is 4 % too long and turns by 0.12 rad too much.
    assert metrics["slam"]["ate"]["position"]["mean"] < 0.05
    assert metrics["odometry"]["ate"]["rotation"]["mean"] == pytest.approx(0.03, abs=0.03)
    assert metrics["odometry"]["re"]["second"]["rotation"]["mean"] == pytest.approx(0.006, rel=1e-3)
    # Over a metre: a position error of 4 cm along the path, and a lateral one by the heading error at that time.
    expected = np.mean(np.hypot(0.04, 0.006 * np.arange(0, 20, 0.1)))
    assert metrics["odometry"]["re"]["metre"]["position"]["mean"] == pytest.approx(expected, rel=0.1)
    # 30 % of the bearings are missing, the rest has 3 cm noise along the beam: erf(10 / 3 / sqrt(2)) within 10 cm.
    assert metrics["scans"]["within_10cm"] == pytest.approx(0.999, abs=0.004)
    assert metrics["scans"]["returned"] == pytest.approx(0.7, abs=0.02)
    assert metrics["scans"]["median"] == pytest.approx(0.6745 * 0.03, rel=0.1)
    # Noise of 0.02 and 0.05 m/s with its true covariance.
    assert metrics["velocity"]["forward"] == pytest.approx(0.02, rel=0.15)
    assert metrics["velocity"]["left"] == pytest.approx(0.05, rel=0.15)
    assert metrics["velocity"]["nees"] == pytest.approx(1, rel=0.25)
    # The map was drawn from the plan, in a turned frame: it fits if rows, origin and alignment are right.
    assert metrics["map"]["precision"] > 0.99
    assert metrics["map"]["recall"] > 0.95
    assert metrics["map"]["chamfer"] < 0.05


def test_a_mirrored_map_does_not_fit(run, tmp_path):
    flipped = write_run(tmp_path / "flipped")
    grid = OccupancyMap.read(flipped / "map.yaml")
    height, width = grid.pixels.shape
    (flipped / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + grid.pixels[::-1].tobytes())
    assert evaluate(flipped)["map"]["f1"] < 0.5


def test_an_empty_map_scores_nothing(tmp_path):
    empty = write_run(tmp_path / "empty")
    pixels = read_pgm(empty / "map.pgm")
    height, width = pixels.shape
    (empty / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % (width, height) + np.full_like(pixels, 205).tobytes())
    metrics = evaluate(empty)["map"]
    assert metrics["recall"] == 0 and metrics["precision"] is None


def test_cells_lie_where_map_server_puts_them(tmp_path):
    pixels = np.full((3, 4), 254, np.uint8)
    pixels[2, 0] = 0  # lower left
    pixels[0, 3] = 0  # upper right
    (tmp_path / "map.pgm").write_bytes(b"P5 4 3 255\n" + pixels.tobytes())
    (tmp_path / "map.yaml").write_text("image: map.pgm\nresolution: 0.5\norigin: [10, 20, 0]\nnegate: 0\n")
    grid = OccupancyMap.read(tmp_path / "map.yaml")
    np.testing.assert_allclose(sorted(grid.centers(grid.occupied).tolist()), [[10.25, 20.25], [11.75, 21.25]])
    assert grid.free.sum() == 10


def test_plan_distances_against_brute_force():
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 9, (50, 2))
    dense = segment_points(PLAN, 0.001)
    brute = np.linalg.norm(points[:, None] - dense[None], axis=-1).min(axis=1)
    np.testing.assert_allclose(distance_to_plan(points, PLAN), brute, atol=1e-3)
    perimeter = np.linalg.norm(PLAN[:, 2:] - PLAN[:, :2], axis=1).sum()
    assert len(segment_points(PLAN, 0.02)) * 0.02 == pytest.approx(perimeter, rel=1e-3)


def test_another_reference(run, tmp_path):
    other = write_run(tmp_path / "other", truth=False)
    with pytest.raises(InputError, match="reference.tum: no such file.*--reference"):
        evaluate(other)
    metrics = evaluate(other, run / "reference.tum")
    assert metrics["slam"]["matched"] == 300 and "map" not in metrics


def test_bad_runs_are_one_sentence(tmp_path):
    with pytest.raises(InputError, match="has no trajectory.tum"):
        evaluate(tmp_path)
    broken = write_run(tmp_path / "broken")
    (broken / "map.pgm").write_bytes((broken / "map.pgm").read_bytes()[:-7])
    with pytest.raises(InputError, match="map.pgm: holds .* pixels, expected"):
        evaluate(broken)
    (broken / "map.yaml").write_text("resolution: x\n")
    with pytest.raises(InputError, match="map.yaml"):
        evaluate(broken)
    with h5py.File(broken / "scans.h5", "a") as file:
        del file["azimuths"]
    with pytest.raises(InputError, match="scans.h5: has no /azimuths"):
        evaluate(broken)
    (broken / "trajectory.tum").write_text("0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n")
    with pytest.raises(InputError, match="trajectory.tum, line 2"):
        evaluate(broken)
