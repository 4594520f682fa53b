"""Sequences in roverd's layout: words, stamps, lost packets and poses against another reader; damaged sequences."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from xwr.rsp import iqiq_from_iiqq

from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from tests.io.importers.rover import CHIRPS, FRAMES, RADAR, chirps, write_sequence


@pytest.fixture
def sequence(tmp_path):
    return write_sequence(tmp_path / "walk")


def test_samples_are_those_that_another_reader_sees(sequence, tmp_path):
    """Import compared with the reader of the rig's authors."""
    with Recording(import_recording(sequence, tmp_path / "a.h5", Given())) as recording:
        words = np.fromfile(sequence / "radar/iq", "<i2").reshape(FRAMES, RADAR.loops, 3, 4, -1)
        assert np.array_equal(recording.adc(0, FRAMES), iqiq_from_iiqq(words))
        assert np.allclose(recording.times, 1.7e9 + 0.05 * np.arange(FRAMES))
        for name, value in RADAR.model_dump().items():
            if name not in ("board", "rx_gain_db", "high_pass", "channel_calibration", "tx_backoff_db", "range_bias"):
                assert getattr(recording.config, name) == pytest.approx(value), name
        lost = np.ones((FRAMES, RADAR.loops, 3), bool)
        lost[2, 1, 2] = False
        assert np.array_equal(recording.valid(0, FRAMES), lost)
        poses, times = recording.read("truth/pose")[:], recording.read("truth/time")[:]
        assert np.allclose(times, 1.7e9 + 0.025 * np.arange(10))
        assert np.allclose(poses[:, :3], np.arange(30.0).reshape(10, 3))
        assert Rotation.from_quat(poses[-1, 3:]).as_euler("zyx") == pytest.approx([1, 0, 0])


def test_a_sequence_without_configuration_has_the_chirps_of_its_resolutions(sequence, tmp_path):
    """Slope and idle time follow from range and Doppler resolution, given the sampling rate."""
    (sequence / "config.yaml").unlink()
    resolutions = {"range_resolution": RADAR.range_resolution, "doppler_resolution": RADAR.velocity_resolution}
    (sequence / "radar/radar.json").write_text(json.dumps(resolutions))
    with Recording(import_recording(sequence, tmp_path / "a.h5", Given())) as recording:
        assert recording.config.slope == pytest.approx(RADAR.slope, rel=1e-9)
        assert recording.config.range_resolution == pytest.approx(RADAR.range_resolution)
        assert recording.config.velocity_resolution == pytest.approx(RADAR.velocity_resolution, rel=1e-3)
        assert "resolution" not in recording.attributes["warnings"]
    (sequence / "radar/radar.json").write_text(json.dumps({"range_resolution": 2 * RADAR.range_resolution}))
    given = Given(overrides={"slope": RADAR.slope})
    with Recording(import_recording(sequence, tmp_path / "b.h5", given)) as recording:
        assert "range_resolution is" in recording.attributes["warnings"]


def test_times_of_the_configuration_are_whole(sequence, tmp_path):
    with Recording(import_recording(sequence, tmp_path / "a.h5", Given())) as recording:
        assert recording.config.idle_time == 20e-6 and recording.config.adc_start_time == 5e-6


def test_zeros_of_frames_that_are_whole_are_no_loss(sequence, tmp_path):
    np.ones(FRAMES, np.uint8).tofile(sequence / "radar/valid")
    with Recording(import_recording(sequence, tmp_path / "a.h5", Given())) as recording:
        assert recording.valid(0, FRAMES).all()


def test_a_sequence_that_ends_within_a_frame_has_its_whole_frames(sequence, tmp_path):
    data = (sequence / "radar/iq").read_bytes()
    (sequence / "radar/iq").write_bytes(data[: len(data) * 7 // (2 * FRAMES)])
    with Recording(import_recording(sequence, tmp_path / "a.h5", Given())) as recording:
        assert len(recording) == 3


def change_meta(folder, channel, **fields):
    path = folder / "radar/meta.json"
    about = json.loads(path.read_text())
    about[channel] |= fields
    path.write_text(json.dumps(about))


@pytest.mark.parametrize(("broken", "words"), [
    (lambda f: change_meta(f, "iq", type="f4"), r"meta.json: iq is raw f4, expected raw int16"),
    (lambda f: change_meta(f, "iq", format="mjpeg"), r"iq is mjpeg i2, expected raw int16"),
    (lambda f: change_meta(f, "iq", type="<f16x"), r"iq: type"),
    (lambda f: change_meta(f, "iq", shape=[4, 5, 4, 64]), r"iq: has shape \(4, 5, 4, 64\), expected loops, 1 to 3 tx"),
    (lambda f: change_meta(f, "iq", shape=[4, "x"]), r"iq is .*, expected format, type and shape"),
    (lambda f: (f / "radar/ts").unlink(), r"ts: "),
    (lambda f: (f / "radar/ts").write_bytes(b""), r"ts: has 0 bytes, expected 8 a frame"),
    (lambda f: (f / "radar/radar.json").write_text("[1]"), r"radar.json: holds a list, expected an object"),
    (lambda f: (f / "radar/radar.json").write_text('{"range_resolution": "x"}'),
     r"range_resolution is x, expected a positive number"),
    (lambda f: (f / "radar/radar.json").write_text('{"tx_order": [1, 2]}'),
     r"tx_order is \[1, 2\], expected \[1, 2, 3\]"),
    (lambda f: (f / "radar/iq").write_bytes(b"12"), r"iq: has 2 bytes, expected \d+ a frame"),
    (lambda f: (f / "config.yaml").write_text("radar: {args: {}}"), r"config.yaml: has no radar: args: radar:"),
    (lambda f: chirps(f / "config.yaml", CHIRPS | {"freq_slope": "x"}),
     r"radar.args.radar.freq_slope is x, expected a number"),
    (lambda f: np.savez(f / "_radar/pose.npz", t=np.arange(3.0), pos=np.zeros((2, 3)), rot=np.zeros((3, 3, 3))),
     r"pose.npz: has .* expected t, pos \(3 numbers\) and rot \(3 x 3\)"),
    (lambda f: np.savez(f / "_radar/pose.npz", t=np.zeros(3), pos=np.zeros((3, 3)), rot=np.zeros((3, 3, 3))),
     r"times that do not ascend"),
])  # fmt: skip
def test_what_is_off_is_named(sequence, tmp_path, broken, words):
    broken(sequence)
    with pytest.raises(InputError, match=words):
        import_recording(sequence, tmp_path / "a.h5", Given())
