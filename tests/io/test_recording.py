import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

from radarize.io.errors import DiskFull, InputError
from radarize.io.recording import Product, Recording, RecordingWriter, Stream, add
from radarize.io.recording.growing import lookup3
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 4})


def frames(start: int, stop: int, config: RadarConfig = CONFIG) -> np.ndarray:
    """Incompressible samples that depend on the frame's number only."""
    return np.stack(
        [np.random.default_rng(i).integers(-999, 999, config.frame_shape, np.int16) for i in range(start, stop)]
    )


def test_what_is_written_is_read(tmp_path):
    path = tmp_path / "new" / "a.h5"
    valid = np.ones((5, 4, 3), bool)
    valid[2, 1, 0] = False
    pose = Stream((7,), "f8", "m", "sensor in the world")
    plan = Product(np.eye(4), "m", "walls")
    with RecordingWriter(
        path,
        CONFIG,
        cfg_text="% text",
        attributes={"seed": 7, "scene": "office"},
        streams={"truth/pose": pose, "imu/time": Stream((), "f8", "s", "", "imu/time")},
        products={"truth/floor_plan": plan},
    ) as writer:
        writer.append(frames(0, 3), np.arange(3.0), valid[:3], rows={"truth/pose": np.ones((3, 7))})
        writer.append(frames(3, 5), np.arange(3.0, 5), valid[3:], rows={"truth/pose": np.zeros((2, 7))})
        writer.extend("imu/time", np.arange(100.0) / 20)
        assert not path.exists()
        writer.annotate(warnings="late")
    assert not writer.part.exists()
    with Recording(path) as recording:
        assert recording.config == CONFIG and recording.cfg_text == "% text"
        assert recording.attributes["seed"] == 7 and recording.attributes["scene"] == "office"
        assert recording.attributes["warnings"] == "late"
        assert recording.times.tolist() == [0, 1, 2, 3, 4]
        assert np.array_equal(recording.adc(1, 5), frames(1, 5))
        assert np.array_equal(recording.valid(0, 5), valid)
        assert recording.read("truth/pose").sum() == 21
        imu = recording.read("imu/time")
        assert len(imu) == 81 and imu[-1] == 4.0  # up to the end of the last frame, at 4.033 s
        assert recording.rows("imu/time", 1, 3).tolist() == pytest.approx(np.arange(1, 3, 0.05))
        assert np.array_equal(recording.read("truth/floor_plan"), np.eye(4))
        assert recording.describe("truth/pose")["unit"] == "m"
        assert [(s.start, s.stop, len(adc)) for s, adc in recording.batches(2)] == [(0, 2, 2), (2, 4, 2), (4, 5, 1)]
        with pytest.raises(InputError, match="has no /truth/scan; there are"):
            recording.read("truth/scan")


def messages(data: bytes, kind: int) -> list[int]:
    """First bytes of all messages of a kind in a file's object headers (HDF5 file format specification, IV.A.1.b)."""
    found, at = [], data.find(b"OHDR")
    while at >= 0:
        flags = data[at + 5]
        size = 1 << (flags & 3)
        start = at + 6 + (16 if flags & 32 else 0) + (4 if flags & 16 else 0)
        end = start + size + int.from_bytes(data[start : start + size], "little")
        at = start + size
        while at + 4 < end:
            body = at + (6 if flags & 4 else 4)
            found += [data[body]] if data[at] == kind else []
            at = body + int.from_bytes(data[at + 1 : at + 3], "little")
        at = data.find(b"OHDR", end)
    return found


def test_other_software_can_read_it(tmp_path):
    """HDF5 1.10 reads layouts up to version 4 and types up to 3; HDF5 2.0 writes newer ones, which it cannot read."""
    path = tmp_path / "a.h5"
    with RecordingWriter(path, CONFIG, products={"truth/floor_plan": Product(np.eye(4), "m", "walls")}) as writer:
        writer.append(frames(0, 3), np.arange(3.0))
    add(path, {}, {}, {"truth/late": Product(np.ones(3, bool), "", "added")})
    layouts, types = (messages(path.read_bytes(), kind) for kind in (8, 3))
    assert len(layouts) == 5 and set(layouts) <= {3, 4}
    assert len(types) == 5 and {first >> 4 for first in types} <= {1, 2, 3}


def test_frames_of_another_shape_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"frames have shape .* expected \(4, 3, 4, 96, 2\)"):
        with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
            writer.append(np.zeros((1, 5, 3, 4, 96, 2), np.int16), np.zeros(1))


