"""Scene files: their meaning, and error messages of one sentence."""

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarsim.world import shapes
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings

WALL = "{name: wall, shape: rectangle, size: [4, 3], position: [3, 0, 1], facing: [-1, 0, 0], material: concrete}"


def load(folder, text):
    path = folder / "scene.yaml"
    path.write_text(text)
    return Scene.load(path)


def test_primitives(tmp_path):
    shapes.box((0, 0, 0), (100, 100, 100)).export(tmp_path / "cube.ply")
    scene = load(
        tmp_path,
        f"""
objects:
  - {WALL}
  - {{name: crate, shape: box, size: [2, 1, 1], position: [0, 0, 5], rotation: [0, 0, 90], material: wood}}
  - {{name: pipe, shape: cylinder, radius: 0.1, height: 2, position: [9, 0, 1], material: metal}}
  - {{name: ball, shape: sphere, radius: 0.5, position: [0, 9, 0],
      material: {{custom: {{permittivity: 4, conductivity: 0.2, sigma0_db: -20}}}}}}
  - {{name: scan, shape: mesh, file: cube.ply, scale: 0.01, position: [0, -9, 0], material: brick}}
""",
    )
    wall, crate, pipe, ball, scan = scene.objects
    assert scene.name == "scene"
    assert wall.mesh.face_normals[0] == pytest.approx([-1, 0, 0])
    assert np.ptp(crate.mesh.vertices, axis=0) == pytest.approx([1, 2, 1])
    assert pipe.mesh.bounds[:, 2] == pytest.approx([0, 2])
    assert ball.material.permittivity_at(77e9).real == 4 and ball.material.sigma0 == pytest.approx(0.01)
    assert np.ptp(scan.mesh.vertices, axis=0) == pytest.approx([1, 1, 1])


