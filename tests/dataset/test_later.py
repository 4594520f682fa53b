"""Sensors that a data set's specification asks for later."""

import numpy as np
import pytest
import yaml

from radarize.errors import InputError
from radarize.recording import Recording
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification

PLAIN = {
    "name": "tiny",
    "seed": 1,
    "buildings": {"office": {"kind": "office", "seed": 3}},
    "recordings": [{"building": "office", "platform": "cart", "count": 1, "duration": 0.3}],
    "storage": "heatmaps",
}


def specification(folder, **changes):
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(PLAIN | changes))
    return Specification.load(path)


def test_sensors_beside_the_radar_are_added_to_what_is_there(tmp_path):
    """With the values that they would have had from the start; the radar is not simulated anew."""
    (tmp_path / "at_once").mkdir()
    specification(tmp_path, sensors=["occupancy", "imu"]).tasks[0].make(tmp_path / "at_once")
    make(specification(tmp_path, sensors=["occupancy"]), tmp_path / "later", workers=1)
    path = tmp_path / "later" / "office_cart_00.h5"
    with Recording(path) as before:
        maps = before.read("maps/range_azimuth")
    with_imu = specification(tmp_path, sensors=["occupancy", "imu"])
    assert make(with_imu, tmp_path / "later", workers=1).made == ["office_cart_00"]
    with Recording(path) as later, Recording(tmp_path / "at_once" / path.name) as at_once:
        assert sorted(later.names()) == sorted(at_once.names())
        for name in later.names():
            assert np.array_equal(later.read(name), at_once.read(name), equal_nan=True)
            assert later.describe(name) == at_once.describe(name)
        assert later.attributes["task"] == at_once.attributes["task"]
        assert np.array_equal(later.read("maps/range_azimuth"), maps)
        assert len(later.rows("imu/time", 0, 1)) == len(at_once.rows("imu/time", 0, 1)) > 0
    assert make(with_imu, tmp_path / "later", workers=1).kept == ["office_cart_00"]
    with pytest.raises(InputError, match="has sensors .*; --replace makes such recordings anew"):
        make(specification(tmp_path, sensors=["imu"]), tmp_path / "later", workers=1)  # another file
