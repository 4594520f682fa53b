"""Pedestrians: in the radar's view, not on its path, and not in walls."""

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from radarsim.motion.pedestrians import with_pedestrians
from radarsim.motion.walk import Walk
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene
from tests.motion.distances import column, least_distance, obstacles

TIMES = np.arange(0, 20, 0.07)


@pytest.fixture(scope="module")
def walk():
    scene = Scene.of({"building": {"kind": "B", "seed": 11}}, "b11")
    return scene, Walk("handheld", 20.0).through(scene, 3)


def places(scene: Scene) -> np.ndarray:
    """Positions of people's trunks, (person, time, 3), m."""
    return np.stack([who.poses(TIMES)[1][:, 0] for who in scene.movers])


def test_people_keep_their_distance(walk):
    scene, motion = walk
    busy = with_pedestrians(scene, motion, 3, 3)
    people = places(busy)
    assert len(people) == 3 and not scene.movers and busy.objects == scene.objects
    radar = motion.position(TIMES)
    apart = np.linalg.norm((people - radar)[..., :2], axis=2)
    assert apart.min() >= 0.55 and (apart.min(axis=1) < 4.0).all()  # in reach of the preset, each
    # Some walk, and none through walls or furniture: a trunk's half width is 0.16 m.
    assert np.ptp(people[..., :2], axis=1).max() > 1.5
    for person in people:
        standing = column(person[::10, :2], 0.5, 1.7, 0.2)
        assert least_distance(standing, obstacles(scene)).min() > 0.16
    assert np.array_equal(places(with_pedestrians(scene, motion, 3, 3)), people)
    assert not np.array_equal(places(with_pedestrians(scene, motion, 3, 4)), people)


def test_somebody_is_seen(walk):
    scene, motion = walk
    plain, busy = (
        Scenario(each, motion, PRESETS["radarize"], seed=3, sensors=())
        for each in (scene, with_pedestrians(scene, motion, 3, 3))
    )
    from radarsim.sensors.scan import PlanarScan

    times = np.arange(0, 19.5, 0.5)
    empty, full = (PlanarScan(each).observe(each.frames(times))["truth/scan"] for each in (plain, busy))
    nearer = full < empty - 0.3
    assert nearer.any() and not (full > empty + 1e-3).any()


def test_none_is_none_and_a_full_room_is_an_error(walk):
    scene, motion = walk
    assert with_pedestrians(scene, motion, 0, 3) is scene
    floor = {"name": "floor", "shape": "rectangle", "size": [2.2, 2.2], "facing": [0, 0, 1], "material": "concrete"}
    cell = Scene.of({"objects": [floor]}, "cell")
    to_and_fro = Walk("handheld", 2.0, waypoints=np.array([[0.0, 0.0], [0.1, 0.0]])).through(cell, 0)
    with pytest.raises(InputError, match="scene cell: has room for 0 people beside the radar's path, expected 2"):
        with_pedestrians(cell, to_and_fro, 2, 0)
