"""Recordings and runs with hostile content in valid HDF5, such as wrong declared sizes, which checksums do not
detect."""

import math
from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

#: Data sets of a recording.
RECORDING = ("radar/adc", "radar/time", "radar/valid", "truth/pose", "imu/time", "imu/gyroscope", "truth/plan")
_HUGE = st.sampled_from((0, 1, 2, 3, 1000, 2**20, 2**31, 2**40, 2**62))
_KINDS = ("i2", "f8", "f4", "?", "u1", "i8", "c8", "S3", "S0", "O", "V7", "compound", ">i2", "f2")
_VALUE = st.one_of(
    st.integers(-(2**63), 2**63 - 1),
    st.floats(),
    st.text(max_size=20).filter(lambda text: "\0" not in text),
    st.sampled_from((b"\xff\xfe", "{}", "[]", "radar/time", "radar", "imu/time", "x" * 60_000)),
    st.lists(st.floats(), max_size=4).map(np.array),
    st.just(h5py.Empty("f8")),
)


def edits(names: Sequence[str]) -> SearchStrategy[list[tuple]]:
    """Edits of a file with data sets of given names, for `altered`."""
    name = st.sampled_from(tuple(names))
    groups = st.sampled_from((*names, *sorted({path.split("/")[0] for path in names if "/" in path})))
    declared = st.tuples(st.sampled_from(_KINDS), st.lists(_HUGE, max_size=6), st.booleans(), st.booleans())
    links = st.sampled_from(("dangling", "external", "loop", "group", "virtual", "elsewhere"))
    attributes = st.sampled_from(("config", "cfg", "clock", "unit", "about", "w"))
    edit = st.one_of(
        st.tuples(st.just("drop"), groups, st.none()),
        st.tuples(st.just("declare"), name, declared),
        st.tuples(st.just("resize"), name, _HUGE),
        st.tuples(st.just("link"), name, links),
        st.tuples(st.just("write"), name, st.floats(-1e300, 1e300) | st.just(np.nan)),
        st.tuples(st.just("note"), st.tuples(st.one_of(groups, st.just("/")), attributes), _VALUE),
    )
    return st.lists(edit, min_size=1, max_size=4)


def altered(seed: bytes, edits: list[tuple], path: Path) -> None:
    """Write a file with edits; those that HDF5 itself refuses are left out."""
    path.write_bytes(seed)
    for edit in edits:
        try:
            with h5py.File(path, "r+", libver="latest") as file:
                _alter(file, *edit)
        except (OSError, ValueError, TypeError, KeyError, RuntimeError, OverflowError, AttributeError):
            pass


def _alter(file: h5py.File, kind: str, name, value) -> None:
    if kind == "note":
        name, attribute = name
        file[name].attrs[attribute] = value
        return
    if kind == "resize":
        if len(file[name]) < 2**20:  # HDF5 looks for every chunk when it gives up rows
            file[name].resize(value, axis=0)
        return
    if kind == "write":
        data = file[name]
        if math.prod(data.shape) < 2**24:  # HDF5 dies of writing a chunk of the largest
            data[(slice(0, 3),) * data.ndim] = value
        return
    notes = dict(file[name].attrs) if name in file else {}
    if name in file:
        del file[name]
    if kind == "drop":
        return
    if kind == "link":
        if value == "group":
            file.create_group(name)
        elif value == "virtual":
            layout = h5py.VirtualLayout((2**40,), "f8")
            layout[:8] = h5py.VirtualSource("/dev/zero", "adc", (8,))
            file.create_virtual_dataset(name, layout)
        elif value == "elsewhere":
            file.create_dataset(name, (2**30,), "f8", external=[("/dev/zero", 0, 2**33)])
        else:
            file[name] = {
                "dangling": h5py.SoftLink("/nowhere"),
                "external": h5py.ExternalLink("/nowhere.h5", "/radar/adc"),
                "loop": h5py.SoftLink(f"/{name}"),
            }[value]
        return
    dtype, shape, chunked, packed = value
    dtype = np.dtype([("a", "i2"), ("b", "f8")]) if dtype == "compound" else dtype
    dtype = h5py.string_dtype() if dtype == "O" else dtype
    chunks = tuple(max(1, min(length, 2**20 if chunked else 16)) for length in shape) or None
    if len(shape) and (chunked or packed):
        file.create_dataset(name, shape, dtype, chunks=chunks, compression="gzip" if packed else None)
    else:
        file.create_dataset(name, shape, dtype)
    file[name].attrs.update(notes)
