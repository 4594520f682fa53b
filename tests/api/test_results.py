"""Results are plain arrays that show, convert and draw themselves; bad input is a sentence."""

from pathlib import Path

import h5py
import matplotlib
import numpy as np
import pytest
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import radarize as rz
import radarsim
from radarize.io.exporters import export
from radarize.io.recording import RecordingWriter
from radarize.io.tum import read_tum
from radarize.signal.heatmaps import Heatmaps
from tests.api.conftest import SPEED

PLAIN = {"odometry": "doppler", "scans": "first-echo"}


@pytest.fixture
def axes() -> Axes:
    return Figure().add_subplot()


# --- recordings ----------------------------------------------------------------------------------------------------
def test_frames_are_sliced_like_an_array(rec):
    assert len(rec) == 24 and len(rec[4:8]) == 4 and len(rec[::5]) == 5 and len(rec[2:20][3:5]) == 2
    assert list(rec[2:20][3:5].numbers) == [5, 6] and list(rec[-1].numbers) == [23] and not len(rec[8:4])
    some = rec[3:9:2]
    assert np.array_equal(some.samples, rec.adc(0, 9)[3:9:2]) and np.array_equal(some.times, rec.times[3:9:2])
    assert rec[::3].config.frame_period == pytest.approx(3 * rec.config.frame_period)
    assert rec[3:9].valid.shape == (6, *rec.config.frame_shape[:2])
    with pytest.raises(IndexError):
        rec[24]
    for step in (0, -1):
        with pytest.raises(rz.InputError, match=f"frames step by {step}, expected 1"):
            rec[::step]


def test_truth_of_a_part_is_the_part_of_the_truth(rec):
    truth = rec[6:12].truth
    assert len(truth) == 6 and truth.distance == pytest.approx(5 * SPEED * rec.config.frame_period, rel=0.01)
    assert truth.velocity[:, 0] == pytest.approx(SPEED, abs=0.01) and truth.floor_plan is not None


def test_a_capture_is_loaded_from_a_temporary_file(rec, walk, tmp_path):
    export(walk, "bin", tmp_path / "adc_data")
    again = rz.load(tmp_path / "adc_data.bin")
    assert np.array_equal(again[:].samples, rec[:].samples) and again.truth is None
    path = again.path
    del again
    assert not path.exists() and not path.parent.exists()
    kept = rz.load(tmp_path / "adc_data.bin", tmp_path / "kept.h5", start_time=3.0)
    assert kept.path == tmp_path / "kept.h5" and kept.times[0] == 3.0


# --- maps ----------------------------------------------------------------------------------------------------------
def test_maps_are_those_of_the_pipeline(rec):
    frames = rec[4:8]
    maps = Heatmaps(rec.config)
    for found, wanted, axis in (
        (rz.range_azimuth(frames), maps.range_azimuth(frames.samples), maps.ranges),
        (rz.range_azimuth(frames, method="capon"), maps.range_azimuth(frames.samples, method="capon"), maps.ranges),
        (rz.range_azimuth(frames, method="elevation-aware"), maps.elevation_aware(frames.samples), maps.ranges),
        (rz.doppler_azimuth(frames), maps.doppler_azimuth(frames.samples), maps.velocities),
        (rz.range_profile(frames), maps.range_profile(frames.samples), maps.ranges),
    ):
        np.testing.assert_allclose(found.values, wanted.numpy(), rtol=1e-5)
        assert np.array_equal(found[found.dims[1]], axis) and found.attrs["units"] == "counts^2"
        assert np.array_equal(found.time, frames.times) and found.frame.values.tolist() == [4, 5, 6, 7]
        np.testing.assert_allclose(found[2].values, wanted[2].numpy(), rtol=1e-5)
    assert rz.range_doppler(rec).sizes == {"frame": 24, "range": 96, "doppler": 32}
    assert rz.range_azimuth(rec[:0]).shape == (0, 96, 121)


