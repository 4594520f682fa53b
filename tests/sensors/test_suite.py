"""Recordings with all sensors: documented, and whole after a crash."""

import json

import h5py
import numpy as np
import pytest

from radarize.evaluation.report.contents import contents
from radarize.evaluation.report.recording import report_recording
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarsim.recording.simulate import simulate
from radarsim.sensors.suite import SENSORS, chosen


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Less than half a second of the office with every sensor."""
    return simulate("office", tmp_path_factory.mktemp("all") / "walk.h5", duration=0.4, seed=2, sensors=["all"])


def test_everything_is_there_and_documented(walk):
    found = contents(walk)["data_sets"]
    for name in ("truth/depth", "truth/occupancy", "truth/cause_power", "truth/cause", "imu/accelerometer",
                 "imu/gyroscope", "tracking/pose", "points/cloud"):  # fmt: skip
        assert name in found
    for name, item in found.items():
        assert item["about"] and (item["unit"] or item["dtype"] in ("uint8", "int32", "bool")), name
    json.dumps(found)
    with Recording(walk) as recording:
        assert recording.read("truth/depth").shape == (12, 120, 212)
        assert len(recording.read("imu/time")) == len(recording.read("imu/gyroscope")) == 80
        assert np.ptp(recording.rows("imu/time", 10, 12)) < 2 * recording.config.frame_period
        numbers = recording.rows("points/frame", 5, 9)
        assert set(numbers) <= {5, 6, 7, 8}
        assert len(recording.rows("points/cloud", 5, 9)) == len(numbers)
        with pytest.raises(InputError, match="has no /truth/thermal; there are"):
            recording.rows("truth/thermal", 0, 1)
        with pytest.raises(InputError, match="written once"):
            recording.rows("truth/floor_plan", 0, 1)


def test_unknown_and_excluding_sensors_are_refused(tmp_path):
    with pytest.raises(InputError, match="'sonar' is unknown, expected all or some of depth,"):
        simulate("office", tmp_path / "a.h5", duration=0.1, sensors=["sonar"])
    with pytest.raises(InputError, match="depth and depth-strip"):
        chosen(["all", "depth-strip"])
    assert chosen(["imu", "imu", "depth-strip"]) == ["depth-strip", "imu"]
    assert set(chosen(["all"])) == set(SENSORS) - {"depth-strip", "adc-by-cause", "paths"}
    assert not (tmp_path / "a.h5").exists()


def test_a_crash_leaves_streams_that_end_with_the_last_whole_frame(walk, tmp_path):
    """The file as a reader finds it when the writer died after more rows had reached the disk than frames."""
    with Recording(walk) as source, h5py.File(walk) as file:
        names = [n for n in source.names() if "clock" in file[n].attrs and n.split("/")[0] != "radar"]
        streams = {
            n: Stream(file[n].shape[1:], file[n].dtype.str, file[n].attrs["unit"], file[n].attrs["about"],
                      file[n].attrs["clock"]) for n in names
        }  # fmt: skip
        writer = RecordingWriter(tmp_path / "b.h5", source.config, streams=streams)
        for start, stop in ((0, 4), (4, 8)):
            writer.append(
                source.adc(start, stop), source.times[start:stop], rows={n: source.rows(n, start, stop) for n in names}
            )
        writer.flush()
        writer.append(source.adc(8, 12), source.times[8:12], rows={n: source.rows(n, 8, 12) for n in names})
        writer._file.flush()  # rows are on the disk, the frames do not count yet
        for name in ("imu/time", "points/frame"):
            writer._file[name].resize(len(writer._file[name]) + 50, axis=0)  # made room for what never came
        with Recording(writer.part) as growing:
            assert len(growing) == 8
            for name in names:
                assert np.array_equal(growing.read(name), source.rows(name, 0, 8), equal_nan=True), name
        writer.close(keep_part=True)


def test_the_report_shows_them(walk, tmp_path):
    page = report_recording(walk, tmp_path / "walk.html").read_text()
    assert "Depth" in page and "Point cloud" in page and "IMU" in page
