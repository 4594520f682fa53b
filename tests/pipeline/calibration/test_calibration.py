"""Calibration compared with a brute-force reference: a board with known errors passes points."""

import subprocess
import sys

import numpy as np
import pytest
import yaml

import radarize as rz
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.pipeline.calibration.channels import centred
from radarize.radar.boards import load_board
from radarize.radar.cfg import parse_cfg
from radarize.radar.config import RadarConfig
from tests.echoes import record
from tests.pipeline.calibration.conftest import CONFIG, LEVER, YAW, errors, ride, spoil


@pytest.fixture(scope="module")
def found(spoiled):
    return rz.calibrate(spoiled.recording)


def test_channels_are_found_by_walking(spoiled, found):
    """Includes slopes of the phase along the array, which plane waves alone do not determine."""
    leftover = (found.config.calibration * spoiled.factors).ravel()
    assert np.degrees(centred(leftover).std()) < 1.5
    assert (20 * np.log10(np.abs(leftover))).std() < 0.1
    # What is shown is the board's error, not its correction.
    shown = np.exp(1j * found.phases.ravel()) / np.exp(1j * np.angle(spoiled.factors.ravel()))
    assert np.degrees(centred(shown).std()) < 1.5
    assert np.corrcoef(found.gains.ravel(), 20 * np.log10(np.abs(spoiled.factors.ravel())))[0, 1] > 0.99


def test_the_range_bias_is_found_by_parallax(spoiled, found):
    bias = found.values["range_bias"]
    assert abs(spoiled.bias) > 0.05
    assert bias.value == pytest.approx(spoiled.bias, abs=0.02) and bias.error < 0.02
    assert found.config.range_bias == pytest.approx(bias.value, abs=1e-4)


def test_the_mounting_is_found(found):
    values = found.values
    assert values["yaw"].value == pytest.approx(YAW, abs=np.radians(1.0))
    assert values["lever_arm"].value == pytest.approx(LEVER, abs=0.05)
    assert values["azimuth_scale"].value == pytest.approx(1, abs=0.005)


def test_a_boards_file_takes_the_errors_off(spoiled, found, tmp_path):
    written = found.save(tmp_path / "board.yaml")
    board = load_board(written)
    assert board.calibration == found.board.calibration and board.mounting == found.board.mounting
    with rz.load(spoiled.recording.path, board=str(written)) as again:
        assert again.config.range_bias == board.range_bias
        np.testing.assert_allclose(again.config.calibration, found.config.calibration)
        # The configuration that a recording keeps carries all of it, without the file.
        written.unlink()
        kept = RadarConfig.model_validate_json(again.config.model_dump_json())
        assert kept == again.config and kept.range_bias == board.range_bias
    # Calibrating a calibrated recording starts from the samples again.
    assert yaml.safe_load(found.save(tmp_path / "again.yaml").read_text())["range_bias"] == board.range_bias


def test_a_cfg_holds_factors_that_the_firmware_takes(found, tmp_path):
    """Factors are 16-bit fractions: none exceeds 1, and ratios are kept."""
    text = found.save(tmp_path / "radar.cfg").read_text()
    config = parse_cfg(text)
    assert np.abs(config.channel_factors).max() == pytest.approx(1, abs=1e-5)
    ratio = config.channel_factors / found.config.channel_factors
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-3)
    assert config.range_bias == found.config.range_bias
    assert "compRangeBiasAndRxChanPhase" in text and "% Board:iwr1843boost" in text


def test_odometry_with_the_board(spoiled, found, tmp_path):
    """Velocities with the calibration are correct, in both directions."""
    board = found.save(tmp_path / "board.yaml")
    off = []
    for given in (None, str(board)):
        with rz.load(spoiled.recording.path, board=given) as opened:
            seen = rz.odometry(opened[:150], method="doppler")
        _, yaw = ride(seen.time)
        speed = (ride(seen.time + 0.01)[0] - ride(seen.time - 0.01)[0]) / 0.02
        forward = np.cos(yaw) * speed[:, 0] + np.sin(yaw) * speed[:, 1]
        left = np.cos(yaw) * speed[:, 1] - np.sin(yaw) * speed[:, 0]
        off.append(np.median(np.abs(seen.velocity - np.stack([forward, left], axis=1))[10:], axis=0))
    assert (off[1] < 0.02).all() and off[1].sum() < 0.8 * off[0].sum()


