"""HDF5 files that refer to other files are refused by every reader, before anything is read."""

import h5py
import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.hdf5 import open_hdf5
from radarize.io.importers.arrays import open_array
from radarize.io.recording import Product, Recording, RecordingWriter, add
from radarize.pipeline.runfolder.reader import Scans
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(update={"samples": 32, "loops": 2})
SECRET = b"root:x:0:0:secret"


def external(file, name, secret):
    file.create_dataset(name, (len(SECRET),), "u1", external=[(str(secret), 0, len(SECRET))])


def virtual(file, name, secret):
    with h5py.File(secret.with_suffix(".h5"), "w") as other:
        other["data"] = np.frombuffer(SECRET, np.uint8)
    layout = h5py.VirtualLayout((len(SECRET),), "u1")
    layout[:] = h5py.VirtualSource(str(secret.with_suffix(".h5")), "data", (len(SECRET),))
    file.create_virtual_dataset(name, layout)


def link(file, name, secret):
    virtual_source = secret.with_suffix(".h5")
    with h5py.File(virtual_source, "w") as other:
        other["data"] = np.frombuffer(SECRET, np.uint8)
    file[name] = h5py.ExternalLink(str(virtual_source), "/data")


def behind(file, name, secret):
    """A soft link through an external link."""
    link(file, "deep/within/away", secret)
    file[name] = h5py.SoftLink("/deep/within/away")


KINDS = [external, virtual, link, behind]


def recording(path, growing=False):
    with RecordingWriter(path, CONFIG) as writer:
        writer.append(np.ones((2, *CONFIG.frame_shape), np.int16), np.arange(2.0))
    return path


@pytest.mark.parametrize("plant", KINDS)
@pytest.mark.parametrize("name", ["truth/extra", "/extra", "radar/time"])
def test_a_recording_is_not_opened(tmp_path, plant, name):
    (tmp_path / "passwd").write_bytes(SECRET)
    path = recording(tmp_path / "a.h5")
    with h5py.File(path, "r+", libver="latest") as file:
        if name in file:
            del file[name]
        plant(file, name, tmp_path / "passwd")
    with pytest.raises(InputError, match="other files"):
        Recording(path)
    with pytest.raises(InputError, match="other files"):
        add(path, {}, {}, {"truth/plan": Product(np.zeros(3), "m", "")})


@pytest.mark.parametrize("plant", KINDS)
def test_nor_are_scans_and_arrays(tmp_path, plant):
    (tmp_path / "passwd").write_bytes(SECRET)
    for name, read in (("scans.h5", Scans), ("a.mat", lambda path: open_array(path, "data", tmp_path))):
        with h5py.File(tmp_path / name, "w") as file:
            for needed in ("time", "ranges", "azimuths"):
                file[needed] = np.zeros((3, 3))
            plant(file, "data", tmp_path / "passwd")
        with pytest.raises(InputError, match="other files"):
            read(tmp_path / name)


def test_links_within_a_file_are_followed(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["a/b"] = np.arange(3)
        file["soft"], file["again"], file["round"] = h5py.SoftLink("/a/b"), file["a/b"], file["/"]
    with open_hdf5(tmp_path / "a.h5") as file:
        assert list(file["soft"]) == list(file["again"]) == [0, 1, 2]


def test_a_matlab_file_declares_no_more_than_it_holds(tmp_path):
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file.create_dataset("adc", (2**40, 4), "i2", chunks=(2**20, 4))
    with pytest.raises(InputError, match="declares"):
        open_array(tmp_path / "a.mat", "adc", tmp_path)
