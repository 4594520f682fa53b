"""Recordings of pictures go through the pipeline, to reports and to viewers."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.baselines.pictures.scans import on_bearings
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import make_scans
from radarize.pipeline.run import run
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from radarize.signal.batch import Batch, Signal
from radarize.signal.bearings import BEARINGS

RADAR = PRESETS["radarhd"]


def test_scans_from_pictures_are_those_from_the_samples_they_are_made_of():
    rng = np.random.default_rng(3)
    samples = rng.integers(-300, 300, (6, *RADAR.frame_shape), dtype=np.int16)
    stamps = 0.05 * np.arange(6)
    pictures = polar.pictures(samples, RADAR, polar.MEASURED)
    signal = Signal(RADAR)
    by_samples = make_scans(Inputs(RADAR), "pictures").extract(Batch(signal, samples, stamps))
    shown = Batch(signal, None, stamps, maps={"picture": pictures})
    by_pictures = make_scans(Inputs(RADAR), "pictures").extract(shown)
    assert np.isfinite(by_samples).any()
    np.testing.assert_array_equal(by_pictures, by_samples)


def test_bearings_take_the_column_beside_them():
    columns = np.arange(128.0)[None]
    found = on_bearings(columns, BEARINGS)[0]
    exact = (np.degrees(BEARINGS) + 90) / (180 / 127)
    assert np.abs(found - exact).max() <= 0.5 and (np.diff(found) >= 0).all()


def test_pictures_tell_power():
    """A grey of 255 is the strongest cell, and of 1 about 26 dB below it, which is the least that pictures keep."""
    shown = polar.power(np.array([[[255, 128, 1, 0]]], np.uint8))[0, 0]
    np.testing.assert_allclose(10 * np.log10(shown[:3]), 26.02 * (np.array([255, 128, 1]) / 255 - 1), atol=0.01)
    assert shown[3] == 0


def test_a_real_walk_goes_through_the_pipeline(recordings, tmp_path):
    """The first three seconds of walk 227, from pictures to report; left is left."""
    clone, poses = recordings / "radarhd" / "pictures", recordings / "radarhd" / "poses" / "227.tum"
    walk = import_recording(clone, tmp_path / "227.h5", Given(walk=227, poses=poses))
    folder = RunFolder(run(walk, tmp_path / "run").path)
    facts = json.loads((tmp_path / "run" / "run.json").read_text())
    assert facts["methods"] == {"odometry": "pictures", "scans": "pictures"} and facts["frames_lost"] == 0
    scans, lidar = folder.scans["ranges"], folder.scans["truth/scan"]
    column = np.abs(folder.scans["truth/scan_azimuths"][:, None] - BEARINGS).argmin(axis=0)
    assert (np.isfinite(scans) & np.isfinite(lidar[:, column])).mean() > 0.5
    off, mirrored = (np.nanmedian(np.abs(scans - lidar[:, side])) for side in (column, column[::-1]))
    assert off < mirrored and off < 1.0
    assert folder.scans["heatmaps/range_azimuth"].shape == (6, 256, 64)
    with Recording(walk) as recording:
        shown = recording.rows(polar.PICTURE, 0, 1)[0]
    assert np.array_equal(folder.scans["heatmaps/range_azimuth"][0] > 0, shown > 0)
    for words in (
        ["evaluate", "run"], ["report", "run"], ["report", "227.h5"], ["info", "227.h5"],
        ["view", "227.h5", "--run", "run", "--save", "227.rrd"],
        ["view", "227.h5", "--run", "run", "--save", "227.mcap"],
    ):  # fmt: skip
        done = CliRunner().invoke(app, [str(tmp_path / w) if w[0] in "r2" and w != "report" else w for w in words])
        assert done.exit_code == 0, (words, done.output, done.exception)
    assert "Pictures of three frames" in (tmp_path / "227.html").read_text()
    assert all((tmp_path / f"227.{kind}").stat().st_size > 30_000 for kind in ("rrd", "mcap"))


@pytest.fixture
def pictured(tmp_path):
    """A recording of six empty pictures."""
    streams = {polar.PICTURE: Stream((polar.ROWS, polar.COLUMNS), "u1", "", "")}
    with RecordingWriter(tmp_path / "p.h5", RADAR, streams=streams, raw=False) as writer:
        writer.append(None, 0.05 * np.arange(6), rows={polar.PICTURE: np.zeros((6, polar.ROWS, polar.COLUMNS))})
    return tmp_path / "p.h5"


def test_what_needs_samples_says_so(pictured, tmp_path):
    for what, name, wanted in (("odometry", "fused", "pictures"), ("scans", "first-echo", "pictures")):
        words = f"has no raw samples, which {what} {name} needs, expected {what} {wanted}"
        with pytest.raises(InputError, match=words):
            run(pictured, tmp_path / "r", **{what: name})
    assert not (tmp_path / "r").exists()


def test_pictures_without_anything(pictured, tmp_path):
    """Nothing seen is a result, too, and it says so."""
    run(pictured, tmp_path / "r")
    folder = RunFolder(tmp_path / "r")
    assert folder.unobservable_spans.share_of_way == 0 or folder.warnings
    assert len(folder.trajectory[0]) == 6
