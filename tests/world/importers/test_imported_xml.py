"""Mitsuba and Sionna RT scenes: the installed ones against Sionna's own loader, transforms, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarsim.world import shapes
from radarsim.world.importers import Options, import_scene
from radarsim.world.scene import Scene


def shipped(name: str) -> Path:
    import sionna.rt

    return Path(sionna.rt.__file__).parent / "scenes" / name / f"{name}.xml"


@pytest.mark.parametrize(
    ("name", "materials"),
    [
        ("box", {"metal"}),
        ("box_two_screens", {"metal", "glass"}),
        ("floor_wall", {"concrete", "brick"}),
        ("simple_street_canyon", {"concrete", "brick", "glass", "marble", "wood"}),
    ],
)
def test_sionna_scenes(tmp_path, name, materials):
    """Same extent, shapes and materials as loaded by Sionna RT."""
    import sionna.rt

    done = import_scene(shipped(name), tmp_path, Options(floor=False))
    loaded = Scene.load(done.path)
    theirs = sionna.rt.load_scene(str(shipped(name)), merge_shapes=False)
    box = theirs.mi_scene.bbox()
    assert loaded.bounds == pytest.approx(np.array([np.ravel(box.min), np.ravel(box.max)]), abs=1e-3)
    assert {item.name for item in loaded.objects} == set(theirs.objects)
    ours = {item.name: item.material.name for item in loaded.objects}
    for key, item in theirs.objects.items():
        assert ours[key] == item.radio_material.itu_type.replace("_", " ")
    assert set(ours.values()) == materials


def test_a_city_stays_in_metres(tmp_path):
    done = import_scene(shipped("munich"), tmp_path)
    assert len(done.rows) > 2000
    assert any("1.48e+03 m long, unusual" in remark for remark in done.remarks)


XML = """<scene version="2.1.0"><default name="wide" value="2"/>
<bsdf type="twosided" id="mat-itu_glass"><bsdf type="diffuse"/></bsdf>
<bsdf type="radio-material" id="odd"><float name="relative_permittivity" value="3.5"/>
  <float name="conductivity" value="0.2"/></bsdf>
{}</scene>"""


def test_shapes_and_transforms(tmp_path):
    shapes.box((0.5, 0.5, 0.5), (1, 1, 1)).export(tmp_path / "unit.ply")
    (tmp_path / "a.xml").write_text(
        XML.format("""
<shape type="rectangle" id="pane"><ref id="mat-itu_glass"/>
  <transform name="to_world"><scale x="$wide" y="1.5"/><rotate x="1" angle="90"/>
  <translate value="5 0 1.5"/></transform>
</shape>
<shape type="cube" id="block"><ref id="odd" name="bsdf"/>
  <transform name="to_world"><scale value="0.5"/><rotate z="1" angle="45"/>
  <translate x="1" z="0.5"/></transform></shape>
<shape type="ply" id="mesh-unit"><string name="filename" value="unit.ply"/><bsdf type="diffuse" id="itu_brick"/>
  <transform name="to_world"><matrix value="-1 0 0 4  0 1 0 0  0 0 1 0  0 0 0 1"/></transform></shape>
<shape type="sphere" id="ball"><float name="radius" value="0.5"/><point name="center" x="0" y="8" z="1"/></shape>
<shape type="cylinder" id="post"><float name="radius" value="0.1"/><point name="p0" x="0" y="-3" z="0"/>
  <point name="p1" x="0" y="-3" z="2"/></shape>
<shape type="disk" id="lid"><transform name="to_world"><translate x="9" z="2"/></transform></shape>""")
    )
    done = import_scene(tmp_path / "a.xml", tmp_path / "out", Options(floor=False, default="wood"))
    items = {item.name: item for item in Scene.load(done.path).objects}
    assert items["pane"].material.name == "glass" and items["unit"].material.name == "brick"
    assert items["block"].material.permittivity_at(77e9).real == pytest.approx(3.5)
    assert items["pane"].mesh.bounds == pytest.approx(np.array([[3, 0, 0], [7, 0, 3]]), abs=1e-6)
    assert np.ptp(items["block"].mesh.bounds, axis=0) == pytest.approx([np.sqrt(2), np.sqrt(2), 1])
    assert items["unit"].mesh.bounds == pytest.approx(np.array([[3, 0, 0], [4, 1, 1]]), abs=1e-6)
    assert items["unit"].mesh.volume == pytest.approx(1)  # mirrored, but not inside out
    assert items["ball"].mesh.bounds.mean(axis=0) == pytest.approx([0, 8, 1], abs=1e-2)
    assert items["post"].mesh.bounds[:, 2] == pytest.approx([0, 2])
    assert items["lid"].mesh.area == pytest.approx(np.pi, rel=0.01)


CUBE = '<shape type="cube" id="c">{}</shape>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<scene><shape", "is not readable XML"),
        ("<html/>", "its root is <html>, expected <scene>"),
        ("<scene/>", "holds no shape"),
        ('<!DOCTYPE scene [<!ENTITY a "b">]><scene>&a;</scene>', "declares a document type"),
        ('<!DOCTYPE scene [<!ENTITY a SYSTEM "file:///etc/passwd">]><scene>&a;</scene>', "declares a document type"),
        ('<scene><shape type="ply" id="w"><string name="filename" value="no.ply"/></shape></scene>',
         "shape 'w': file .*no.ply does not exist"),
        ('<scene><shape type="serialized" id="w"/></scene>', "shape 'w': is of type 'serialized', expected ply"),
        ("<scene>" + CUBE.format("<transform><lookat/></transform>") + "</scene>", "shape 'c': .*<lookat>"),
        ("<scene>" + CUBE.format('<transform><matrix value="1 2"/></transform>') + "</scene>", "has 2 numbers"),
        ("<scene>" + CUBE.format('<transform><scale value="x"/></transform>') + "</scene>", "shape 'c': .*'x'"),
    ],
)  # fmt: skip
def test_mistakes_get_one_sentence(tmp_path, text, message):
    (tmp_path / "a.xml").write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        import_scene(tmp_path / "a.xml", tmp_path / "out")
    assert "\n" not in str(caught.value)
