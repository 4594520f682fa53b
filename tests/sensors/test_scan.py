"""Occupancy labels: closed form, levelled, and in agreement with the depth camera."""

import numpy as np
import pytest

from radarsim.motion.planner import plan_motion
from radarsim.motion.trajectory import Motion
from radarsim.scenario import Scenario
from radarsim.sensors.depth import MOUNT, QUARTER, DepthCamera
from radarsim.sensors.scan import AZIMUTHS, Cell, Occupancy, PlanarScan
from radarsim.world.scene import Scene
from tests.sensors.mounting import CONFIG, beside, box, rows

WALL = box("wall", [2.0, -20, 0], [2.2, 20, 3])


def label(motion, *objects, config=CONFIG):
    return rows(Occupancy(beside(motion, *objects, config=config)), 0, 1)["truth/occupancy"][0]


def test_a_wall_is_where_it_is():
    """Free in front of the wall, unknown behind it, at any tilt of the sensor: the plane is horizontal."""
    for pitch, roll in ((0, 0), (0.15, -0.2)):
        states = label(Motion.still((0, 0, 1), pitch=pitch, roll=roll), WALL)
        for column, azimuth in enumerate(AZIMUTHS):
            surface = np.flatnonzero(states[:, column] == Cell.SURFACE)
            expected = 2.0 / np.cos(azimuth + np.deg2rad([-0.5, 0.5])) / CONFIG.range_resolution
            assert surface.min() >= np.floor(expected.min() + 0.5) - 1e-9
            assert surface.max() <= np.floor(expected.max() + 0.5) + 1e-9
            assert np.all(states[: surface.min(), column] == Cell.FREE)
            assert np.all(states[surface.max() + 1 :, column] == Cell.UNKNOWN)


def test_left_is_in_later_columns():
    states = label(Motion.still((0, 0, 1)), box("post", [1.9, 0.6, 0], [2.1, 0.8, 3]))
    columns = np.flatnonzero((states == Cell.SURFACE).any(axis=0))
    assert np.all(AZIMUTHS[columns] > np.deg2rad(14)) and np.all(AZIMUTHS[columns] < np.deg2rad(24))
    assert np.all(states[:, AZIMUTHS < 0] == Cell.FREE)


def test_the_range_bias_moves_surfaces_to_where_the_radar_has_them():
    config = CONFIG.model_copy(update={"range_bias": 5 * CONFIG.range_resolution})
    plain, moved = label(Motion.still((0, 0, 1)), WALL), label(Motion.still((0, 0, 1)), WALL, config=config)
    assert np.array_equal(moved[5:], plain[:-5])


def test_labels_agree_with_the_depth_camera():
    """Points of exact depth pictures within 2 cm of the sensor's plane lie in surface cells, and in no free one."""
    scene = Scene.load("office")
    motion = plan_motion(scene, "handheld", 6.0, np.random.default_rng(4))
    where = Scenario(scene, motion, CONFIG)
    some = where.frames(np.arange(30, 160, 16) * CONFIG.frame_period)
    states = Occupancy(where).observe(some)["truth/occupancy"]
    scan = PlanarScan(where).observe(some)["truth/scan"]
    instants = some.middles
    depth = DepthCamera(where).depth(instants).reshape(len(states), -1)
    points = QUARTER.rays.reshape(1, -1, 3) * depth[..., None] + MOUNT
    agree, free, close = [], [], []
    for k, rotation in enumerate(motion.rotation(instants)):
        level = rotation.apply(points[k][np.isfinite(depth[k])])
        level = level[np.abs(level[:, 2]) < 0.02]
        forward = rotation.apply([1.0, 0, 0])
        bearing = np.arctan2(level[:, 1], level[:, 0]) - np.arctan2(forward[1], forward[0])
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
        distance = np.hypot(level[:, 0], level[:, 1])
        column = np.rint((bearing - AZIMUTHS[0]) / np.deg2rad(1)).astype(int)
        cell = np.rint(distance / CONFIG.range_resolution).astype(int)
        inside = (column >= 0) & (column < len(AZIMUTHS)) & (cell < CONFIG.samples - 1)
        column, cell, distance = column[inside], cell[inside], distance[inside]
        near = np.stack([states[k, np.clip(cell + d, 0, 95), column] == Cell.SURFACE for d in (-1, 0, 1)])
        agree.append(near.any(axis=0))
        free.append((states[k, cell, column] == Cell.FREE) & ~near.any(axis=0))
        close.append(np.abs(scan[k, column] - distance) < 0.1)
    assert len(np.concatenate(agree)) > 1000
    assert np.mean(np.concatenate(agree)) > 0.97
    assert np.mean(np.concatenate(free)) < 0.02
    assert np.mean(np.concatenate(close)) > 0.93


def test_rotation_is_taken_from_the_boresight():
    """For a sensor rotated to the left, the wall's nearest point is on its right."""
    states = label(Motion.still((0, 0, 1), yaw=np.deg2rad(20)), WALL)
    surface = states == Cell.SURFACE
    first = np.where(surface.any(axis=0), surface.argmax(axis=0), len(states))
    nearest = AZIMUTHS[first == first.min()].mean()
    assert nearest == pytest.approx(np.deg2rad(-20), abs=np.deg2rad(2))