def test_axes_are_metres_and_metres_a_second(rec):
    """A static echo at an azimuth closes at the radar's speed times the cosine of the azimuth."""
    power = rz.doppler_azimuth(rec).mean("frame")
    ahead = power.where((abs(power.doppler) > 0.2) & (abs(power.azimuth) < 0.9), drop=True)  # the leakage stands still
    speed = ahead.idxmax("doppler") / np.cos(ahead.azimuth)
    assert float(speed.median()) == pytest.approx(SPEED, abs=rec.config.velocity_resolution / 2)
    assert rz.range_profile(rec).range[-1] == pytest.approx(rec.config.ranges[-1] - rec.config.range_bias)


def test_points_know_their_frames(rec):
    several = rz.point_cloud(rec[4:7])
    assert {*several.frame} <= {4, 5, 6} and len(several)
    one = rz.point_cloud(rec[5])
    assert np.array_equal(several.points[several.frame == 5], one.points) and {*one.frame} == {5}
    table = several.to_pandas()
    assert np.array_equal(table[["x", "y", "z"]], several.xyz) and np.array_equal(table["snr"], several.snr)


# --- odometry, runs, evaluation --------------------------------------------------------------------------------------
def test_odometry_and_run_agree(rec):
    odometry, run = rz.odometry(rec, "doppler"), rz.run(rec, **PLAIN)
    for name in ("time", "planar", "covariance", "velocity", "velocity_covariance"):
        np.testing.assert_allclose(getattr(run.odometry, name), getattr(odometry, name), atol=1e-6)
    assert odometry.distance == pytest.approx(rec.truth.distance, rel=0.1)
    assert (np.linalg.eigvalsh(odometry.covariance[1:]) > 0).all() and not odometry.covariance[0].any()


def test_a_part_of_a_recording_runs_as_one(rec):
    """Truth belongs to the correct frames, also with every second frame."""
    part, half = rz.run(rec[8:], **PLAIN), rz.run(rec[1:20:2], **PLAIN)
    middle = rec.config.burst_center
    assert part.scans.time.values == pytest.approx(rec.times[8:] + middle)
    assert half.scans.time.values == pytest.approx(rec.times[1:20:2] + middle)
    assert half.methods["frames"] == "one of 2" and half.facts["frames"] == 19
    for run, numbers in ((part, slice(8, None)), (half, slice(1, 20, 2))):
        with h5py.File(run.path / "scans.h5") as file:
            assert np.array_equal(file["truth/velocity"], rec.read("truth/velocity")[numbers])
        assert rz.evaluate(run)["velocity"]["median"] < 0.1


def test_a_run_is_temporary_until_it_is_saved(rec, tmp_path):
    run = rz.run(rec, **PLAIN)
    temporary, trajectory = run.path, run.trajectory
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "metrics.json").write_text("{}")  # of another run
    run.save(tmp_path / "kept")
    del run
    assert not temporary.exists()
    kept = rz.Run(tmp_path / "kept")
    assert {each.name for each in kept.path.iterdir()} == {
        "trajectory.tum", "odometry.tum", "reference.tum", "map.pgm", "map.yaml", "scans.h5", "run.json",
    }  # fmt: skip
    assert np.array_equal(kept.trajectory.pose, trajectory.pose) and kept.map.occupied.any()
    assert kept.truth.distance == pytest.approx(rec.truth.distance) and not kept.warnings
    assert kept.save(tmp_path / "kept") == tmp_path / "kept"


def test_an_evaluation_is_a_mapping_and_tables(walk):
    folder = walk.parent / "RUN"
    found = rz.evaluate(folder)
    assert "ATE position, mean" in str(found) and "<table" in found._repr_html_()
    assert found.to_pandas()["odometry.distance"] == found["odometry"]["distance"]
    assert found.save() == folder / "metrics.json" and found.save().read_text() == found.to_json() + "\n"


