"""A capture keeps the received frames however it ends, and does not replace an existing recording without
permission."""

import errno
import os
import signal
import termios
import threading
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.capture import live
from radarize.capture import record as record_module
from radarize.capture.page import LivePage
from radarize.capture.record import record
from radarize.capture.stream import StreamCounts
from radarize.capture.uart import Uart
from radarize.cli import app
from radarize.io.console import until_interrupted
from radarize.io.errors import InputError
from radarize.io.recording import Product, Recording, RecordingWriter, Stream, recover
from radarize.io.recording import writer as writer_module
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import CLASSICAL
from radarize.radar.assembler import PacketCounts
from tests.disk import fill
from tests.virtual import SMALL

ADC = np.random.default_rng(0).integers(-300, 300, (30, *SMALL.frame_shape), dtype=np.int16)
RADAR = {"source": "radar at /dev/ttyACM0, DCA1000 at 192.168.33.180"}


class Played:
    """Stream of batches with optional faults."""

    config, text, facts, packets = SMALL, "", RADAR, PacketCounts()

    def __init__(self, *wrong: BaseException, frames: int = 20):
        self._left = [*np.array_split(np.arange(frames), 4), *wrong]
        self.counts = StreamCounts(first=1.0)

    def frames(self, most: int) -> np.ndarray | None:
        if not self._left:
            return None
        if isinstance(numbers := self._left.pop(0), BaseException):
            raise numbers
        times, valid = numbers * SMALL.frame_period, np.ones((len(numbers), *SMALL.frame_shape[:2]), bool)
        kind = [("number", "i8"), ("time", "f8"), ("valid", "?", valid.shape[1:]), ("adc", "i2", SMALL.frame_shape)]
        return np.rec.fromarrays([numbers, times, valid, ADC[numbers]], np.dtype(kind)).view(np.ndarray)

    def stop(self) -> None:
        pass

    def troubles(self) -> list[str]:
        return ["the fan is loud"]


def captured(path, stream=None, **options):
    return record(stream or Played(), path, threading.Event(), **options)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (InputError("--port /dev/ttyACM0: lost"), "--port /dev/ttyACM0: lost; 20 whole frames are kept in .*a.h5$"),
        (ZeroDivisionError("division by zero"), "internal error, ZeroDivisionError: .*; 20 whole frames are kept in"),
        (KeyboardInterrupt(), "stopped; 20 whole frames are kept in"),
    ],
)
def test_whatever_goes_wrong(tmp_path, wrong, words):
    with pytest.raises(InputError, match=words):
        captured(tmp_path / "a.h5", Played(wrong))
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 99), ADC[:20])
        assert "the fan is loud; it ended early: " in recording.attributes["warnings"]
    assert os.listdir(tmp_path) == ["a.h5"]


class OnSmallDisk(Played):
    """Stream during which the disk is filled before the third batch of four, and freed before the last."""

    def __init__(self, disk):
        super().__init__()
        self._taken = disk / "taken"

    def frames(self, most: int) -> np.ndarray | None:
        if len(self._left) == 2:
            fill(self._taken)
        elif len(self._left) == 1:
            self._taken.unlink()
        return super().frames(most)


def test_a_disk_that_fills_and_empties(small_disk, capsys):
    """Appended frames are kept, although HDF5 writes them later; frames that arrive while the disk is full are left
    out."""
    captured(small_disk / "a.h5", OnSmallDisk(small_disk))
    assert "no space left on the device; frames are left out, for up to 60 s" in capsys.readouterr().err
    kept = [*range(10), *range(15, 20)]
    with Recording(small_disk / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 99), ADC[kept])
        assert np.array_equal(recording.times, np.array(kept) * SMALL.frame_period)
        assert recording.attributes["warnings"] == (
            "the fan is loud; 5 frames are left out, since the disk was full; 5 frames are missing between others"
        )
    assert os.listdir(small_disk) == ["a.h5"]


def test_a_disk_that_others_fill_at_once(small_disk):
    """Space of appended frames is allocated: a recording is completed on a full disk."""
    with RecordingWriter(small_disk / "a.h5", SMALL) as writer:
        writer.append(ADC[:10], np.arange(10.0))
        fill(small_disk / "taken")
    with Recording(small_disk / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 99), ADC[:10])


def test_a_disk_that_stays_full(tmp_path, monkeypatch):
    """Not even the end can be written: the partial file is named, and can be recovered later."""
    free = [None] * 3  # for the first frames

    def allocate(*_):
        if not free:
            raise OSError(errno.ENOSPC, "No space left on device")
        free.pop()

    monkeypatch.setattr(writer_module.os, "posix_fallocate", allocate)
    monkeypatch.setattr(record_module, "PATIENCE", 0.0)
    with pytest.raises(InputError, match=r"no space left.*kept in .*a.h5.part, of which radarize recover .*a.h5.part"):
        captured(tmp_path / "a.h5")


def test_a_port_that_is_pulled_out_is_no_internal_error(monkeypatch):
    """termios.error is no OSError."""

    def gone():
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr("serial.Serial", lambda *_, **__: SimpleNamespace(reset_input_buffer=gone, close=lambda: None))
    with Uart("/dev/ttyACM0") as uart, pytest.raises(InputError, match="lost while sending 'sensorStop'"):
        uart.stop()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_end_a_capture_as_the_user_does(number):
    with until_interrupted() as stopping:
        os.kill(os.getpid(), number)
        assert stopping.wait(5)


