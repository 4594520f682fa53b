"""Inputs of compiled loops are finite and bounded."""

import numpy as np
import pytest
from pydantic import ValidationError

from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.io.tum import read_tum
from radarize.odometry.inertial import Imu
from radarize.pipeline.log import Log
from radarize.radar.presets import PRESETS
from radarize.slam.backend import Slam
from radarize.slam.config import GridConfig, SlamConfig

AHEAD = np.zeros(3)


@pytest.mark.parametrize("increment", [1e308, 1e300, 1e7, -1e7, np.finfo(float).max])
def test_angles_of_a_log(tmp_path, increment):
    """Without the check, 1e308 would index a grid out of bounds."""
    fields = {"angle_min": -1.0, "angle_increment": increment, "range_max": 10.0}
    np.savez(tmp_path / "a.npz", ranges=np.ones((6, 40)), **fields)
    with pytest.raises(InputError, match="azimuth .* expected within"):
        Log.read(tmp_path / "a.npz").feed(Slam())


@pytest.mark.parametrize("worst", [np.nan, np.inf, 1e300, 1e7])
def test_odometry(worst):
    slam = Slam()
    for pose in np.diag([worst] * 3):
        with pytest.raises(InputError, match="odometry at 0: pose is"):
            slam.add_odometry(0, pose)
    with pytest.raises(InputError, match="covariance is"):
        slam.add_odometry(0, AHEAD, np.diag([1.0, 1.0, worst * worst]))


def test_a_walk_to_the_farthest_that_is_allowed():
    """The map is rejected before its memory is allocated."""
    slam = Slam(SlamConfig(grid=GridConfig(min_range=0.1)))
    azimuths = np.linspace(-2, 2, 90)
    with pytest.raises(InputError, match="a map of .* would be needed"):
        for k in range(12):
            slam.add_odometry(k, np.array([1e6 * (-1) ** k, 1e6, 0.0]))
            slam.add_scan(k, azimuths, np.full(90, 3.0))
        slam.finish()
        slam.map()


@pytest.mark.parametrize(
    "row", ["1e300 0 0 0 0 0 0 1", "0 1e300 0 0 0 0 0 1", "0 0 0 -1e7 0 0 0 1", "nan 0 0 0 0 0 0 1"]
)
def test_poses_of_a_file(tmp_path, row):
    (tmp_path / "a.tum").write_text(row + "\n")
    with pytest.raises(InputError, match="line 1: holds .* expected finite numbers"):
        read_tum(tmp_path / "a.tum")


@pytest.mark.parametrize(
    "change",
    [
        {"slope": 1e300}, {"slope": 1e-300}, {"start_frequency": 1e300}, {"loops": 10**9}, {"samples": 10**9},
        {"frame_period": 1e300}, {"channel_calibration": ((1e300, 0.0),) * 12}, {"range_bias": 1e300},
    ],
)  # fmt: skip
def test_configurations(change):
    with pytest.raises(ValidationError):
        type(PRESETS["radarize"])(**{**PRESETS["radarize"].model_dump(), **change})


@pytest.mark.parametrize(
    "change", [{"resolution": 1e-9}, {"max_range": 1e300}, {"nodes": 10**9}, {"min_range": np.inf}]
)
def test_settings(change):
    with pytest.raises(ValidationError):
        GridConfig(**change)


def recording(path, times, imu=None):
    config = PRESETS["radarize"].model_copy(update={"samples": 32, "loops": 2})
    streams, rows = {}, {}
    if imu is not None:
        shapes = {"time": (), "accelerometer": (3,), "gyroscope": (3,)}
        streams = {f"imu/{name}": Stream(shape, "f8", "", "", "imu/time") for name, shape in shapes.items()}
        rows = {f"imu/{name}": value for name, value in imu.items()}
    with RecordingWriter(path, config, streams=streams) as writer:
        writer.append(np.ones((len(times), *config.frame_shape), np.int16), np.array(times), rows=rows)
    return path


@pytest.mark.parametrize("times", [[0.0, 0.0], [1.0, 0.0], [0.0, 1e300]])
def test_stamps(tmp_path, times):
    with Recording(recording(tmp_path / "a.h5", times)) as found:
        assert (np.diff(found.times) > 0).all() and np.abs(found.times).max() < 1e11
        assert "of 2 stamps in /radar/time are damaged" in found.damage[0]


@pytest.mark.parametrize(("force", "end", "why"), [(1e300, 1.0, "beyond|within"), (9.8, 1e10, "one every")])
def test_imus(tmp_path, force, end, why):
    time = np.append(np.linspace(0, 0.5, 100), end)
    imu = {"time": time, "accelerometer": np.full((101, 3), force), "gyroscope": np.zeros((101, 3))}
    with Recording(recording(tmp_path / "a.h5", [0.0, end], imu)) as opened:
        with pytest.raises(InputError, match=why):
            Imu.of(opened)
