"""Small files that declare much data: each reader refuses them by its limits, quickly and with one sentence."""

import io
import json
import os
import time
import zipfile

import numpy as np
import pytest
from PIL import Image

from radarize.io.errors import InputError
from radarize.io.files import read_bytes
from radarize.io.importers import Given, import_recording
from radarize.io.importers.arrays import open_array
from radarize.io.jsonfile import parse_json
from radarize.io.recording import Recording
from radarize.io.tum import read_tum
from radarize.io.yamlfile import read_yaml
from radarize.pipeline.log import Log
from radarize.radar.presets import PRESETS
from radarsim.world.importers import carmen, gltf, rosmap


@pytest.fixture(autouse=True)
def soon():
    start = time.process_time()
    yield
    assert time.process_time() - start < 2


LAUGHS = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 30))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (f"a0: &a0 [x]\n{LAUGHS}", "values"),
        ("a0: &a0 {x: 1}\n" + LAUGHS.replace(": &", ": &").replace("[", "{<<: [").replace("]", "]}"), "values"),
        ("[" * 100_000, "deeper than 32"),
        ("a: " * 50 + "1", "malformed"),
        ("{a: " * 33 + "1" + "}" * 33, "deeper than 32"),
        ("".join(f"a{k}: &a{k} [*a{k - 1}]\n" if k else "a0: &a0 []\n" for k in range(99)), "levels deep"),
        ("a: &a [*a]", "alias of what it lies in"),
        ("a: " + "9" * 4000, "digits"),
        ("a: 0x" + "F" * 9999, "digits"),
        ("a: " + ":".join(["59"] * 999), "digits"),
        ("a: 1." + "1" * 999, "digits"),
        ("-\n" * 600_000, "values"),
        ("#" * (2 << 20) + "\n", "bytes"),
    ],
)
def test_yaml(tmp_path, text, why):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"a.yaml: .*{why}"):
        read_yaml(path)


def test_yaml_shares_what_is_written_once(tmp_path):
    (tmp_path / "a.yaml").write_text("a: &a {x: 1, y: [2, 3]}\nb: {<<: *a, x: 4}\nc: *a\nd: 0x1F\n")
    found = read_yaml(tmp_path / "a.yaml")
    assert found["b"] == {"x": 4, "y": [2, 3]} and found["c"] == {"x": 1, "y": [2, 3]} and found["d"] == 31


def test_json():
    with pytest.raises(InputError, match="digits"):
        parse_json('{"a": ' + "9" * 300 + "}", "a.json")


def packed(method: int, array: np.ndarray, **more) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", method) as archive:
        for name, each in ({"ranges": array} | more).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array(file, np.asarray(each))
    return content.getvalue()


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_archives_that_do_not_tell_how_much_they_make(tmp_path, method):
    angles = {"angle_min": 0.0, "angle_increment": 0.01, "range_max": 9.0}
    (tmp_path / "a.scans.npz").write_bytes(packed(method, np.zeros((400, 500)), **angles))
    for read in (Log.read, carmen.scans_of, lambda path: open_array(path, None, tmp_path)):
        with pytest.raises(InputError, match="packed by method"):
            read(tmp_path / "a.scans.npz")


def test_archives_that_declare_more_than_they_hold(tmp_path):
    angles = {"angle_min": 0.0, "angle_increment": 0.01, "range_max": 9.0}
    (tmp_path / "a.npz").write_bytes(packed(zipfile.ZIP_DEFLATED, np.zeros((2000, 2000)), **angles))
    for read in (Log.read, carmen.scans_of):
        with pytest.raises(InputError, match="declares"):
            read(tmp_path / "a.npz")


def test_logs_that_unpack_without_end(tmp_path, monkeypatch):
    import gzip

    monkeypatch.setattr(carmen, "_BYTES", 1 << 16)
    (tmp_path / "a.log.gz").write_bytes(gzip.compress(b"\n" * (1 << 20)))
    with pytest.raises(InputError, match="more than 65536 bytes"):
        carmen.scans_of(tmp_path / "a.log.gz")


