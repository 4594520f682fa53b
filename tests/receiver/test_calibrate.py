"""Calibration recovers the settings of a simulated radar, and gives plausible ones for real radars."""

import numpy as np
import pytest

from benchmarks.references.rigs import Rig, polar
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter
from radarize.radar.presets import PRESETS
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.calibrate import calibrate
from radarsim.receiver.frontend import FrontEnd
from radarsim.receiver.frontend_config import Band, FrontEndConfig, Leakage, Mismatch, MountEcho
from radarsim.receiver.synthesis import Synthesizer
from radarsim.recording.simulate import simulate
from tests.io.importers import public

CONFIG = PRESETS["radarize"]


def record(path, settings, board, config=CONFIG, velocity=(0, 0, 0), targets=((2.6, 12, 3), (3.4, -22, 0))):
    """Frames of two reflectors in weak clutter, with a given board."""
    rng = np.random.default_rng(4)
    place = [polar(*t) for t in targets] + [polar(r, a) for r, a in rng.uniform((1, -50), (4, 50), (200, 2))]
    sigma = np.array([0.3, 0.3][: len(targets)] + [1e-6] * 200)
    scatterers = Scatterers.points(np.array(place), sigma, rng.uniform(0, 2 * np.pi, len(place)))
    front, rig = FrontEnd(config, settings, np.random.default_rng(board)), Rig(velocity=velocity)
    finder, synthesize = PathFinder(None, scatterers, None, config), Synthesizer(config)
    with RecordingWriter(path, config) as writer:
        for k in range(4):
            time = k * config.frame_period
            middle = np.array([time + config.burst_center])
            echoes = finder(rig.position(middle)[0], np.eye(3))
            lengths = echoes.lengths(config, rig, time)
            signal = synthesize(lengths, echoes.amplitude * front.if_response(lengths[:, 0, 0]))
            writer.append(front.digitize(signal, rng)[None], np.array([time]))
    return front


def without_slope(channel):
    """A channel's errors as far as they are observable: no slope of the phase over the array, mean gain 1."""
    phase = np.angle(channel).ravel()
    across = np.array([[0, 1, 2, 3], [2, 3, 4, 5], [4, 5, 6, 7]]).ravel()
    up = np.array([0, 0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 0])
    slopes = np.stack([np.ones(12), across, up], axis=1)
    phase = phase - slopes @ np.linalg.lstsq(slopes, phase, rcond=None)[0]
    gain = 20 * np.log10(np.abs(channel)).ravel()
    return gain - gain.mean(), np.rad2deg(phase)


@pytest.mark.parametrize("distance", [0.15, 0.25, 0.35])
def test_the_mount_is_found(tmp_path, distance):
    """Distance within 1 cm, amplitudes of all channels within 20 %, and leakage level as without a mount."""
    settings = FrontEndConfig.of(CONFIG.board, mount=[MountEcho(distance=distance, level_db=-65)])
    front = record(tmp_path / "real.h5", settings, 1)
    found = calibrate(tmp_path / "real.h5", tmp_path / "board.yaml").settings
    assert found.leakage.level_db == pytest.approx(-42, abs=1)
    assert found.mount[0].distance == pytest.approx(distance, abs=0.01)
    error = FrontEnd(CONFIG, found).mount[0] - front.mount[0]
    assert np.linalg.norm(error) < 0.2 * np.linalg.norm(front.mount[0])


def test_leakage_alone_is_no_mount(tmp_path):
    settings = FrontEndConfig.of(CONFIG.board, mount=None, leakage=Leakage(level_db=-40, delay=0.7e-9))
    record(tmp_path / "real.h5", settings, 1)
    assert calibrate(tmp_path / "real.h5", tmp_path / "board.yaml").settings.mount is None


@pytest.mark.parametrize(("board", "velocity"), [(1, (0, 0, 0)), (2, (0.7, -0.2, 0))])
def test_a_known_board_is_found(tmp_path, board, velocity):
    """Full scale within 0.3 dB, leakage 1 dB and 0.1 ns, band edge 2 %, channels 0.1 dB and 1 deg."""
    settings = FrontEndConfig.of(
        CONFIG.board, full_scale_dbm=2.0, band=Band(flat=0.85, high=1.15), leakage=Leakage(level_db=-40, delay=0.7e-9),
        mismatch=Mismatch(gain_db=2.0, phase_deg=20.0),
    )  # fmt: skip
    front = record(tmp_path / "real.h5", settings, board, velocity=velocity)
    found = calibrate(tmp_path / "real.h5", tmp_path / "board.yaml").settings
    assert found == FrontEndConfig.load(tmp_path / "board.yaml", CONFIG.board)
    assert found.full_scale_dbm == pytest.approx(2.0, abs=0.3)
    assert found.leakage.level_db == pytest.approx(-40, abs=1)
    assert found.leakage.delay == pytest.approx(0.7e-9, abs=0.1e-9)
    # half the amplitude is passed here
    assert (found.band.flat + found.band.high) / 2 == pytest.approx(1.0, abs=0.02)
    measured = FrontEnd(CONFIG, found).channel
    for got, true, tolerance in zip(without_slope(measured), without_slope(front.channel), (0.1, 1.0), strict=True):
        assert got == pytest.approx(true, abs=tolerance)
    # the leakage's phases, channel by channel
    turn = FrontEnd(CONFIG, found).leakage / front.leakage
    assert np.rad2deg(np.angle(turn / turn.mean())) == pytest.approx(np.zeros((3, 4)), abs=10)