def killed(path, frames=25):
    """File after a kill: frames, the last of which were not flushed, with streams of every kind."""
    streams = {"imu/time": Stream((), "f8", "s", "", "imu/time"), "truth/pose": Stream((7,), "f8", "m", "")}
    with RecordingWriter(
        path,
        SMALL,
        cfg_text="% mine",
        attributes=RADAR,
        streams=streams,
        products={"truth/plan": Product(np.ones(3), "m", "")},
    ) as writer:
        times = np.arange(frames) * SMALL.frame_period
        writer.append(ADC[:frames], times, rows={"imu/time": times, "truth/pose": np.ones((frames, 7))})
        writer.flush()
        left = writer.part.read_bytes()
    path.unlink()
    writer.part.write_bytes(left)
    return writer.part


def test_recover(tmp_path):
    part = killed(tmp_path / "a.h5")
    done = CliRunner().invoke(app, ["recover", str(part)])
    assert done.exit_code == 0 and "a.h5: 25 frames" in done.stdout and "which was interrupted" in done.stderr
    assert os.listdir(tmp_path) == ["a.h5"]
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 99), ADC[:25]) and recording.cfg_text == "% mine"
        assert recording.attributes["source"] == RADAR["source"] and len(recording.read("truth/plan")) == 3
        assert np.array_equal(recording.read("imu/time"), recording.times)
        assert recording.read("truth/pose").shape == (25, 7)
    h5py.File(tmp_path / "a.h5").close()  # whole, for HDF5 too


def test_what_cannot_be_recovered(tmp_path):
    captured(tmp_path / "a.h5")
    with pytest.raises(InputError, match="does not end in .part"):
        recover(tmp_path / "a.h5")
    part = killed(tmp_path / "b.h5")
    (tmp_path / "b.h5").write_bytes(b"")
    with pytest.raises(InputError, match="b.h5: already exists"):
        recover(part)
    with pytest.raises(InputError, match="a.h5: already exists"):
        recover(part, tmp_path / "a.h5")
    with RecordingWriter(tmp_path / "c.h5", SMALL) as writer:
        writer.append(ADC[:3], np.arange(3.0))
        writer.flush()
        with pytest.raises(InputError, match="c.h5.part: another program is writing there"):
            recover(writer.part)


def test_two_captures_into_one_file(tmp_path):
    with RecordingWriter(tmp_path / "a.h5", SMALL) as first:
        first.append(ADC[:3], np.arange(3.0))
        with pytest.raises(InputError, match="a.h5.part: another program is writing there"):
            captured(tmp_path / "a.h5", overwrite=True)
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 3


def test_what_was_captured_is_not_replaced_unasked(tmp_path):
    captured(tmp_path / "a.h5")
    before = (tmp_path / "a.h5").read_bytes()
    left = killed(tmp_path / "b.h5")
    for path, hint in ((tmp_path / "a.h5", "expected another name"), (tmp_path / "b.h5", "radarize recover")):
        with pytest.raises(InputError, match=f"{path.name}.*already exists.*{hint}"):
            captured(path, Played(frames=4))
        with pytest.raises(InputError, match="already exists"):  # such as a simulation
            RecordingWriter(path, SMALL)
    assert (tmp_path / "a.h5").read_bytes() == before and left.exists()
    captured(tmp_path / "a.h5", Played(frames=4), overwrite=True)
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 4


@pytest.mark.parametrize("command", ["capture", "live"])
def test_the_commands_look_before_they_begin(tmp_path, command):
    captured(tmp_path / "a.h5")
    (tmp_path / "note.h5").write_text("no recording")
    for name in ("a.h5", "note.h5"):
        done = CliRunner().invoke(app, [command, "-o", str(tmp_path / name)])
        assert isinstance(done.exception, InputError) and "--overwrite" in str(done.exception)
        done = CliRunner().invoke(app, [command, "-o", str(tmp_path / name), "--overwrite"])
        assert "--config is missing" in str(done.exception)


def test_what_was_simulated_may_be_replaced(tmp_path):
    for number in range(2):
        with RecordingWriter(tmp_path / "a.h5", SMALL, attributes={"source": "radarsim simulate"}) as writer:
            writer.append(ADC[: number + 1], np.arange(number + 1.0))
    captured(tmp_path / "a.h5")
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 20


def test_a_live_pipeline_takes_no_more_frames_at_a_time_than_it_was_prepared_for(monkeypatch):
    """Buffers that libraries cache per batch size exist before the first frame."""
    sizes, take, asked = [], live.Preprocessor.process, []
    monkeypatch.setattr(
        live.Preprocessor, "process", lambda self, adc, *more: (sizes.append(len(adc)), take(self, adc, *more))[1]
    )
    live.prepare(Inputs(SMALL), CLASSICAL)
    monkeypatch.setattr(live, "follow", lambda *_, most, **__: asked.append(most) or [])
    with LivePage("127.0.0.1:0") as page:
        list(live.Live(Inputs(SMALL), CLASSICAL, page).follow(Played(), threading.Event()))
    assert sorted(set(sizes)) == list(range(1, asked[0] + 1))
