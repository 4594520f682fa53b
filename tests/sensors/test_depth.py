"""Depth camera against Open3D's ray casts, and its errors against their laws."""

from dataclasses import replace

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial.transform import Rotation

from radarize.radar.presets import PRESETS
from radarsim.motion.planner import plan_motion
from radarsim.motion.trajectory import Motion
from radarsim.scenario import Scenario
from radarsim.sensors.depth import MOUNT, QUARTER, STRIP, DepthCamera, Intrinsics, Stereo
from radarsim.world.description import Custom
from radarsim.world.movers import Person
from radarsim.world.scene import Scene
from tests.sensors.mounting import beside, box

NOW = np.array([0.0])


def raycast(scene: Scene, camera: Intrinsics, position, rotation: Rotation) -> np.ndarray:
    """Depth by Open3D's own pinhole rays, from the OpenCV camera frame (z forward, x right, y down)."""
    caster = o3d.t.geometry.RaycastingScene()
    for item in scene.objects:
        if item.material.name != "glass":
            caster.add_triangles(item.mesh.vertices.astype(np.float32), item.mesh.faces.astype(np.uint32))
    optical = rotation.as_matrix() @ np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = optical.T, -optical.T @ position
    intrinsic = np.array([[camera.fx, 0, camera.cx + 0.5], [0, camera.fy, camera.cy + 0.5], [0, 0, 1]])  # corners at 0
    rays = caster.create_rays_pinhole(intrinsic, extrinsic, camera.width, camera.height)
    return caster.cast_rays(rays)["t_hit"].numpy()  # its directions have unit depth


@pytest.fixture(scope="module")
def office() -> Scene:
    return Scene.load("office")


@pytest.mark.parametrize("camera", [QUARTER, STRIP])
def test_depth_is_that_of_open3d(office, camera):
    motion = plan_motion(office, "handheld", 8.0, np.random.default_rng(4))
    times = np.array([2.1, 4.7, 7.6])
    found = DepthCamera(Scenario(office, motion, PRESETS["radarize"]), camera).depth(times)
    for t, depth in zip(times[:, None], found, strict=True):
        rotation = motion.rotation(t)[0]
        expected = raycast(office, camera, motion.position(t)[0] + rotation.apply(MOUNT), rotation)
        both = np.isfinite(depth) & np.isfinite(expected)
        assert both.mean() > 0.7  # windows show the sky
        assert np.mean(np.isfinite(depth) == np.isfinite(expected)) > 0.999
        assert np.mean(np.abs(depth[both] - expected[both]) < 1e-3) > 0.998  # edges may fall to either side


def test_it_looks_where_the_radar_looks():
    """A block to the left and above is in the upper left of the picture."""
    block = box("block", [2, 0.3, 1.3], [2.2, 0.7, 1.6])
    depth = DepthCamera(beside(Motion.still((0, 0, 1)), block)).depth(NOW)[0]
    v, u = np.nonzero(np.isfinite(depth))
    assert np.median(depth[v, u]) == pytest.approx(2.0, abs=1e-4)
    assert u.max() < QUARTER.cx and v.max() < QUARTER.cy
    height = 1.3 - 1 - MOUNT[2]
    assert v.max() == pytest.approx(QUARTER.cy - QUARTER.fy * height / 2, abs=1)
    assert u.min() == pytest.approx(QUARTER.cx - QUARTER.fx * 0.7 / 2, abs=1)


def test_the_view_is_87_by_58_degrees():
    edge = QUARTER.rays[[0, -1]][:, [0, -1]]
    assert 2 * np.rad2deg(np.arctan(np.abs(edge[..., 1]).max())) == pytest.approx(87, abs=0.5)
    assert 2 * np.rad2deg(np.arctan(np.abs(edge[..., 2]).max())) == pytest.approx(58, abs=0.5)


