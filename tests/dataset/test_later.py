"""Sensors added to a data set's specification later."""

import numpy as np
import pytest

from radarize.io.recording import Recording
from radarsim.dataset.task import Stale
from tests.dataset import hall


def test_sensors_beside_the_radar_are_added_to_what_is_there(tmp_path):
    """They have the values that they would have had from the start; the radar is not simulated again."""
    (tmp_path / "at_once").mkdir()
    fixed = {"storage": "heatmaps", "recordings": hall.recordings(duration=1.0)}
    bare, both, other = (
        hall.specification(tmp_path, sensors=sensors, **fixed).tasks[0]
        for sensors in (["occupancy"], ["occupancy", "imu"], ["imu"])
    )
    both.make(tmp_path / "at_once")
    bare.make(tmp_path)
    path = bare.path(tmp_path)
    with Recording(path) as before:
        maps = before.read("maps/range_azimuth")
    assert bare.is_finished(tmp_path) and not both.is_finished(tmp_path)
    both.make(tmp_path)
    with Recording(path) as later, Recording(tmp_path / "at_once" / path.name) as at_once:
        assert sorted(later.names()) == sorted(at_once.names())
        for name in later.names():
            assert np.array_equal(later.read(name), at_once.read(name), equal_nan=True)
            assert later.describe(name) == at_once.describe(name)
        assert later.attributes["task"] == at_once.attributes["task"]
        assert np.array_equal(later.read("maps/range_azimuth"), maps)
        assert len(later.rows("imu/time", 0, 1)) == len(at_once.rows("imu/time", 0, 1)) > 0
    assert both.is_finished(tmp_path)
    with pytest.raises(Stale, match="has sensors "):
        other.is_finished(tmp_path)  # another file