def a_map(folder, pixels, resolution=0.05):
    Image.fromarray(pixels).save(folder / "a.png")
    origin = "origin: [0, 0, 0]"
    (folder / "a.yaml").write_text(f"image: a.png\nresolution: {resolution}\n{origin}\n")
    return folder / "a.yaml"


def test_maps_of_too_many_pixels(tmp_path):
    with pytest.raises(InputError, match="has 20000 x 1000 pixels, expected at most"):
        rosmap.grid(a_map(tmp_path, np.zeros((1000, 20000), np.uint8)))


def test_maps_of_too_many_metres(tmp_path):
    with pytest.raises(InputError, match="resolution is 1 m for 600 x 2 pixels"):
        rosmap.grid(a_map(tmp_path, np.zeros((2, 600), np.uint8), 1.0))


def scene(**parts) -> dict:
    view = {"buffers": [{"byteLength": 36}], "bufferViews": [{"buffer": 0, "byteLength": 36}]}
    accessor = {"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0}
    mesh = {"primitives": [{"attributes": {"POSITION": 0}}]}
    return {**view, "accessors": [accessor], "meshes": [mesh], "nodes": [{"mesh": 0}], **parts}


@pytest.mark.parametrize(
    ("parts", "why"),
    [
        ({"nodes": [{"children": [1]}, {"children": [0]}]}, "its own ancestor"),
        ({"nodes": [{"children": [0]}]}, "its own ancestor"),
        ({"nodes": [{"children": [k + 1, k + 1]} for k in range(30)] + [{"mesh": 0}]}, "child of several"),
        ({"nodes": [{"mesh": 0}] * 9_000}, "bytes"),
        ({"accessors": [{"componentType": 5126, "type": "VEC3", "count": 2_000_000_000}]}, "2000000000 entries"),
        ({"accessors": [{"componentType": 5126, "type": "VEC3", "count": 4, "bufferView": 0}]}, "4 entries"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 48}]}, "3 entries"),
        ({"nodes": 1}, "is not a readable glTF"),
    ],
)
def test_gltf(tmp_path, monkeypatch, parts, why):
    monkeypatch.setattr(gltf, "_BYTES", 1 << 16)
    (tmp_path / "a.gltf").write_text(json.dumps(scene()))
    gltf.check(tmp_path / "a.gltf")
    (tmp_path / "a.gltf").write_text(json.dumps(scene(**parts)))
    with pytest.raises(InputError, match=why):
        gltf.check(tmp_path / "a.gltf")


def test_gltf_shows_a_mesh_at_no_end_of_places(tmp_path):
    accessor = {"componentType": 5126, "type": "VEC3", "count": 10_000_000}
    (tmp_path / "a.gltf").write_text(json.dumps(scene(accessors=[accessor], nodes=[{"mesh": 0}] * 1000)))
    with pytest.raises(InputError, match="10000000000 corners"):
        gltf.check(tmp_path / "a.gltf")


@pytest.mark.parametrize("shape", ["²,2,3,4,96", "9" * 5000 + ",2,3,4,96", "-1,2,3,4,96", "１,2,3,4,96"])
def test_lengths_of_odd_digits(tmp_path, shape):
    np.save(tmp_path / "a.npy", np.zeros((2, 2, 3, 4, 96), complex))
    with pytest.raises(InputError, match="shape is"):
        import_recording(tmp_path / "a.npy", tmp_path / "a.h5", Given(PRESETS["radarize"], shape=shape))


@pytest.mark.parametrize(
    "read",
    [
        Recording, read_yaml, read_tum, Log.read, carmen.scans_of,
        lambda path: import_recording(path, path.with_suffix(".h5")),
        lambda path: read_bytes(path, "bytes"),
    ],
)  # fmt: skip
def test_pipes_and_devices_are_not_waited_for(tmp_path, read):
    os.mkfifo(tmp_path / "a.npz")
    for path in (tmp_path / "a.npz", tmp_path / "zero.npz"):
        if not path.exists():
            path.symlink_to("/dev/zero")
        with pytest.raises(InputError, match="a device or a pipe"):
            read(path)