def test_an_error_leaves_what_was_there_and_a_readable_part(tmp_path):
    (tmp_path / "a.h5").write_text("earlier")
    with pytest.raises(ZeroDivisionError):
        with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
            writer.append(frames(0, 2), np.arange(2.0))
            raise ZeroDivisionError
    assert (tmp_path / "a.h5").read_text() == "earlier"
    with Recording(tmp_path / "a.h5.part") as recording:
        assert len(recording) == 2


def test_an_interrupt_ends_a_recording_without_spoiling_it(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
            writer.append(frames(0, 2), np.arange(2.0))
            raise KeyboardInterrupt
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 2), frames(0, 2))


WRITER = """
import sys, time
sys.path.insert(0, {root!r})
import numpy as np
from tests.io.test_recording import CONFIG, frames
from radarize.io.recording import RecordingWriter
with RecordingWriter({path!r}, CONFIG) as writer:
    writer.append(frames(0, 3), np.arange(3.0))
    writer.flush()
    writer.append(frames(3, 4), np.arange(3.0, 4))  # not flushed
    print("ready", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def process(tmp_path):
    """A writer in another process with three frames flushed and one not, waiting."""
    code = WRITER.format(root=str(Path(__file__).parents[2]), path=str(tmp_path / "a.h5"))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "ready\n", process.stderr.read()
        yield process
    finally:
        process.kill()
        process.wait()


def test_readers_follow_a_growing_recording_and_survive_its_death(process, tmp_path):
    with Recording(tmp_path / "a.h5.part") as recording:
        assert np.array_equal(recording.adc(0, 9), frames(0, 3))
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "a.h5").exists()
    with Recording(tmp_path / "a.h5.part") as recording:
        assert np.array_equal(recording.adc(0, 9), frames(0, 3))
        assert recording.valid(0, 3).all()


def test_what_is_damaged_in_a_growing_recording_is_refused_at_once(process, tmp_path):
    """HDF5's multiple-reader mode would retry forever."""
    process.kill()
    process.wait()
    whole = (tmp_path / "a.h5.part").read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for place in [8, 11, 28, 44, *rng.integers(48, 6000, 40)]:
        data = bytearray(whole)
        data[place] ^= 0x10
        data[11] |= 1
        (tmp_path / "b.h5").write_bytes(data)
        start = time.monotonic()
        try:
            with Recording(tmp_path / "b.h5") as recording:
                recording.adc(0, 9)
        except InputError as error:
            refused += 1
            assert "b.h5" in str(error)
        assert time.monotonic() - start < 5
    assert refused >= 10


def test_hdf5s_checksum():
    assert lookup3(b"Four score and seven years ago") == 0x17770551  # lookup3.c, driver5


def test_declared_sizes_are_not_believed(tmp_path):
    """Four terabytes of times in a file of some kilobytes, and a hundred thousand empty chunks."""
    with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
        writer.append(frames(0, 2), np.arange(2.0))
    whole = (tmp_path / "a.h5").read_bytes()
    for chunks in (1024, 1):
        (tmp_path / "b.h5").write_bytes(whole)
        with h5py.File(tmp_path / "b.h5", "r+") as file:
            del file["radar/time"]
            file.create_dataset("radar/time", (2**39 if chunks > 1 else 100_000,), "f8", chunks=(chunks,))
        with pytest.raises(InputError, match="b.h5: /radar/time declares .* but 0 are in the file"):
            Recording(tmp_path / "b.h5")


def test_ctrl_c_keeps_every_frame(process, tmp_path):
    process.send_signal(signal.SIGINT)
    process.wait(timeout=20)
    with Recording(tmp_path / "a.h5") as recording:
        assert np.array_equal(recording.adc(0, 9), frames(0, 4))


def test_flushes_come_by_themselves(tmp_path):
    """Frames are flushed once per second of recorded time."""
    slow = CONFIG.model_copy(update={"frame_period": 0.4})
    with RecordingWriter(tmp_path / "a.h5", slow) as writer:
        for i in range(7):
            writer.append(frames(i, i + 1), np.array([0.4 * i]))
        with Recording(writer.part) as recording:
            assert len(recording) == 6


def test_same_content_same_bytes(tmp_path):
    """The content does not depend on when and how fast it was written."""
    for name, pause in (("a.h5", 0.0), ("b.h5", 0.4)):
        streams = {"imu/time": Stream((), "f8", "s", "", "imu/time")}
        with RecordingWriter(tmp_path / name, CONFIG, attributes={"seed": 7}, streams=streams) as writer:
            for i in range(3):
                writer.append(frames(20 * i, 20 * i + 20), np.arange(20.0) + i)
                writer.extend("imu/time", np.arange(100.0) + 100 * i)
                time.sleep(pause)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_heat_maps_may_stand_without_samples(tmp_path):
    maps = {"maps/range_azimuth": Stream((96, 40), "f2", "dB", "")}
    with RecordingWriter(tmp_path / "a.h5", CONFIG, streams=maps, raw=False) as writer:
        writer.append(None, np.arange(5.0), rows={"maps/range_azimuth": np.ones((5, 96, 40))})
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 5 and recording.valid(0, 5).all() and not recording.has("radar/adc")
        assert recording.read("maps/range_azimuth").sum() == 5 * 96 * 40
        with pytest.raises(InputError, match="has no raw samples"):
            recording.adc(0, 1)