def test_trajectories_convert(rec, tmp_path):
    truth = rec.truth
    times, poses = read_tum(truth.to_tum(tmp_path / "truth.tum"))
    assert times == pytest.approx(truth.time) and poses == pytest.approx(truth.pose, abs=1e-8)
    assert truth.to_evo().path_length == pytest.approx(truth.distance, rel=1e-3)
    table = truth.to_pandas()
    assert table.index.name == "time" and np.array_equal(table["x"], truth.pose[:, 0])
    assert np.array_equal(table["vx"], truth.velocity[:, 0])


# --- drawing -------------------------------------------------------------------------------------------------------
def test_everything_draws_on_given_axes(rec, walk):
    run = rz.Run(walk.parent / "RUN")
    results = (
        rz.range_azimuth(rec[4]), rz.range_azimuth(rec[4:5]), rz.doppler_azimuth(rec[4]), rz.range_doppler(rec[4]),
        rz.range_profile(rec[4]), rz.range_profile(rec), rz.point_cloud(rec[4]), rec, rec[4:9], rec.truth, run, run.map,
        run.odometry, run.scans, run.scans[3],
    )  # fmt: skip
    for what in results:
        given = Figure().add_subplot()
        assert rz.plot(what, given, title="title") is given and given.has_data() and given.get_title() == "title"
    given = run.plot(Figure().add_subplot(), truth=rec.truth)
    assert [text.get_text() for text in given.get_legend().get_texts()] == ["truth", "map", "odometry", "SLAM"]
    slam, truth = given.lines[-1].get_xydata(), rec.truth.pose[:, :2]
    assert np.hypot(*(slam - truth[: len(slam)]).T).max() < 0.1


def test_new_axes_are_pyplots(rec):
    with matplotlib.rc_context({"backend": "agg"}):
        import matplotlib.pyplot as plt

        axes = rz.plot(rec.truth)
        assert axes is plt.gca() and rz.plot(rec.truth) is not axes
        plt.close("all")


def test_notebooks_show_pictures_and_tables(rec, walk):
    run = rz.Run(walk.parent / "RUN")
    for each in (rec.truth, run.odometry, run, run.map, rz.point_cloud(rec[4])):
        assert each._repr_png_().startswith(b"\x89PNG") and repr(each)
    assert "power" in rz.range_azimuth(rec[4])._repr_html_()


