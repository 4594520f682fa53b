"""Export of scenes as meshes: positions, sizes and materials, read by trimesh and by the project's import."""

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from radarize.io.errors import InputError
from radarsim.cli import app
from radarsim.world.export import export_scene
from radarsim.world.importers import Options, import_scene
from radarsim.world.scene import Scene


@pytest.fixture(scope="module")
def office():
    return Scene.load("office")


def areas(scene):
    found = {}
    for item in scene.objects:
        found[item.material.name] = found.get(item.material.name, 0) + item.mesh.area
    return found


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".stl", ".glb"])
def test_meshes_are_where_the_scene_is(office, tmp_path, suffix):
    path = export_scene(office, tmp_path / f"office{suffix}")
    mesh = trimesh.load(path, force="mesh")
    low, high = np.asarray(mesh.bounds)
    if suffix == ".glb":  # x, y, z of the file are x, z, -y
        low, high = np.array([low[0], -high[2], low[1]]), np.array([high[0], -low[2], high[1]])
    assert np.array([low, high]) == pytest.approx(np.asarray(office.bounds), abs=1e-4)
    assert mesh.area == pytest.approx(sum(areas(office).values()), rel=1e-4)


def test_an_exported_scene_comes_back_with_its_materials(office, tmp_path):
    """Through a file of glTF, whose materials have our names."""
    path = export_scene(office, tmp_path / "office.glb")
    back = Scene.load(import_scene(path, tmp_path / "again.yaml", Options(floor=False)).path)
    assert areas(back) == pytest.approx(areas(office), rel=1e-3)
    assert np.asarray(back.bounds) == pytest.approx(np.asarray(office.bounds), abs=1e-3)


def test_the_command_and_what_it_refuses(tmp_path):
    done = CliRunner().invoke(app, ["scene", "export", "office", "-o", str(tmp_path / "a.ply")])
    assert done.exit_code == 0 and (tmp_path / "a.ply").read_bytes().startswith(b"ply")
    with pytest.raises(InputError, match="a.dxf: is of an unknown format, expected a name that ends in .glb, .ply"):
        export_scene(Scene.load("office"), tmp_path / "a.dxf")