def test_a_quiet_board_has_no_leakage(tmp_path):
    record(
        tmp_path / "real.h5",
        FrontEndConfig.of(CONFIG.board, leakage=None, mount=None, full_scale_dbm=8.0),
        3,
        targets=(),
    )
    found = calibrate(tmp_path / "real.h5", tmp_path / "board.yaml")
    assert found.settings.leakage is None and found.settings.mount is None
    assert found.settings.mismatch == Mismatch()  # unobservable here
    assert found.settings.full_scale_dbm == pytest.approx(8.0, abs=0.3)


def test_one_channel(tmp_path):
    config = CONFIG.model_copy(update={"tx_order": (1,), "rx": (2,)})
    record(tmp_path / "real.h5", FrontEndConfig.of(CONFIG.board), 1, config)
    found = calibrate(tmp_path / "real.h5", tmp_path / "board.yaml")
    assert found.settings.full_scale_dbm == pytest.approx(5.0, abs=0.3)
    assert "1 channels: mismatch left" in " ".join(found.remarks)


def test_unusable_recordings_are_refused_in_a_sentence(tmp_path):
    small = CONFIG.model_copy(update={"loops": 4})
    silent = np.zeros((1, *CONFIG.frame_shape), np.int16)
    for name, config, frames, words in (
        ("few", small, silent[:, :4], "has 4 loops a frame, expected at least 8"),
        ("empty", CONFIG, silent[:0], "has no whole frame"),
        ("silent", CONFIG, silent, "expected more than the rounding"),
    ):
        with RecordingWriter(tmp_path / f"{name}.h5", config) as writer:
            writer.append(frames, np.zeros(len(frames)))
        with pytest.raises(InputError, match=words):
            calibrate(tmp_path / f"{name}.h5", tmp_path / "out.yaml")
    assert not (tmp_path / "out.yaml").exists()


def test_a_mount_explains_what_the_leakage_leaves(captures, tmp_path):
    """Static power within 0.4 m of real boards: the front end leaves 1 dB, or 10, less of it unexplained."""
    for name, path in captures.items():
        settings = calibrate(path, tmp_path / f"{name}.yaml").settings
        with Recording(path) as recording:
            config, adc = recording.config, recording.adc(0, 1).astype(np.float32)
        n = config.samples
        bins = np.arange(int(0.4 / config.range_resolution) + 2)
        low = np.exp(-2j * np.pi * np.outer(np.arange(n), bins) / n) * np.hanning(n)[:, None]
        offset = low.sum(axis=0)
        left = []
        for mount in (settings.mount, None):
            front = FrontEnd(config, settings.model_copy(update={"mount": mount}))
            rest = (adc.view(np.complex64)[..., 0].mean(axis=(0, 1)) - front._coupled) @ low
            rest -= (rest @ offset.conj() / np.vdot(offset, offset))[..., None] * offset
            left.append(np.sum(np.abs(rest) ** 2))
        assert left[0] < left[1] / (10 if len(config.rx) > 1 else 1.2), name


@pytest.fixture
def captures(recordings, tmp_path):
    """Public captures as recordings."""
    return public.captures(recordings, tmp_path)


def test_real_captures_give_boards_that_sound_like_them(captures, tmp_path):
    """A simulation without echoes, with its own front-end file, has the noise floor and leakage of the real capture."""
    for name, path in captures.items():
        found = calibrate(path, tmp_path / f"{name}.yaml")
        assert -25 < found.settings.full_scale_dbm < 25, name
        with Recording(path) as recording:
            config = recording.config
            adc = recording.adc(0, 1).astype(np.float32)
        front = FrontEnd(config, FrontEndConfig.load(tmp_path / f"{name}.yaml", config.board))
        silence = np.zeros(config.frame_shape[:-1], np.complex64)
        again = front.digitize(silence, np.random.default_rng(0)).astype(np.float32)[None]
        levels = []
        for samples in (adc, again):
            signal = samples.view(np.complex64)[..., 0]
            n = config.samples
            fast = np.fft.fft(signal * np.hanning(n), axis=-1)
            moving = np.diff(fast, axis=1)[..., n // 2 : 3 * n // 4]  # what changes from chirp to chirp
            levels.append(np.median(np.abs(moving) ** 2))
        assert 10 * np.log10(levels[1] / levels[0]) == pytest.approx(0, abs=1.5), name


def test_simulate_takes_the_file(tmp_path):
    """From a recording to a front-end file to a recording that calibrates to the same file."""
    settings = FrontEndConfig.of(CONFIG.board, full_scale_dbm=0.0, leakage=Leakage(level_db=-38))
    settings.save(tmp_path / "made.yaml")
    first = simulate("office", tmp_path / "a.h5", duration=0.1, seed=2, frontend=tmp_path / "made.yaml")
    found = calibrate(first, tmp_path / "found.yaml").settings
    assert found.full_scale_dbm == pytest.approx(0.0, abs=0.5)
    simulate("physics/room", tmp_path / "b.h5", duration=0.1, seed=2, frontend=tmp_path / "found.yaml")
