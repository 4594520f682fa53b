"""One short walk that all tests of the Python functions share."""

from pathlib import Path

import numpy as np
import pytest

import radarize as rz
import radarsim
from radarize.io.tum import planar_poses, write_tum

#: m/s, along x.
SPEED = 0.5


@pytest.fixture(scope="package")
def walk(tmp_path_factory) -> Path:
    """Recording ``walk.h5`` of 24 frames of uniform motion in a small room, beside its run ``RUN``."""
    folder = tmp_path_factory.mktemp("face")
    times = np.arange(0, 0.9, 0.02)
    poses = planar_poses(np.column_stack([1 + SPEED * times, np.full_like(times, 1.0), np.zeros_like(times)]))
    poses[:, 2] = 1.2
    way = write_tum(folder / "way.tum", times, poses)
    recording = radarsim.simulate("stress/corner", folder / "walk.h5", trajectory=way, duration=0.8, seed=3)
    rz.run(recording, folder / "RUN", odometry="doppler", scans="first-echo")
    return folder / "walk.h5"


@pytest.fixture
def rec(walk) -> rz.Recording:
    return rz.load(walk)