# --- bad input -----------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda rec: rz.load("missing.h5"), "missing.h5: no such file"),
        (lambda rec: rz.load("missing.bin"), "missing.bin: no such file"),
        (lambda rec: rz.load(rec.path, config="radarize"), "is a recording, but config is given"),
        (lambda rec: rz.load(rec.path, "x.h5"), "is a recording, but output is given"),
        (lambda rec: rz.load("missing.bin", color="red"), "color is given, expected some of config"),
        (lambda rec: rz.load("missing.bin", rx="a,b"), "--rx is 'a,b', expected a count"),
        (lambda rec: rz.load("missing.bin", config="bogus"), "bogus: no such radar configuration"),
        (lambda rec: rz.range_azimuth(3), "3 is a int, expected a recording"),
        (lambda rec: rz.range_azimuth(rec, method="music"), "method is 'music', expected one of bartlett"),
        (lambda rec: rz.doppler_azimuth(rec, method=None), "method is None, expected one of bartlett"),
        (lambda rec: rz.point_cloud("missing.h5"), "missing.h5: no such file"),
        (lambda rec: rz.plot(3), "int cannot be drawn"),
        (lambda rec: rz.plot(rz.range_azimuth(rec[:2])), "axes are frame, range, azimuth, expected a map of one frame"),
        (lambda rec: rz.plot(rz.range_azimuth(rec[4])[0]), "axes are azimuth, expected a map of one frame, such as"),
        (lambda rec: rz.plot(rz.doppler_azimuth(rec[4])[0]), "axes are azimuth, expected a map of one frame"),
        (lambda rec: rz.plot(rz.range_doppler(rec[4])[0]), "axes are doppler, expected a map of one frame"),
        (lambda rec: rz.odometry(rec, "magic"), "odometry is 'magic', expected one of doppler"),
        (lambda rec: rz.odometry(rec[:0]), "has no whole frame"),
        (lambda rec: rz.run(rec, scans="magic"), "scans is 'magic', expected one of"),
        (lambda rec: rz.run(rec, settings="old"), "settings is 'old', expected corrected or published"),
        (lambda rec: rz.run(rec, config="no.yaml"), "no.yaml: no such file"),
        (lambda rec: rz.run(rec, "/dev/null/run"), "cannot be written"),
        (lambda rec: rz.Run("nowhere"), "has no trajectory.tum"),
        (lambda rec: rz.evaluate("nowhere"), "has no trajectory.tum"),
        (lambda rec: rz.evaluate(rec.path.parent / "RUN", reference="no.tum"), "no.tum: no such file"),
        (lambda rec: rz.live(), "--config is missing, expected a .cfg or a preset"),
        (lambda rec: rz.live("radarize", port="/dev/nowhere"), "no such serial port"),
        (lambda rec: rz.live(replay=rec.path, speed=2), "speed is given, expected some of weights, pipeline, baud"),
        (lambda rec: rz.torch_dataset("nowhere"), "nowhere: holds no recordings"),
        (lambda rec: rz.torch_dataset(rec.path.parent, features=["color"]), "fields names 'color'"),
        (lambda rec: radarsim.simulate("castle"), "castle"),
        (lambda rec: radarsim.simulate("office", sead=3), "sead is given, expected some of platform"),
        (lambda rec: radarsim.simulate("office", mounting="1 2"), "mounting is '1 2', expected six numbers"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(call, words, rec, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(rz.InputError) as error:
        call(rec)
    assert words in str(error.value) and "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


def test_what_has_no_samples_or_truth_says_so(rec, tmp_path, axes):
    with RecordingWriter(tmp_path / "bare.h5", rec.config) as writer:
        writer.append(rec[:4].samples, rec[:4].times)
    bare = rz.load(tmp_path / "bare.h5")
    assert bare.truth is None and bare[1:].truth is None
    with pytest.raises(rz.InputError, match="has no true poses to draw"):
        rz.plot(bare, axes)
    run = rz.run(bare, **PLAIN)
    assert run.truth is None and run.plot(axes) is axes
    with pytest.raises(rz.InputError, match="expected true poses"):
        rz.evaluate(run)


# --- live ----------------------------------------------------------------------------------------------------------
def test_live_frames_follow_the_radar(rec, walk, tmp_path):
    """Poses and maps arrive during the loop; leaving it keeps a complete recording and restores torch's threads."""
    threads, seen = torch.get_num_threads(), []
    for frame in rz.live(replay=walk, output=tmp_path / "kept.h5", every=1, **PLAIN):
        seen.append(frame)
        if frame.number == 15:
            break
    assert [frame.number for frame in seen] == list(range(16)) and torch.get_num_threads() == threads
    assert seen[-1].pose[0] == pytest.approx(15 * SPEED * rec.config.frame_period, abs=0.05)
    np.testing.assert_allclose(rz.range_azimuth(seen[9]), rz.range_azimuth(rec[9]), rtol=1e-4)
    assert rz.point_cloud(seen[9]).frame.tolist() == rz.point_cloud(rec[9]).frame.tolist()
    assert np.isfinite(seen[9].ranges).any() and seen[9].velocity[0] == pytest.approx(SPEED, abs=0.1)
    kept = rz.load(tmp_path / "kept.h5")
    assert len(kept) >= 16 and np.array_equal(kept[:16].samples, rec[:16].samples)
    assert not Path(f"{kept.path}.part").exists()
