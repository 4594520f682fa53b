"""Contents of the preview pictures."""

import numpy as np
import pytest
import shapely
from PIL import Image

from radarsim.world import shapes
from radarsim.world.materials import material
from radarsim.world.objects import SceneObject
from radarsim.world.preview.figures import preview
from radarsim.world.preview.rendering import render
from radarsim.world.preview.section import Section
from radarsim.world.scene import Scene


def test_pictures(tmp_path):
    room = Scene.load("physics/room")
    paths = preview(room, tmp_path / "new", width=300, samples=2)
    assert [p.name for p in paths] == ["room.plan.png", "room.view.png"]
    assert all(p.stat().st_size > 2000 for p in paths)
    assert Image.open(paths[1]).width == 300


def test_view_looks_into_the_rooms(office):
    import mitsuba as mi

    before = mi.variant()
    picture = render(office, width=240, samples=8)
    assert mi.variant() == before
    assert picture.min() >= 0 and picture.max() <= 1
    carpet = (picture[..., 2] > picture[..., 0] + 0.08).mean()
    assert carpet > 0.05  # the ceiling is off: blue carpets are seen
    assert picture[0, 0].min() > 0.99  # background
    # Ray tests go on as before.
    distance, _ = office.hit(np.array([[9.0, 6.0, 1.2]]), np.array([[0.0, 0.0, -1.0]]))
    assert distance[0] == pytest.approx(1.2, abs=1e-4)


def test_section_distinguishes_inside_from_outside():
    """A square tube: its wall is filled, its bore and a sheet beside it are not."""
    outer = shapes.box((0, 0, 1), (2, 2, 2), ("-z", "+z"))
    inner = shapes.box((0, 0, 1), (1, 1, 2), ("-z", "+z"))
    inner.invert()
    tube = SceneObject("tube", shapes.joined(outer, inner), material("brick"), solid=True)
    sheet = SceneObject("sheet", shapes.rectangle((3, 0, 1), (1, 2), (1, 0, 0)), material("glass"))
    scene = Scene("x", [sheet, tube])
    section = Section.of(scene, 1.0)
    lengths = np.linalg.norm(section.lines[:, 1] - section.lines[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(8 + 4 + 1)
    ((area, owner),) = section.areas(scene)
    assert owner == 1
    assert area.area == pytest.approx(4 - 1)
    assert not area.contains(shapely.Point(0, 0))