def test_disk_full(small_disk):
    written = 0
    with pytest.raises(InputError) as error:
        with RecordingWriter(small_disk / "a.h5", CONFIG) as writer:
            for start in range(0, 1000, 4):
                writer.append(frames(start, start + 4), np.arange(start, start + 4.0))
                if start == 40:
                    writer.flush()
                    written = start + 4
    assert "a.h5.part" in str(error.value) and "no space left on the device" in str(error.value)
    assert "\n" not in str(error.value)
    with Recording(small_disk / "a.h5.part") as recording:
        assert len(recording) >= written
        assert np.array_equal(recording.adc(0, len(recording)), frames(0, len(recording)))


def test_disk_full_from_the_start(small_disk):
    (small_disk / "fill").write_bytes(bytes((2 << 20) - 8192))
    with pytest.raises(DiskFull, match="cannot write .*a.h5.part: no space left on the device"):
        RecordingWriter(small_disk / "a.h5", CONFIG)
    assert os.listdir(small_disk) == ["fill"]


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write .*a.h5"):
        RecordingWriter(tmp_path / "file" / "a.h5", CONFIG)


@pytest.mark.parametrize("content", [b"", b"text", b"\x89HDF\r\n\x1a\n" + bytes(500)])
def test_files_that_are_no_recording(tmp_path, content):
    path = tmp_path / "a.h5"
    with pytest.raises(InputError, match="no such file"):
        Recording(path)
    path.write_bytes(content)
    with pytest.raises(InputError, match="a.h5: not a readable HDF5 recording"):
        Recording(path)


def test_hdf5_files_of_other_programs(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["data"] = np.arange(3)
    with pytest.raises(InputError, match="not a recording of this project"):
        Recording(tmp_path / "a.h5")


@pytest.mark.parametrize("name, value", [("config", "{}"), ("config", "nonsense"), ("config", 3)])
def test_a_broken_configuration(tmp_path, name, value):
    path = tmp_path / "a.h5"
    with RecordingWriter(path, CONFIG) as writer:
        writer.append(frames(0, 1), np.zeros(1))
    with h5py.File(path, "r+") as file:
        file["radar"].attrs[name] = value
    with pytest.raises(InputError, match="not a recording of this project"):
        Recording(path)


@pytest.mark.parametrize("state", ["finished", "growing"])
@pytest.mark.parametrize("keep", [0.001, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_recording_is_refused(tmp_path, keep, state):
    path = tmp_path / "copy.h5"
    with RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
        for i in range(6):
            writer.append(frames(i, i + 1), np.array([float(i)]))
        writer.flush()
        shutil.copyfile(writer.part, path)
        os.truncate(path, writer._file.id.get_filesize())  # without unused reserved bytes
    if state == "finished":
        shutil.copyfile(tmp_path / "a.h5", path)
    with Recording(path) as recording:
        assert len(recording) == 6
    os.truncate(path, int(path.stat().st_size * keep))
    try:
        with Recording(path) as recording:  # only what was cut off a growing file's very end may go unnoticed
            assert state == "growing" and keep > 0.99
            for i in range(len(recording)):
                assert np.array_equal(recording.adc(i, i + 1), frames(i, i + 1))
    except InputError as error:
        assert "copy.h5" in str(error) and "\n" not in str(error)


def test_damaged_samples_are_named(tmp_path):
    path = tmp_path / "a.h5"
    with RecordingWriter(path, CONFIG) as writer:
        for i in range(3):
            writer.append(frames(i, i + 1), np.array([float(i)]))
    with h5py.File(path, "r") as file:
        chunk = file["radar/adc"].id.get_chunk_info(1)
    with path.open("r+b") as file:
        file.seek(chunk.byte_offset)
        file.write(bytes(chunk.size))
    with Recording(path) as recording:
        assert np.array_equal(recording.adc(0, 1), frames(0, 1))
        assert not recording.adc(1, 2).any() and not recording.valid(1, 2).any()
        assert recording.damage == ["1 of 3 frames cannot be unpacked and count as lost (the first is 1)"]
        assert np.array_equal(recording.adc(2, 3), frames(2, 3)) and recording.valid(2, 3).all()
