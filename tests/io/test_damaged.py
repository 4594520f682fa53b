"""Damaged recordings: only the affected frames are lost, and they are counted."""

import os
import shutil

import h5py
import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, Stream, recover
from radarize.io.recording.stamps import Stamps
from tests.virtual import SMALL

COUNT, PERIOD = 40, SMALL.frame_period
ADC = np.random.default_rng(0).integers(-300, 300, (COUNT, *SMALL.frame_shape), dtype=np.int16)
TIMES = 1.7e9 + PERIOD * np.arange(COUNT)


@pytest.fixture
def walk(tmp_path):
    """A complete recording with one row per frame of one stream, and some points per frame."""
    streams = {
        "truth/pose": Stream((7,), "f8", "m", ""),
        "truth/depth": Stream((100, 90), "u2", "mm", ""),
        "points/frame": Stream((), "i4", "", "", "points/frame"),
        "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
    }
    numbers = np.arange(COUNT)
    rows = {
        "truth/pose": np.tile(numbers[:, None], 7),
        "truth/depth": np.random.default_rng(1).integers(1, 999, (COUNT, 100, 90)),
        "points/frame": np.repeat(numbers, 2), "points/cloud": np.repeat(numbers, 2)[:, None] * np.ones(6),
    }  # fmt: skip
    with RecordingWriter(tmp_path / "a.h5", SMALL, streams=streams) as writer:
        writer.append(ADC, TIMES, rows=rows)
    return tmp_path / "a.h5"


