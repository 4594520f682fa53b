"""Fuzzing of recordings and ROS bags."""

import functools
import tempfile
from pathlib import Path

import h5py
import numpy as np
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin

import radarize.io.importers.bag  # noqa: F401 -- imported at first use, and what its libraries take is no input's memory
from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.radar.cfg import write_cfg
from tests.fuzzing.damage import damaged
from tests.fuzzing.hdf5 import RECORDING, altered, edits
from tests.fuzzing.reader import CONFIG, FRAMES, Reader, file, importing, use
from tests.io.importers.ros import write_published


@functools.cache
def _recording() -> tuple[bytes, bytes]:
    """A recording with streams of every kind, finished and growing."""
    ticks = np.arange(0, 0.15, 0.005)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.h5"
        streams = {
            "truth/pose": Stream((7,), "f8", "m", ""),
            "truth/depth": Stream((100, 8), "u2", "mm", ""),
            "tracking/time": Stream((), "f8", "s", "", "tracking/time"),
            "tracking/pose": Stream((7,), "f8", "m", "", "tracking/time"),
            "imu/time": Stream((), "f8", "s", "", "imu/time"),
            "imu/accelerometer": Stream((3,), "f4", "m/s^2", "", "imu/time"),
            "imu/gyroscope": Stream((3,), "f4", "rad/s", "", "imu/time"),
            "points/frame": Stream((), "i4", "", "", "points/frame"),
            "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
        }
        still = np.tile([0, 0, 1, 0, 0, 0, 1.0], (len(ticks), 1))
        rows = {
            "truth/pose": still[:3],
            "truth/depth": np.ones((3, 100, 8)),
            "tracking/time": ticks,
            "tracking/pose": still,
            "imu/time": ticks,
            "imu/accelerometer": still[:, :3],
            "imu/gyroscope": still[:, :3],
            "points/frame": np.arange(3),
            "points/cloud": np.ones((3, 6)),
        }
        plan = {"truth/plan": Product(np.ones((4, 4)), "m", "")}
        with RecordingWriter(path, CONFIG, cfg_text=write_cfg(CONFIG), streams=streams, products=plan) as writer:
            writer.append(FRAMES, CONFIG.frame_period * np.arange(3), rows=rows)
            writer.flush()
            growing = writer.part.read_bytes()
        return path.read_bytes(), growing


def recording() -> Reader:
    """The project's HDF5: damaged bytes (finished, without checksums, growing), or valid HDF5 with other content."""
    with tempfile.TemporaryDirectory() as folder:
        new, old = Path(folder) / "new.h5", Path(folder) / "old.h5"
        new.write_bytes(_recording()[0])
        with h5py.File(new) as source, h5py.File(old, "w", libver="earliest") as target:
            target.attrs.update(source.attrs)
            for name in source:
                source.copy(name, target)
        seeds = [new.read_bytes(), old.read_bytes(), _recording()[1]]

    def place(what: bytes | list[tuple], folder: Path) -> Path:
        path = folder / "a.h5"
        if isinstance(what, bytes):
            path.write_bytes(what)
        else:
            altered(seeds[0], what, path)
        return path

    inputs = st.one_of(damaged(seeds), edits(RECORDING))
    return Reader(inputs, place, use, lambda what: len(what if isinstance(what, bytes) else seeds[0]))


def bags(kind: str) -> Reader:
    """ROS bags: ``bag`` (ROS 1), ``mcap`` or ``db3``."""
    with tempfile.TemporaryDirectory() as name:
        source, path = Path(name) / "a.h5", Path(name) / f"a.{kind}"
        source.write_bytes(_recording()[0])
        if kind == "bag":
            seeds = [write_published(path, source).read_bytes()]
        else:
            storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            folder = write_published(path.with_suffix(""), source, 2, storage)
            (stored,) = folder.glob(f"*.{kind}")
            seeds = [stored.read_bytes()]
    return Reader(damaged(seeds), file(f"a.{kind}"), importing())
