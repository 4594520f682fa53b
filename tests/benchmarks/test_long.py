"""Short versions of the long trials: a session of seconds over a network with losses, a quarter of an hour of SLAM, one
kill."""

import numpy as np

from benchmarks import kills, soak
from radarize.radar.presets import PRESETS
from tests.virtual import record


def test_a_session_over_a_network_with_losses_onto_a_disk_that_fills(tmp_path, monkeypatch):
    for name, value in {"WALK": 1.0, "FULL_EVERY": 1.2, "FULL_FOR": 0.4}.items():
        monkeypatch.setattr(soak, name, value)
    row, warnings = soak.live(0.05, tmp_path, seed=0)
    assert row["exit code"] == 0 and row["forged packets"] > 10
    assert row["lost but not marked, or marked but not lost"] == row["chirps with a wrong sample"] == 0
    assert row["chirps lost"] > 0 and "their chirps are marked" in warnings
    assert row["times the disk was full"] > 0 and "since the disk was full" in warnings


def test_a_quarter_of_an_hour_of_slam():
    row = soak.day(0.25, seed=0)
    assert row["frames"] == 4500 and 50 < row["nodes kept"] < 150
    assert row["position error, m"] < 0.15
    assert row["MB at the end"] - row["MB after warm-up"] < 10


def test_a_killed_run_and_a_killed_capture(tmp_path, monkeypatch):
    monkeypatch.setattr(kills, "LIVES", (2.0, 3.0))
    noise = tmp_path / "noise.h5"
    record(noise, PRESETS["radarize"], 12)
    methods = ["--odometry", "doppler", "--scans", "first-echo"]
    case = kills.Case(["radarize.cli", "run", noise, "-o", "{out}/run", *methods], "run/*.[tp][ug]m")
    made = kills.killed("run", case, 1, tmp_path, np.random.default_rng(0))
    assert made["kills"] == 1 <= made["completed"] and made["files"] == 3 * made["completed"]
    assert made["files that differ"] == made["largest exit code"] == 0
    row = kills.captures(1, tmp_path, np.random.default_rng(0))
    assert row["frames that differ"] == 0 and row["lost, max, s"] < 3.0
