"""Fuzzing of scene inputs: scenes, maps, meshes, logs, data sets, settings."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image

from radarize.pipeline.config import Configuration
from radarize.slam.config import SlamConfig
from radarsim.dataset.specification import Specification
from radarsim.motion.waypoints import read_waypoints
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.world.description import described
from radarsim.world.importers import carmen, import_scene, meshes, mitsuba
from tests.fuzzing.damage import damaged, misspelled
from tests.fuzzing.reader import Reader, clear

_SCENE = """name: a
objects:
  - {name: wall, shape: rectangle, size: [4, 3], position: [3, 0, 1.5], facing: [-1, 0, 0], material: concrete}
  - {name: pipe, shape: cylinder, radius: 0.05, height: 2, position: [2, -1, 1], rotation: [0, 0, 9], material: metal}
  - {name: odd, shape: sphere, radius: 1, material: {custom: {permittivity: 4, conductivity: 0.2}}}
moving: [{kind: person, name: visitor, path: [[1, 0], [4, 0]], speed: 1.1}]
interferers: [{name: robot, radar: {slope: 60e12}, position: [4, 0, 1], yaw: 180, velocity: [-0.5, 0, 0], start: 0.1}]
levels: [{objects: [{name: wall, material: glass}], interferers: [{name: robot, radar: two-tx}]}]
clutter: 1
"""
_DATASET = """name: d
seed: 1
buildings: {A: {kind: A, seed: 3}, o: office}
recordings:
  - {building: A, floors: [0, 1], platform: handheld, count: 2, duration: 2}
  - {building: o, platform: [cart, robot], count: 1, duration: 1, waypoints: [[1, 1], [2, 2]]}
sensors: [imu]
randomise: {clutter: {uniform: [0.7, 1.4]}, height: {cart: {normal: [1, 0.1]}, robot: 0.2}, furniture: {choice: [1, 2]}}
variants: {plain: {}, coarse: {radar: {samples: 48}, attributes: {value: 48}}}
splits: {random: {kind: random, folds: 2}, platform: {kind: platform, train: [handheld]}}
"""
_XML = (
    '<scene version="2.1.0"><shape type="cube" id="a"><transform name="to_world"><scale value="2"/></transform></shape>'
)
_LOG = "".join(f"FLASER 9 {' '.join(['2.5'] * 9)} {k} 0 0.1 {k} 0 0.1 1 a 1\n" for k in range(5))
_CUBE = trimesh.creation.box((3, 4, 2.5))


def _text(seed: str, name: str, read: Callable[[Path], object]) -> Reader:
    return _placed(misspelled([seed]), name, read)


def _log() -> Reader:
    """Scans with poses, at most as far apart as a grid of a fixed number of cells permits."""
    text = _text(_LOG, "a.log", lambda path: carmen.grid(path, 0.05))
    return Reader(text.inputs, text.place, text.read, lambda data: len(data) + (8 << 20))


def _placed(inputs, name: str, read: Callable[[Path], object]) -> Reader:
    def place(data: bytes, folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return Reader(inputs, place, read)


def a_map() -> Reader:
    """map_server's image and its description."""
    plan = np.zeros((60, 80), np.uint8)
    plan[5:-5, 5:-5] = 254

    def place(data: bytes, folder: Path) -> Path:
        Image.fromarray(plan).save(folder / "a.pgm")
        (folder / "a.yaml").write_bytes(data)
        return folder / "a.yaml"

    about = "image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    return Reader(misspelled([about]), place, _import, lambda data: len(data) + plan.size)


def _import(path: Path) -> None:
    out = path.parent / "out"
    out.mkdir()
    try:
        import_scene(path, out)
    finally:
        clear(out)


def mesh(kind: str) -> Reader:
    """Box in a format of `trimesh`."""
    data = _CUBE.export(file_type=kind)
    seed = data if isinstance(data, bytes) else data.encode()
    inputs = misspelled([seed.decode()]) if kind == "obj" else damaged([seed])
    return _placed(inputs, f"a.{kind}", meshes.parts)


def gltf() -> Reader:
    """glTF of two nodes, as text."""
    buffer = "data:application/octet-stream;base64," + "AAAA" * 12
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1]}, {"mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": 3, "bufferView": 0}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": buffer}],
    }  # fmt: skip
    return _text(json.dumps(tree), "a.gltf", meshes.parts)


def _scene(path: Path) -> None:
    from radarize.io.yamlfile import read_yaml

    data = read_yaml(path)
    for level in (0, 1):
        for item in described(data, str(path), level).objects:
            item.mesh(path.parent)


def _dataset(path: Path) -> None:
    assert Specification.load(path).as_data()


#: By name, as `radarize`'s.
WORLDS: dict[str, Callable[[], Reader]] = {
    "scene": lambda: _text(_SCENE, "a.yaml", _scene),
    "data set": lambda: _text(_DATASET, "a.yaml", _dataset),
    "map": a_map,
    "obj": lambda: mesh("obj"),
    "ply": lambda: mesh("ply"),
    "stl": lambda: mesh("stl"),
    "glb": lambda: mesh("glb"),
    "gltf": gltf,
    "Mitsuba": lambda: _text(_XML + "</scene>", "a.xml", mitsuba.parts),
    "CARMEN log": _log,
    "way-points": lambda: _text("waypoints:\n- [1, 2]\n- [3.5, 4]\n", "a.yaml", read_waypoints),
    "front end": lambda: _text(
        "noise_figure_db: 12\n", "a.yaml", lambda path: FrontEndConfig.load(path, "iwr1843boost")
    ),
    "SLAM settings": lambda: _text("grid: {nodes: 10, resolution: 0.05}\n", "a.yaml", SlamConfig.load),
    "settings": lambda: _text(Configuration().text(), "a.yaml", Configuration.load),
}