PLAIN = "{name: top, shape: rectangle, size: [1900, 1900], position: [0, 0, 1], facing: [0, 0, 1], material: wood}"
PLAIN += f", {PLAIN.replace('top', 'floor').replace('[0, 0, 1], f', '[0, 0, 0], f')}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("objects: [", "malformed YAML"),
        ("[1, 2]", "holds list, expected keys"),
        ("name: x", "neither objects nor a building"),
        ("objekts: []", "objekts: unknown key"),
        (f"objects: [{WALL.replace('concrete', 'unobtainium')}]", "object 'wall': unknown material 'unobtainium'"),
        (f"objects: [{WALL.replace('facing', 'facking')}]", r"objects\[0\].* \(object 'wall'\)"),
        (f"objects: [{WALL.replace('[4, 3]', '[4, -3]')}]", r"objects\[0\].size\[1\] \(object 'wall'\) is -3"),
        (f"objects: [{WALL.replace('[4, 3]', '[4, .nan]')}]", r"objects\[0\].size\[1\]"),
        (f"objects: [{WALL.replace('rectangle', 'blob')}]", r"objects\[0\].shape \(object 'wall'\) is 'blob'"),
        (f"objects: [{WALL}, {WALL}]", "two objects are named 'wall'"),
        (
            "objects: [{name: m, shape: mesh, file: gone.ply, material: wood}]",
            "object 'm': file .*gone.ply does not exist",
        ),
        ("building: {kind: castle}", "building.kind is 'castle'"),
        ("building: {kind: office, seed: x}", "building.seed is 'x'"),
        ("building: {kind: office, seed: -1}", "building.seed is -1"),
        (f"objects: [{PLAIN}]\nclutter: 10", "clutter is 10, for which 3.*e.08 objects are tried"),
        ("objects: [3]", r"objects\[0\]"),
        ("objects: 3", "objects is 3"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "scene" in message and "\n" not in message


def test_broken_mesh(tmp_path):
    (tmp_path / "bad.ply").write_bytes(b"ply\nnot a mesh")
    with pytest.raises(InputError, match="bad.ply"):
        load(tmp_path, "objects: [{name: m, shape: mesh, file: bad.ply, material: wood}]")


def test_bare_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert Scene.load("physics/wall").name == "wall"
    with pytest.raises(InputError, match="no scene 'attic'.*office"):
        Scene.load("attic")
    with pytest.raises(InputError, match="attic.yaml does not exist"):
        Scene.load("attic.yaml")
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "attic.yaml").write_text(f"objects: [{WALL}]")
    assert Scene.load("attic").name == "attic"


@pytest.mark.parametrize("name", ["wall", "plate", "room"])
def test_physics_scenes(name):
    assert Scene.load(f"physics/{name}").sionna is not None


def test_room_is_closed():
    room = Scene.load("physics/room")
    directions = np.random.default_rng(0).standard_normal((500, 3))
    distance, triangle = room.hit(np.array([0.3, 0.2, 1.4]), directions)
    assert np.isfinite(distance).all()
    assert np.all(np.sum(room.normals[triangle] * directions, axis=1) < 0)  # faces look inward


def test_movers(tmp_path):
    text = f"objects: [{WALL}]\nmoving:\n  - {{kind: person, name: visitor, path: [[1, 0], [4, 0]], speed: 1.1}}\n"
    (mover,) = load(tmp_path, text).movers
    assert mover.name == "visitor" and mover.speed == 1.1


@pytest.mark.parametrize(
    ("mover", "message"),
    [
        ("{kind: ghost, name: g}", r"moving\[0\]"),
        ("{kind: person, name: p}", r"moving\[0\].path \(object 'p'\)"),
        ("{kind: fan, name: f, center: [0, 0, 2], turns_per_second: 50}", r"turns_per_second \(object 'f'\) is 50"),
    ],
)
def test_bad_movers(tmp_path, mover, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, f"objects: [{WALL}]\nmoving: [{mover}]")


LEVELS = f"""
objects:
  - {WALL}
  - {{name: wall two, shape: box, size: [1, 1, 1], position: [0, 3, 0], material: wood}}
moving: [{{kind: person, name: guest, path: [[1, 0], [4, 0]]}}]
levels:
  - objects: [{{name: wall two, size: [2, 1, 1]}}, {{name: post, shape: sphere, radius: 1, material: metal}}]
  - objects: [{{name: "wall*", material: glass}}]
    moving: [{{name: guest, speed: 2.5}}, {{kind: person, name: other, path: [[0, 0]]}}]
"""


def test_each_level_is_laid_upon_the_one_before(tmp_path):
    plain = load(tmp_path, LEVELS)
    path = str(tmp_path / "scene.yaml")
    first, second = Scene.load(f"{path}@1"), Scene.load(f"{path}@2")
    assert [scene.name for scene in (plain, first, second)] == ["scene", "scene@1", "scene@2"]
    assert [o.name for o in plain.objects] == ["wall", "wall two"]
    assert [o.name for o in first.objects] == [o.name for o in second.objects] == ["wall", "wall two", "post"]
    assert [np.ptp(s.objects[1].mesh.vertices[:, 0]) for s in (plain, first, second)] == [1, 2, 2]
    assert [s.objects[1].material.name for s in (plain, first, second)] == ["wood", "wood", "glass"]
    assert second.objects[0].material.name == "glass" and second.objects[2].material.name == "metal"
    assert [m.speed for m in first.movers] == [1.0] and [m.speed for m in second.movers] == [2.5, 1.0]
    assert Scene.load(f"{path}@0").name == "scene"


@pytest.mark.parametrize(
    ("level", "text", "message"),
    [
        (3, LEVELS, "level is 3, expected 0 to 2"),
        (1, f"objects: [{WALL}]", "level is 1, expected 0 to 0"),
        (0, LEVELS.replace("moving: [{name", "movink: [{name"), r"levels\[1\].movink: unknown key"),
        (1, LEVELS.replace("name: wall two, size", "nam: wall two, size"), r"levels\[0\].objects\[0\].name"),
        (1, LEVELS.replace("size: [2, 1, 1]", "size: [2, 1, -1]"), r"size\[2\] \(object 'wall two'\) is -1"),
        (1, LEVELS.replace("name: wall two, size", "name: wal two, size"), r"objects\[2\] \(object 'wal two'\)"),
    ],
)
def test_mistakes_in_levels(tmp_path, level, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, text)
        Scene.load(f"{tmp_path / 'scene.yaml'}@{level}")
    assert "scene.yaml" in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        (f"objects: [{WALL}]", SurfaceSettings(0, 0)),
        (f"objects: [{WALL}]\nclutter: 0.5\nunevenness: 2", SurfaceSettings(0.5, 2)),
        (
            f"objects: [{WALL}]\nunevenness: 1\nlevels: [objects: [{{name: wall, material: wood}}]]",
            SurfaceSettings(0, 1),
        ),
        ("building: {kind: office}", SurfaceSettings(1, 1)),
        (f"objects: [{WALL}]\nbuilding: {{kind: office}}", SurfaceSettings(1, 1)),
        ("building: {kind: B, seed: 3}\nclutter: 0.5", SurfaceSettings(0.5, 1)),
        ("building: {kind: B, seed: 3}\nunevenness: 0", SurfaceSettings(1, 0)),
        ("building: {kind: office}\nclutter: 0\nunevenness: 0", SurfaceSettings(0, 0)),
    ],
)
def test_clutter_and_unevenness(tmp_path, text, settings):
    """Default 1 with a building, 0 with objects only; given values apply at every level, 0 too."""
    assert load(tmp_path, text).surface_settings == settings
    if "levels" in text:
        assert Scene.load(f"{tmp_path / 'scene.yaml'}@1").surface_settings == settings
