"""Rays against moving objects, compared with Open3D's casts on the same shapes as meshes."""

import numpy as np
import open3d as o3d
import pytest
import trimesh

from radarsim.motion.trajectory import Motion
from radarsim.world.movers import Door, Person
from tests.sensors.mounting import beside


@pytest.mark.parametrize(
    "mover",
    [
        Person(name="a", path=[(3.0, -1.0), (3.0, 1.0)], speed=1.2),
        Door(name="b", hinge=(2.5, 0.3, 1.0), width=0.9, height=2.0, angles=(0, 110), period=3.0),
    ],
)
def test_movers_are_met_where_they_are(mover):
    sight = beside(Motion.still((0, 0, 1)), movers=[mover]).rays
    rng = np.random.default_rng(0)
    aim = np.array([3.0, 0.0, 1.0]) + rng.normal(0, [0.3, 0.6, 0.5], (4000, 3)) - [0, 0, 1]
    ways = aim / np.linalg.norm(aim, axis=1, keepdims=True)
    for t in (0.0, 0.6, 1.3):
        found = sight.distance(np.array([[0, 0, 1.0]]), ways[None], np.array([t]))[0]
        turn, center = mover.poses(np.array([t]))
        caster = o3d.t.geometry.RaycastingScene()
        for part, r, c in zip(mover.parts(), turn[0], center[0], strict=True):
            if part.capsule:
                mesh = trimesh.creation.capsule(2 * part.half[2], part.half[0], count=[64, 64])
                mesh.apply_translation(-mesh.bounds.mean(axis=0))
            else:
                mesh = trimesh.creation.box(2 * np.asarray(part.half))
            place = np.eye(4)
            place[:3, :3], place[:3, 3] = r, c
            mesh.apply_transform(place)
            caster.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
        rays = np.hstack([np.tile([0, 0, 1.0], (len(ways), 1)), ways]).astype(np.float32)
        expected = caster.cast_rays(rays)["t_hit"].numpy()
        hit = np.isfinite(found) & np.isfinite(expected)
        assert hit.sum() > 200
        assert np.mean(np.isfinite(found) == np.isfinite(expected)) > 0.99  # outlines of a mesh are polygons
        assert np.median(np.abs(found[hit] - expected[hit])) < 1e-3
        assert np.mean(np.abs(found[hit] - expected[hit]) < 0.01) > 0.99


def test_cameras_look_through_a_glass_door_that_moves():
    """Transparent to cameras like a static pane; a lidar detects it, and a camera detects a wooden one."""
    way, met = np.array([[[1.0, 0.0, 0.0]]]), []
    for material, through_glass in (("glass", True), ("glass", False), ("wood", True)):
        leaf = Door(name="d", hinge=(2.0, -0.4, 1.0), angles=(90, 90), thickness=0.02, material=material)
        sight = beside(Motion.still((0, 0, 1)), movers=[leaf]).rays
        met.append(sight.distance(np.array([[0, 0, 1.0]]), way, np.zeros(1), through_glass)[0, 0])
    assert met[0] > 2.5 and met[1:] == pytest.approx([1.99, 1.99])
