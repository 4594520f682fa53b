"""Faults put into a simulated walk, one after the other: found, named, and corrected where they can be."""

import json

import numpy as np
import pytest
import yaml

import radarize as rz
from benchmarks.faults import (
    FAULTS,
    Walk,
    alternating_iq,
    exchanged_iq,
    fired_otherwise,
    interleaved,
    loops_inside,
    mirrored,
    offset_binary,
    receivers,
    reversed_,
    swapped_bytes,
    transmitters,
    two_seconds_again,
)
from radarize.cli import app
from radarize.io.console import run as run_app
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.odometry.inertial import Imu
from radarize.pipeline.check.check import check, check_evidence, warnings_before
from radarize.pipeline.check.correction import write_corrected
from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.faults import TESTS
from radarize.pipeline.check.finding import Correction, Finding
from radarize.radar.boards import load_board
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Five seconds through a bare office, handheld, with an IMU."""
    bare = Scene.of({"building": {"kind": "office", "seed": 7}, "clutter": 1, "unevenness": 1}, "office")
    return simulate(bare, tmp_path_factory.mktemp("check") / "walk.h5", duration=5.0, seed=4, sensors=["imu"])


@pytest.fixture(scope="module")
def whole(path):
    with Recording(path) as r:
        return Walk(r.config, r.adc(0, len(r)), r.times, r.valid(0, len(r)), r.truth, Imu.of(r))


def write(walk, path):
    with RecordingWriter(path, walk.config) as writer:
        writer.append(walk.adc, walk.times, walk.valid)
    return path


def harmed(walk, harm):
    return harm(walk, np.random.default_rng(3))


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_named(whole, name):
    fault = FAULTS[name]
    if (walk := harmed(whole, fault.harm)) is None:
        pytest.skip("not a fault of this board")
    found = check_evidence(walk.evidence)
    kinds = {each.kind for each in found.findings}
    if name == "azimuth mirrored; radar alone":
        assert not kinds and "azimuth mirrored" in found.not_observable
    else:
        assert kinds == ({fault.kind} if fault.kind else set()), found


def test_each_kind_is_put_in_somewhere():
    kinds = {kind for test in TESTS for kind in test.kinds}
    assert kinds - {fault.kind for fault in FAULTS.values()} <= {"transmitter copied"}


def test_a_finding_has_measurement_and_remedy(whole):
    (found,) = check_evidence(harmed(whole, exchanged_iq).evidence).findings
    assert found.sure > 0.9 and "dB stronger" in found.measured and "--iq-order iiqq" in found.remedy


def test_a_standing_radar_is_not_judged_by_its_motion(whole):
    still = whole.of(np.zeros(40, int), stamped=False)
    found = check_evidence(harmed(still, FAULTS["radar at rest"].harm).evidence)
    assert [each.kind for each in found.findings] == ["no motion"]
    assert {"transmitter order", "chirp parameters", "frames reversed"} <= {*found.not_observable}


@pytest.mark.parametrize(
    "harm",
    [
        exchanged_iq, offset_binary, swapped_bytes, interleaved, alternating_iq, loops_inside, fired_otherwise,
        transmitters(0, 2, 1), transmitters(2, 0, 1), receivers(1, 0, 2, 3), receivers(2, 0, 3, 1), reversed_,
    ],
)  # fmt: skip
def test_fix_gives_the_samples_back(whole, harm, tmp_path):
    """Samples, configuration and stamps are restored byte by byte, and the corrected recording has no finding."""
    source = write(harmed(whole, harm), tmp_path / "wrong.h5")
    assert not check(source, tmp_path / "right.h5").well
    with Recording(tmp_path / "right.h5") as right:
        np.testing.assert_array_equal(right.adc(0, len(right)), whole.adc)
        assert right.config == whole.config
        np.testing.assert_allclose(right.times, whole.times)
        assert "corrected by radarize check" in str(right.attributes["warnings"])
    assert check(tmp_path / "right.h5").well


def test_repeated_frames_are_left_out(whole, tmp_path):
    source = write(harmed(whole, two_seconds_again), tmp_path / "wrong.h5")
    check(source, tmp_path / "right.h5")
    with Recording(tmp_path / "right.h5") as right:
        kept = np.searchsorted(whole.times, right.times - 1e-6)
        assert len(right) == len(whole.times) - 60
        np.testing.assert_array_equal(right.adc(0, len(right)), whole.adc[kept])


def test_streams_come_along(path, whole, tmp_path):
    """IMU and poses are unchanged; rows of frames move with their frames."""
    with Recording(path) as source:
        correction = Correction(order=np.arange(len(source))[::-1], keeps_stamps=True)
        write_corrected(source[:], (Finding("x", "y", 1.0, "z", correction),), tmp_path / "right.h5")
        with Recording(tmp_path / "right.h5") as right:
            np.testing.assert_array_equal(right.read("imu/gyroscope"), source.read("imu/gyroscope"))
            assert {*right.names()} == {*source.names()} - {n for n in source.names() if n.startswith("points/")}
            for name in ("truth/pose", "truth/velocity", "radar/adc"):
                np.testing.assert_array_equal(right.read(name), source.read(name)[::-1])
            for name in ("truth/time", "radar/time"):
                offset = right.read(name) - right.times
                np.testing.assert_allclose(offset, (source.read(name) - source.times)[::-1], atol=1e-9)


def test_the_right_board_is_written(whole, tmp_path):
    """Left and right are exchanged in a board file, which an IMU shows; the corrected file has them in order."""
    from radarize.pipeline.check.correction import _write_board

    wrong = harmed(whole, mirrored)
    (found,) = check_evidence(wrong.evidence).findings
    corrected = wrong.evidence.corrected(found.correction)
    with Recording(write(wrong, tmp_path / "wrong.h5")) as recording:
        _write_board(recording[:], corrected, tmp_path / "board.yaml")
    board = load_board(tmp_path / "board.yaml")
    assert board.tx == load_board(whole.config.board).tx and board.rx == load_board(whole.config.board).rx
    assert yaml.safe_load((tmp_path / "board.yaml").read_text())["chip"] == "iwr1843"


def test_nothing_to_correct_is_reported(path, tmp_path):
    with pytest.raises(InputError, match="no fault was found"):
        check(path, tmp_path / "right.h5")
    assert not list(tmp_path.iterdir())


def called(*words):
    with pytest.raises(SystemExit) as stopped:
        run_app(app, "radarize", [str(word) for word in words])
    return stopped.value.code


def test_the_command(path, whole, tmp_path, capsys):
    assert called("check", path) == 0
    assert "no fault found" in capsys.readouterr().out
    wrong = write(harmed(whole, transmitters(0, 2, 1)), tmp_path / "wrong.h5")
    assert called("check", wrong, "--json", "--fix", tmp_path / "right.h5") == 1
    printed = json.loads(capsys.readouterr().out)
    assert [each["kind"] for each in printed["findings"]] == ["transmitter order"] and not printed["well"]
    assert "azimuth mirrored" in printed["not_observable"]
    assert called("check", tmp_path / "right.h5") == 0
    assert called("check", tmp_path / "missing.h5") == 2


def test_run_warns_and_does_not_change(whole, tmp_path, capsys):
    part = whole.of(np.arange(60, 120))
    wrong = write(harmed(part, exchanged_iq), tmp_path / "wrong.h5")
    assert called("run", wrong, "-o", tmp_path / "run", "--odometry", "doppler", "--scans", "first-echo") == 0
    printed = capsys.readouterr().err
    assert printed.count("I and Q: leakage at negative range") == 1
    assert any("I and Q" in words for words in rz.Run(tmp_path / "run").warnings)
    with Recording(wrong) as recording:
        assert warnings_before(recording[::2]) == warnings_before(recording[:])


def test_run_warns_of_what_all_frames_show(whole, tmp_path):
    part = whole.of(np.array([*range(60, 90), *[90] * 20]), stamped=False)
    run = rz.run(write(part, tmp_path / "wrong.h5"), tmp_path / "run", odometry="doppler", scans="first-echo")
    assert any(words.startswith("frames frozen: 19 of 50") for words in run.warnings)
    np.testing.assert_allclose(np.diff(run.odometry.time), part.config.frame_period)


def test_live_warns_after_the_first_seconds(whole, tmp_path):
    wrong = write(harmed(whole, exchanged_iq), tmp_path / "wrong.h5")
    session = rz.live(replay=wrong, odometry="doppler", scans="first-echo")
    assert len(list(session)) > 100
    assert sum("I and Q" in words for words in session.warnings) == 1


def test_frames_of_any_number_are_checked(whole):
    for count in (1, 2, 7, 25):
        found = check_evidence(whole.of(np.arange(60, 60 + count)).evidence)
        assert found.well, found


def test_lost_frames_are_no_frozen_ones(whole):
    adc, valid = whole.adc.copy(), whole.valid.copy()
    adc[40:60], valid[40:60] = 0, False
    found = check_evidence(Evidence(whole.config, whole.times, valid, lambda a, b: adc[a:b]))
    assert [each.kind for each in found.findings] == ["chirps lost"]


def test_public_captures(recordings, tmp_path):
    """One frame each, of radars at rest: the only finding allowed is that the radar does not move."""
    from tests.io.importers.public import captures

    for capture in captures(recordings, tmp_path).values():
        assert {each.kind for each in check(capture).findings} <= {"no motion"}
