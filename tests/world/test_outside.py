"""Scene files that name files in other folders are refused unless the user permits it."""

import pytest
from PIL import Image

from radarize.io.errors import InputError
from radarize.io.files import OUTSIDE
from radarize.radar.cfg import write_cfg
from radarize.radar.presets import PRESETS
from radarsim.dataset.specification import Specification
from radarsim.world.importers import meshes, mitsuba, rosmap
from radarsim.world.scene import Scene

OBJ = "v 0 0 0\nv 9 0 0\nv 0 9 0\nv 0 0 3\nf 1 2 3\nf 1 2 4\n"
SCENE = "objects: [{{name: a, shape: mesh, file: {}, material: concrete}}]\n"


@pytest.fixture
def mine(tmp_path):
    """Folder of a scene, beside files that it must not read."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "a.mtl").write_text("newmtl x\n")
    (tmp_path / "a.yaml").write_text(SCENE.format("a.obj"))
    (tmp_path / "a.cfg").write_text(write_cfg(PRESETS["radarize"]))
    Image.new("L", (9, 9)).save(tmp_path / "a.png")
    (tmp_path / "mine" / "link.obj").symlink_to(tmp_path / "a.obj")
    return tmp_path / "mine"


def scene(folder, name):
    (folder / "scene.yaml").write_text(SCENE.format(name))
    return Scene.load(folder / "scene.yaml")


def a_map(folder, name):
    (folder / "map.yaml").write_text(f"image: {name.replace('obj', 'png')}\nresolution: 0.05\norigin: [0, 0, 0]\n")
    return rosmap.grid(folder / "map.yaml")


def xml(folder, name):
    shape = f'<shape type="obj"><string name="filename" value="{name}"/></shape>'
    (folder / "scene.xml").write_text(f'<scene version="2.1.0">{shape}</scene>')
    return mitsuba.parts(folder / "scene.xml")


def obj(folder, name):
    (folder / "b.obj").write_text(f"mtllib {name.replace('obj', 'mtl')}\nusemtl x\n{OBJ}")
    return meshes.parts(folder / "b.obj")


def dataset(folder, name, **more):
    (folder / "set.yaml").write_text(
        f"name: d\nbuildings: {{b: {more.get('building', name.replace('obj', 'yaml'))}}}\n"
        f"radar: {more.get('radar', 'radarize')}\n"
        "recordings: [{building: b, platform: cart, count: 1, duration: 1}]\n"
    )
    return Specification.load(folder / "set.yaml")


def radar(folder, name):
    return dataset(folder, name, building="office", radar=name.replace("obj", "cfg"))


@pytest.mark.parametrize("read", [scene, a_map, xml, obj, dataset, radar])
def test_outside(mine, monkeypatch, read):
    for name in ("../a.obj", str(mine.parent / "a.obj")):
        with pytest.raises(InputError, match="names .*outside of .*--allow-outside permits it"):
            read(mine, name)
    monkeypatch.setenv(OUTSIDE, "1")
    assert read(mine, "../a.obj")


def test_a_link_that_leads_outside(mine):
    with pytest.raises(InputError, match="--allow-outside"):
        scene(mine, "link.obj")


@pytest.mark.parametrize("name", ["office", "stress/corner", "corridor"])
def test_what_comes_with_the_project_is_named_from_anywhere(mine, monkeypatch, name):
    monkeypatch.chdir(mine)
    assert dataset(mine, name).tasks