@pytest.mark.parametrize("distance", [2.0, 1.3])
def test_a_corner_reflector(tmp_path, distance):
    factors, bias = errors(7)
    rng = np.random.default_rng(0)
    middle = 3.5 * 299_792_458.0 / 77e9 / 4

    def still(times):
        times = np.asarray(times)
        return np.zeros((*times.shape, 3)), np.zeros(times.shape)

    stamps = np.arange(8) * CONFIG.frame_period
    adc = record(CONFIG, still, np.array([[distance, middle, 0.0]]), np.array([3000.0]), stamps, rng, noise=5.0)
    path = tmp_path / "corner.h5"
    with RecordingWriter(path, CONFIG) as writer:
        writer.append(spoil(adc, CONFIG, factors, bias), stamps)
    found = rz.calibrate(path, target=distance)
    leftover = (found.config.calibration * factors).ravel()
    assert np.degrees(centred(leftover).std()) < 0.1  # the wave is a sphere: 0.6 deg at 1.3 m
    assert (20 * np.log10(np.abs(leftover))).std() < 0.02
    assert found.values["range_bias"].value == pytest.approx(bias, abs=0.005)
    with pytest.raises(InputError, match="no strong echo is within 0.5 m of 3.6 m"):
        rz.calibrate(path, target=3.6)
    with pytest.raises(InputError, match=r"--target is 9 m, expected between 0.3 and 4.28 m"):
        rz.calibrate(path, target=9.0)


def test_too_short_a_walk_shows_nothing(spoiled):
    with pytest.raises(InputError, match="expected a walk of about 20 s"):
        rz.calibrate(spoiled.recording[:20])
    with Recording(spoiled.recording.path) as opened, pytest.raises(InputError, match="move|no strong echo"):
        rz.calibrate(opened, target=2.0)


def test_every_second_frame(spoiled):
    """With half the frame rate, tracks and turns are those of the frames used."""
    found = rz.calibrate(spoiled.recording[::2])
    leftover = (found.config.calibration * spoiled.factors).ravel()
    assert np.degrees(centred(leftover).std()) < 2
    assert found.values["lever_arm"].value == pytest.approx(LEVER, abs=0.06)
    assert abs(found.values["range_bias"].value - spoiled.bias) < max(0.03, 2 * found.values["range_bias"].error)


def test_another_output_is_refused(found, tmp_path):
    with pytest.raises(InputError, match="expected a board file"):
        found.save(tmp_path / "board.txt")


def test_what_trains_reads_recordings_with_the_board(spoiled, found, tmp_path, monkeypatch):
    """All processes that read recordings use the calibrated board."""
    written = found.save(tmp_path / "board.yaml")
    monkeypatch.setenv("RADARIZE_BOARD", str(written))
    with Recording(spoiled.recording.path) as opened:
        np.testing.assert_allclose(opened.config.calibration, found.config.calibration)
        assert opened.config.range_bias == found.config.range_bias


def test_commands(spoiled, tmp_path):
    """One command writes the file that another reads; an unusable recording ends in one sentence and exit code 2."""

    def radarize(*arguments: object) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "radarize.cli", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True)

    board, recording = tmp_path / "board.yaml", spoiled.recording.path
    done = radarize("calibrate", recording, "-o", board)
    assert not done.returncode, done.stderr
    assert "TX3 RX4" in done.stdout and "range bias" in done.stdout and load_board(board).calibration
    run = tmp_path / "run"
    methods = "--odometry", "doppler", "--scans", "first-echo"
    done = radarize("run", recording, "-o", run, *methods, "--board", board, "--every", 4)
    assert not done.returncode, done.stderr
    done = radarize("calibrate", recording, "-o", tmp_path / "x.yaml", "--target", 2)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()[-1]) < 300
    assert not (tmp_path / "x.yaml").exists()
    done = radarize("run", recording, "-o", run, "--board", tmp_path / "none.yaml")
    assert done.returncode == 2 and "none.yaml" in done.stderr
