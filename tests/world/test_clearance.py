"""Ground level, and the nearest object."""

import numpy as np
import pytest

from radarsim.world import shapes
from radarsim.world.clearance import Clearance, ground_level, nearest
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene


def scene(**meshes) -> Scene:
    return Scene("x", [SceneObject(name, mesh, MATERIALS["wood"]) for name, mesh in meshes.items()])


def room(level: float) -> dict:
    """A slab of 0.2 m, a table, and a ceiling."""
    return {
        "slab": shapes.box((0, 0, level - 0.1), (6, 6, 0.2)),
        "table": shapes.box((1, 1, level + 0.4), (1, 1, 0.8)),
        "ceiling": shapes.box((0, 0, level + 2.8), (6, 6, 0.2)),
    }


@pytest.mark.parametrize("level", [0.0, -1.6, 7.3])
def test_ground_of_a_room_at_any_height(level):
    world = scene(**room(level))
    assert ground_level(world) == pytest.approx(level)
    clearance = Clearance.of(world, 0.03, 1.8)
    assert clearance.at([[-1.0, 1.0]])[0] == pytest.approx(1.5, abs=0.06)
    assert clearance.at([[1.0, 1.0]])[0] == 0.0


def test_no_ground_where_only_furniture_faces_up():
    boxes = {k: m for k, m in room(0.0).items() if k == "table"}
    assert ground_level(scene(**boxes, wall=shapes.box((3, 0, 1.2), (0.2, 6, 2.4)))) == 0.0


def test_nearest_names_the_thing_but_never_the_ground():
    world = scene(**room(0.0))
    distance, item = nearest(world, np.array([[0.0, 1.0, 0.2], [-2.0, -2.0, 2.3]]))
    assert distance == pytest.approx([0.5, 0.4], abs=1e-6)
    assert [world.objects[i].name for i in item] == ["table", "ceiling"]
    alone = scene(slab=shapes.box((0, 0, -0.1), (6, 6, 0.2)))
    assert nearest(alone, np.zeros((2, 3)))[0].tolist() == [np.inf, np.inf]