def zeroed(path, *frames, name="radar/adc", size=64):
    """Zero some bytes in the middle of the chunks of frames."""
    with h5py.File(path) as file:
        chunks = [file[name].id.get_chunk_info(frame) for frame in frames]
    with path.open("r+b") as file:
        for chunk in chunks:
            file.seek(chunk.byte_offset + chunk.size // 2)
            file.write(bytes(size))
    return path


def stamped(path, times):
    with h5py.File(path, "r+") as file:
        file["radar/time"][: len(times)] = times
    return path


def test_a_frame_that_cannot_be_unpacked_is_lost(walk):
    zeroed(walk, 7, 31)
    with Recording(walk) as recording:
        valid, adc = recording.valid(0, COUNT), recording.adc(0, COUNT)
        lost = ~valid.any(axis=(1, 2))
        assert np.flatnonzero(lost).tolist() == [7, 31] and valid[~lost].all()
        assert np.array_equal(adc[~lost], ADC[~lost]) and not adc[lost].any()
        assert recording.damage == ["2 of 40 frames cannot be unpacked and count as lost (the first is 7)"]
    with Recording(walk) as recording:  # whichever is asked for first
        assert not recording.adc(7, 8).any() and not recording.valid(7, 8).any() and recording.valid(8, 9).all()


def test_a_frame_whose_chunk_is_not_there_is_lost(walk):
    with h5py.File(walk, "r+") as file:
        file["radar/adc"].resize(COUNT - 1, axis=0)
        file["radar/adc"].resize(COUNT, axis=0)
    for first in ("adc", "valid"):
        with Recording(walk) as recording:
            getattr(recording, first)(0, COUNT)
            assert np.flatnonzero(~recording.valid(0, COUNT).all(axis=(1, 2))).tolist() == [COUNT - 1]


def test_other_rows_of_a_stream_are_read(walk):
    zeroed(walk, 3, name="truth/depth")
    with Recording(walk) as recording:
        found = recording.read("truth/depth")
        assert not found[3].any() and np.delete(found, 3, axis=0).all()
        assert recording.damage == [
            "1 of 40 rows of /truth/depth cannot be unpacked and are left empty (the first is 3)"
        ]


def test_all_commands_count_it(walk, tmp_path):
    zeroed(walk, 7)
    sentence = "1 of 40 frames cannot be unpacked and count as lost"
    run = CliRunner().invoke
    info = run(app, ["info", str(walk)])
    assert info.exit_code == 0 and sentence in info.stdout and "12 chirps lost" in info.stdout
    report = run(app, ["report", str(walk), "-o", str(tmp_path / "a.html")])
    assert report.exit_code == 0 and sentence in (tmp_path / "a.html").read_text()
    export = run(app, ["export", str(walk), "--format", "bin", "-o", str(tmp_path / "a.bin")])
    assert export.exit_code == 0 and sentence in export.stderr
    ran = run(app, ["run", str(walk), "-o", str(tmp_path / "run"), "--odometry", "doppler", "--scans", "first-echo"])
    assert ran.exit_code == 0 and sentence in ran.stderr


def test_recover_loses_the_damaged_frame_alone(walk):
    part = zeroed(walk, 7).rename(walk.with_name("a.h5.part"))
    before = part.read_bytes()
    (walk.with_name("a.h5.recovered.part")).write_bytes(b"of an attempt that was killed")
    with Recording(recover(part)) as recording:
        assert len(recording) == COUNT and np.flatnonzero(~recording.valid(0, COUNT).all(axis=(1, 2))).tolist() == [7]
        for words in ("1 of 40 frames cannot be unpacked", "1 frames all of them", "40 are here, and it is kept"):
            assert words in recording.attributes["warnings"]
    assert part.read_bytes() == before and sorted(os.listdir(walk.parent)) == ["a.h5", "a.h5.part"]


def test_recover_does_not_lock_itself_out(walk, monkeypatch):
    part = walk.rename(walk.with_name("a.h5.part"))

    def fail(*_, **__):
        raise InputError("no")

    with monkeypatch.context() as patch:
        patch.setattr(RecordingWriter, "append", fail)
        with pytest.raises(InputError, match="no"):
            recover(part)
    assert os.listdir(walk.parent) == ["a.h5.part"]
    recover(part)  # closed cleanly, as HDF5 locks it while it is read
    assert os.listdir(walk.parent) == ["a.h5"]


def flipped(value, bit):
    return float((np.array(value).view(np.uint64) ^ np.uint64(1 << bit)).view(float))


@pytest.mark.parametrize("place", [0, 1, 20, COUNT - 2, COUNT - 1])
@pytest.mark.parametrize("wrong", ["nan", "zero", "twice", "high bit", "low bit", "far"])
def test_one_wrong_stamp_is_made_anew(walk, wrong, place):
    times = TIMES.copy()
    times[place] = {
        "nan": np.nan, "zero": 0.0, "twice": times[max(place - 1, 0)], "high bit": flipped(times[place], 62),
        "low bit": flipped(times[place], 45), "far": times[place] + 3600,
    }[wrong]  # fmt: skip
    stamped(walk, times)
    with Recording(walk) as recording:
        assert len(recording) == COUNT and np.allclose(recording.times, TIMES, rtol=0, atol=1e-5)
        assert np.array_equal(recording.adc(place, place + 1)[0], ADC[place])
        if wrong != "twice" or place:
            assert recording.damage == [
                "1 of 40 stamps in /radar/time are damaged: 1 are interpolated by the frame period"
            ]
    part = walk.rename(walk.with_name("b.h5.part"))
    with Recording(recover(part)) as recording:
        assert len(recording) == COUNT and np.array_equal(recording.adc(0, COUNT), ADC)
    assert part.exists() == (wrong != "twice" or place > 0)


def test_frames_whose_time_nobody_can_tell_are_left_out(walk):
    """Two frames are missing before, between or after them."""
    times = TIMES.copy()
    times[12:] += 2 * PERIOD
    times[10:13] = np.nan
    stamped(walk, times)
    kept = np.r_[0:10, 13:COUNT]
    with Recording(walk) as recording:
        assert np.array_equal(recording.times, times[kept])
        assert np.array_equal(recording.adc(0, 99), ADC[kept]) and np.array_equal(recording.adc(9, 11), ADC[[9, 13]])
        assert recording.read("truth/pose")[:, 0].tolist() == kept.tolist()
        assert recording.rows("truth/pose", 10, 11)[0, 0] == 13
        assert recording.rows("points/frame", 9, 11).tolist() == [9, 9, 10, 10]
        assert recording.rows("points/cloud", 9, 11)[:, 0].tolist() == [9, 9, 13, 13]
        assert recording.damage == ["3 of 40 stamps in /radar/time are damaged: 3 frames are left out"]
    part = walk.rename(walk.with_name("a.h5.part"))
    with Recording(recover(part)) as recording:
        assert len(recording) == 37 and recording.read("points/frame").tolist() == np.repeat(np.arange(37), 2).tolist()
        assert "40 frames were begun there, 37 are here, and it is kept" in recording.attributes["warnings"]
    assert part.exists()


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_a_block_of_stamps_that_was_never_written(walk, value):
    stamped(walk, np.full(COUNT, value))
    with Recording(walk) as recording:
        assert np.allclose(np.diff(recording.times), PERIOD) and np.array_equal(recording.adc(0, COUNT), ADC)
        assert "40 are interpolated" in recording.damage[0] or "39 are interpolated" in recording.damage[0]


def test_frames_without_stamps_and_samples_were_not_written(walk):
    with h5py.File(walk, "r+") as file:
        for name in ("radar/adc", "radar/time"):
            file[name].resize(30, axis=0)
            file[name].resize(COUNT, axis=0)
    with Recording(walk) as recording:
        assert len(recording) == 30 and "10 frames are left out" in recording.damage[0]


@pytest.mark.parametrize("name", ["radar/time", "radar/valid"])
def test_data_sets_of_other_lengths(walk, tmp_path, name):
    with h5py.File(walk, "r+") as file:
        file[name].resize(30, axis=0)
    info = CliRunner().invoke(app, ["info", str(walk)])
    assert info.exit_code == 0 and f"/{name} has 30 rows" in info.stdout and "beyond 30 are left out" in info.stdout
    ran = CliRunner().invoke(
        app, ["run", str(walk), "-o", str(tmp_path / "run"), "--odometry", "doppler", "--scans", "first-echo"]
    )
    assert ran.exit_code == 0 and f"/{name} has 30 rows" in ran.stderr


def test_stamps_that_go_back():
    """The clock was set back by 5 s in the middle of the walk: the stamps of one half are kept, the other continues."""
    times = 0.1 * np.arange(200)
    times[100:] -= 5
    found = Stamps(times, 0.1)
    assert (np.diff(found.times) > 0).all() and len(found.times) + len(found.left_out) == 200


def test_sound_stamps_stay_as_they_are():
    for times in (TIMES, np.array([0.0, 1e6]), np.array([0.0, 0.1, 0.2, 7.0]), np.arange(5.0) * 3600, np.zeros(0)):
        found = Stamps(times, PERIOD)
        assert np.array_equal(found.times, times) and not found.warnings()


def test_what_is_flushed_is_on_the_disk(tmp_path, monkeypatch):
    """Samples are written before their stamps, so that all frames that count are complete after a power cut."""
    from radarize.io.recording import writer as writer_module

    synced, real = [], os.fsync

    def sync(handle):
        copy = tmp_path / f"{len(synced)}.h5"
        shutil.copyfile(writer.part, copy)
        with Recording(copy) as recording:
            synced.append(len(recording))
        real(handle)

    monkeypatch.setattr(writer_module.os, "fsync", sync)
    monkeypatch.setattr(writer_module, "_PACE", 0.0)
    with RecordingWriter(tmp_path / "a.h5", SMALL) as writer:
        for k in range(0, COUNT, 10):
            writer.append(ADC[k : k + 10], TIMES[k : k + 10])
            writer.flush()
        assert synced == [0, 10, 10, 20, 20, 30, 30, 40]
        monkeypatch.setattr(writer_module.os, "fsync", real)