def test_glass_is_looked_through_and_people_are_seen():
    pane, wall = box("pane", [2, -3, 0], [2.01, 3, 3], "glass"), box("wall", [4, -3, 0], [4.2, 3, 3])
    person = Person(name="someone", path=[(3.0, 0.0)], speed=0.0)
    camera = DepthCamera(beside(Motion.still((0, 0, 1)), pane, wall, movers=[person]))
    depth = camera.depth(NOW)[0]
    trunk = depth[50:60, 104:108]
    assert np.all((trunk > 2.7) & (trunk < 3.0))
    assert depth[60, 40] == pytest.approx(4.0, abs=1e-3)


@pytest.mark.parametrize("clear, seen", [(True, 4.0), (False, 2.0)])
def test_transparency_follows_from_the_material(clear, seen):
    """A pane is transparent if its material is clear; a screen's black front never is."""
    own = Custom(permittivity=2.6, thickness=3e-3, clear=clear).material("own")
    pane, wall = box("pane", [2, -3, 0], [2.01, 3, 3], "glass"), box("wall", [4, -3, 0], [4.2, 3, 3])
    camera = DepthCamera(beside(Motion.still((0, 0, 1)), replace(pane, material=own), wall))
    assert camera.depth(NOW)[0][60, 106] == pytest.approx(seen, abs=1e-3)
    screen = DepthCamera(beside(Motion.still((0, 0, 1)), box("screen", [2, -3, 0], [2.01, 3, 3], "acrylic"), wall))
    assert screen.depth(NOW)[0][60, 106] == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0, 4.0])
def test_noise_grows_with_the_square_of_the_distance(distance):
    stereo = Stereo()
    depth = np.full((4, 120, 212), distance)
    measured = stereo.measure(depth, QUARTER, np.random.default_rng(0)).astype(float) / 1000
    seen = measured > 0
    disparity = np.hypot(stereo.subpixel, stereo.step / np.sqrt(12))
    expected = distance**2 * disparity / (stereo.focal_length * stereo.baseline)
    assert measured[seen].std() == pytest.approx(np.hypot(expected, 1e-3 / np.sqrt(12)), rel=0.08)
    assert measured[seen].mean() == pytest.approx(distance, rel=0.01)
    # The strip at the left that only the left imager sees is a baseline wide.
    hidden = stereo.baseline / distance * QUARTER.fx
    empty = np.flatnonzero(seen.mean(axis=(0, 1)) == 0)
    assert len(empty) == pytest.approx(hidden, abs=1) and (not len(empty) or empty.max() == len(empty) - 1)
    assert seen[..., len(empty) :].mean() == pytest.approx(1 - stereo.dropout, abs=2e-3)


def test_things_cast_a_shadow_on_their_left():
    """An object at 1 m in front of a wall at 2 m hides baseline (1/1 - 1/2) f of the wall from one of the imagers."""
    depth = np.full((1, 60, 848), 2.0)
    depth[:, :, 400:500] = 1.0
    camera = Intrinsics.of_view(848, 60, np.deg2rad(90), np.deg2rad(20))
    measured = Stereo(dropout=0, subpixel=0).measure(depth, camera, np.random.default_rng(0))[0]
    hidden = np.flatnonzero((measured == 0).all(axis=0))
    shadow = hidden[hidden > 50]
    width = 0.05 * camera.fx / 2
    assert len(shadow) == pytest.approx(width, abs=1.5) and shadow.max() == 399
    assert np.all(measured[:, 400:] > 0)


def test_nothing_nearer_or_farther_than_it_can():
    depth = np.array([0.1, 0.19, 0.2, 5.0, 12.0, np.inf]).repeat(848).reshape(1, 6, 848)
    measured = Stereo(dropout=0).measure(depth, STRIP, np.random.default_rng(0))[0][:, 300:]
    assert (measured > 0).mean(axis=1).tolist() == [0, 0, 1, 1, 0, 0]
