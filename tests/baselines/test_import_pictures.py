"""Walks of RadarHD's repository, as a user's clone lays them out."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from radarize.baselines.walks.walks import Walk
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.pose import between
from radarize.io.recording import Recording
from radarize.io.tum import planar, read_tum, write_tum
from radarize.signal import polar
from tests.baselines.twoclocks import MadeUp


@pytest.fixture
def clone(tmp_path) -> Path:
    """A data set with a walk of twenty made-up frames: an echo that comes nearer, a wall at 3 m."""
    folder = tmp_path / "dataset_5" / "test"
    for kind in ("radar", "lidar"):
        (folder / kind).mkdir(parents=True)
    for k in range(20):
        radar, lidar = np.zeros((256, 64), np.uint8), np.zeros((256, 512), np.uint8)
        radar[100 - k, 30:40], lidar[71, 100:400] = 255, 255
        Image.fromarray(radar).save(folder / f"radar/R_7_{k}.png")
        Image.fromarray(lidar).save(folder / f"lidar/L_7_{k}.png")
    return tmp_path / "dataset_5"


def test_a_walk_becomes_a_recording(clone, tmp_path):
    write_tum(tmp_path / "poses.tum", 0.05 * np.arange(20), np.tile([0.1, 0, 0, 0, 0, 0, 1.0], (20, 1)))
    arguments = [
        "import",
        str(clone),
        "--walk",
        "7",
        "-o",
        str(tmp_path / "7.h5"),
        "--poses",
        str(tmp_path / "poses.tum"),
    ]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.exception
    with Recording(tmp_path / "7.h5") as recording:
        assert len(recording) == 20 and recording.config.samples == 512
        pictures = recording.rows("maps/picture", 0, 20)
        assert [int(p[:, 35].argmax()) for p in pictures] == [100 - k for k in range(20)]
        scan, bearings = recording.read("truth/scan"), recording.read("truth/scan_azimuths")
        assert np.isfinite(scan[0]).sum() == 300 and scan[0, 200] == pytest.approx(71 * 10.8 / 255)
        assert bearings[0] == pytest.approx(-np.pi / 2) and bearings[-1] > 0  # left is positive
        assert np.array_equal(np.unpackbits(recording.read("truth/lidar")[0], axis=1).nonzero()[0], np.full(300, 71))
        assert recording.has("truth/pose")
        with pytest.raises(InputError, match="no raw samples"):
            recording.adc(0, 1)


def test_a_real_walk(recordings, tmp_path):
    """The first frames of walk 227."""
    output = import_recording(recordings / "radarhd" / "pictures", tmp_path / "227.h5", Given(walk=227))
    with Recording(output) as recording:
        assert len(recording) == 60 and "no poses were given" in recording.attributes["found"]
        moved = recording.read("truth/pose")
        picture = recording.rows("maps/picture", 0, 60).astype(float)
        scan = recording.read("truth/scan")
    # Poses by the lidar's scans are those by ICP of its pictures, which were made with another program.
    known = planar(read_tum(recordings / "radarhd" / "poses" / "227.tum")[1][:60])
    apart = between(known[:1], known) - between(planar(moved)[:1], planar(moved))
    assert np.hypot(*apart[:, :2].T).max() < 0.1 and np.abs(apart[:, 2]).max() < np.radians(2.0)
    assert 0.02 < (picture > 0).mean() < 0.2 and picture.max() == 255
    assert 0.3 < (picture[:, 6:] > 0).any(axis=1).mean() and not picture[:, :6].any()  # within 70 deg, beyond leakage
    assert 0.3 < np.isfinite(scan).mean() and 0.5 < np.median(scan[np.isfinite(scan)]) < 6


def test_pictures_of_one_number_that_are_not_of_one_instant(tmp_path):
    """There is a warning; with --align, the truth is matched by time, and frames without a lidar picture are left
    out."""
    walk = MadeUp(tmp_path / "clone", 7, 320, first=-30.0, rate=1.08)
    walk.write(walk.folder)
    times = 0.05 * np.arange(320)
    write_tum(tmp_path / "poses.tum", times, np.tile([0.1, 0, 0, 0, 0, 0, 1.0], (320, 1)))
    given = Given(walk=7, poses=tmp_path / "poses.tum")
    with Recording(import_recording(walk.folder, tmp_path / "7.h5", given)) as recording:
        assert "up to 1.5 s apart" in recording.attributes["warnings"]
        assert len(recording) == 320 and recording.read("truth/time") == pytest.approx(times)
    aligned = import_recording(walk.folder, tmp_path / "7.h5", replace(given, align=True))
    with Recording(aligned) as recording:
        assert "warnings" not in recording.attributes and "is the lidar's picture -" in recording.attributes["clock"]
        frames = np.rint(recording.read("radar/time") / 0.05).astype(int)
        assert np.abs(frames[[0, -1]] - [28, 319]).max() <= 1 and np.array_equal(
            np.diff(frames), np.ones(len(frames) - 1)
        )
        assert np.array_equal(recording.rows("maps/picture", 9, 10)[0], walk.radar(frames[9]))
        seen = np.unpackbits(recording.read("truth/lidar"), axis=2).astype(bool)
        true = [walk.lidar(k) for k in range(320)]
        partner = [np.argmax([(each & one).sum() for one in true]) for each in seen[::40]]
        assert partner == pytest.approx(-30 + 1.08 * frames[::40], abs=2)
        # A pose of the lidar's frame 100 is of the radar's frame (100 + 30) / 1.08.
        assert recording.read("truth/time")[100] == pytest.approx(0.05 * 130 / 1.08, abs=0.1)


def test_clock_that_cannot_be_estimated(clone, tmp_path):
    """Twenty frames are too few: there is a warning, and pictures are matched by frame index as without --align."""
    with Recording(import_recording(clone, tmp_path / "7.h5", Given(walk=7, align=True))) as recording:
        assert "matched by frame index" in recording.attributes["warnings"] and "clock" not in recording.attributes
        assert len(recording) == 20


@pytest.mark.parametrize("spoil, words", [
    (lambda f: (f / "radar/R_7_3.png").unlink(), r"R_7_3\.png: is missing"),
    (lambda f: (f / "lidar/L_7_4.png").unlink(), r"L_7_4\.png: no such file"),
    (lambda f: os.truncate(f / "radar/R_7_5.png", 60), r"R_7_5\.png: is no readable PNG"),
    (lambda f: (f / "radar/R_7_6.png").write_text("none"), r"R_7_6\.png: is no readable PNG"),
    (lambda f: shutil.copy(f / "lidar/L_7_6.png", f / "radar/R_7_6.png"), r"is 256 x 512, expected 256 x 64"),
])  # fmt: skip
def test_missing_and_damaged_pictures(clone, tmp_path, spoil, words):
    spoil(clone / "test")
    with pytest.raises(InputError, match=words):
        import_recording(clone, tmp_path / "7.h5", Given(walk=7))


def test_which_walk(clone, tmp_path):
    for source, walk, words in (
        (clone, None, "--walk is missing"),
        (clone, 8, "has no walk 8"),
        (tmp_path, 7, "is no data set of RadarHD's walks, but walk is 7, expected none"),
    ):
        with pytest.raises(InputError, match=words):
            import_recording(source, tmp_path / "x.h5", Given(walk=walk))
    assert [walk.number for walk in Walk.tests(clone)] == [7]
    assert polar.cartesian(Walk.find(clone, 7).lidar(0)).shape[1] == 2
