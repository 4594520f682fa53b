"""Rooms are distinguished from solids, and the up axis is found, whatever a file's faces and axes are."""

import numpy as np
import pytest
import shapely
import trimesh

from benchmarks.references.rigs import field
from radarize.io.console import run
from radarize.radar.presets import PRESETS
from radarsim.cli import app
from radarsim.motion.planner import plan_motion
from radarsim.motion.trajectory import Motion
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.clearance import ground_level
from radarsim.world.importers import Options, import_scene
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
ROOM = shapes.box((3, 2, 1.35), (6, 4, 2.7))


def inside_out(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def brought(tmp_path, *meshes, **options):
    """Import meshes from one PLY file."""
    shapes.joined(*meshes).export(tmp_path / "place.ply")
    return import_scene(tmp_path / "place.ply", tmp_path / "out", Options(**options))


@pytest.mark.parametrize("inwards", [False, True])
def test_a_closed_box_is_a_room(tmp_path, inwards):
    """It is accessible, and its wall echoes like an infinite plane of concrete."""
    done = brought(tmp_path, inside_out(ROOM) if inwards else ROOM)
    assert [row.material for row in done.rows] == ["concrete"]
    assert any("treated as a room" in remark for remark in done.remarks) != inwards
    scene = Scene.load(done.path)
    motion = plan_motion(scene, "handheld", 3.0, np.random.default_rng(0))
    assert isinstance(motion, Motion)
    place = np.array([3.0, 2.0, 1.2])
    finder = PathFinder(scene, Scatterers.points(np.zeros((0, 3)), np.zeros(0)), Reflectors.of(scene, CONFIG), CONFIG)
    echoes = finder(place, np.eye(3))
    away = np.linalg.norm(place - echoes.images[:, :, :3] @ place - echoes.images[:, :, 3], axis=1)
    ahead = np.abs(echoes.amplitude[np.abs(away - 6.0) < 1e-6]).max()
    assert away.min() > 2  # no echo of what lies outside
    gamma = abs(scene.objects[0].material.fresnel(np.array(1.0), CONFIG.center_frequency)[0])
    gamma *= scene.objects[0].material.coherent_factor(np.array(1.0), CONFIG.center_frequency)
    gain = 10 ** (10.5 / 10)
    assert 20 * np.log10(ahead / (gain * CONFIG.wavelength * gamma / (4 * np.pi * 6.0))) == pytest.approx(0, abs=0.3)
    assert abs(field(echoes, place, CONFIG.wavelength)) > 0


def test_solids_stay_solid(tmp_path):
    """Walls with cavities, extruded walls, a block beside another one, and furniture in a room."""
    outer, cavity = shapes.box((3, 2, 1.35), (6.4, 4.4, 3.1)), inside_out(ROOM)
    cabinet = shapes.box((1, 3, 0.5), (0.8, 0.4, 1.0))
    ring = shapes.joined(outer, cavity)
    ground = shapely.box(0, 0, 6, 4) - shapely.box(0.2, 0.2, 5.8, 3.8)
    walls = trimesh.creation.extrude_polygon(ground, 2.7)
    for case, meshes in {
        "cavity": (ring,), "walls": (walls,), "blocks": (ROOM, shapes.box((20, 2, 3), (6, 4, 6))), "crate": (cabinet,)
    }.items():  # fmt: skip
        folder = tmp_path / case
        folder.mkdir()
        done = brought(folder, *meshes, floor=False)
        given, found = shapes.joined(*meshes), Scene.load(done.path).objects[0].mesh
        assert found.volume == pytest.approx(given.volume, rel=1e-4), case
    done = brought(tmp_path, ROOM, cabinet)
    assert Scene.load(done.path).objects[0].mesh.volume == pytest.approx(cabinet.volume - ROOM.volume, rel=1e-4)


def lying(mesh, up):
    """Mesh with z up converted to a file's other up axis."""
    return mesh if up == "z" else trimesh.Trimesh(mesh.vertices[:, [0, 2, 1]] * [1, 1, -1], mesh.faces, process=False)


@pytest.mark.parametrize("suffix", ["obj", "glb"])
@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize(
    ("place", "why"),
    [
        (shapes.box((3, 2, 1.35), (6, 4, 2.7)), "shorter"),
        (shapes.box((1, 1, 1.35), (1.5, 2.6, 2.7), without=("+z",)), "no ceiling"),
        (shapes.box((1, 1, 1.35), (6, 2.6, 2.7), without=("+y", "-y")), "alone has a floor"),
    ],
)
def test_up_is_estimated_from_the_mesh(tmp_path, suffix, up, place, why):
    lying(place, up).export(tmp_path / f"place.{suffix}")
    done = import_scene(tmp_path / f"place.{suffix}", tmp_path / "out", Options(units="m"))
    assert np.ptp(Scene.load(done.path).bounds, axis=0) == pytest.approx(np.ptp(place.bounds, axis=0), abs=1e-5)
    assert any(f"{up} is taken as up" in remark and why in remark for remark in done.remarks)
    other = import_scene(
        tmp_path / f"place.{suffix}", tmp_path / "other", Options(units="m", up="z" if up == "y" else "y")
    )
    size = np.ptp(Scene.load(other.path).bounds, axis=0)
    assert size == pytest.approx(np.ptp(place.bounds, axis=0)[[0, 2, 1]], abs=1e-5)


def test_where_the_mesh_is_not_conclusive_the_format_decides(tmp_path):
    cube = shapes.box((0, 0, 0), (5, 3, 3))
    for suffix, up in (("obj", "z"), ("glb", "y")):
        cube.export(tmp_path / f"cube.{suffix}")
        remarks = import_scene(tmp_path / f"cube.{suffix}", tmp_path / suffix).remarks
        assert any(f"{up} is taken as up (usual" in remark for remark in remarks)


def test_a_scene_without_echoes_is_refused(tmp_path, capsys):
    """A radar inside a block of concrete gives an error message."""
    ROOM.export(tmp_path / "block.ply")
    (tmp_path / "block.yaml").write_text("objects: [{name: block, shape: mesh, file: block.ply, material: concrete}]\n")
    line = ["simulate", str(tmp_path / "block.yaml"), "-o", str(tmp_path / "a.h5"), "--duration", "1"]
    with pytest.raises(SystemExit) as exit_:
        run(app, "radarsim", line)
    assert exit_.value.code == 2
    printed = " ".join(capsys.readouterr().err.split())
    assert "block: no frame has an echo, expected surfaces" in printed and not (tmp_path / "a.h5").exists()


def walls_of_a_room():
    return shapes.joined(
        *(shapes.box(middle, size) for middle, size in (
            ((3, -0.05, 1.3), (6, 0.1, 2.6)), ((3, 4.05, 1.3), (6, 0.1, 2.6)),
            ((-0.05, 2, 1.3), (0.1, 4, 2.6)), ((6.05, 2, 1.3), (0.1, 4, 2.6)),
        ))
    )  # fmt: skip


@pytest.mark.parametrize("table", [False, True])
def test_a_room_without_a_floor_gets_one(tmp_path, table):
    """It stays at its position, and a walk is inside it, not on its roof."""
    meshes = [walls_of_a_room(), shapes.box((3, 2, 2.65), (6.2, 4.2, 0.1))]
    done = brought(tmp_path, *meshes, *([shapes.box((1, 1, 0.75), (1.2, 0.6, 0.05))] if table else []))
    assert not any("moved by" in remark for remark in done.remarks)
    assert any("has a ceiling 2." in remark and "no floor: a floor is added" in remark for remark in done.remarks)
    scene = Scene.load(done.path)
    assert ground_level(scene) == 0 and scene.bounds[1, 2] == pytest.approx(2.7)
    motion = plan_motion(scene, "handheld", 3.0, np.random.default_rng(0))
    height = motion.position(np.linspace(0, 3, 20))[:, 2]
    assert ((height > 0.5) & (height < 2.2)).all()


def test_walls_alone_stand_on_the_ground(tmp_path):
    done = brought(tmp_path, walls_of_a_room().apply_translation((0, 0, 1)))
    assert Scene.load(done.path).bounds[0, 2] == pytest.approx(0)
