"""Buildings from random seeds, and a collision-free walk through each."""

import numpy as np
import pytest

from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS
from radarsim.world.scene import Scene
from tests.motion.distances import column, least_distance, obstacles

DURATION = 30.0
SEEDS = np.random.default_rng(2024).integers(10_000, size=6)


@pytest.mark.parametrize("number", range(6))
def test_a_building_from_any_seed_can_be_walked(number):
    """All styles and platforms; distances by brute force over the building's own triangles."""
    kind, platform, seed = "ABCD"[number % 4], list(PLATFORMS)[number % 3], int(SEEDS[number])
    scene = Scene.of({"building": {"kind": kind, "seed": seed, "floor": number % 4}}, f"{kind}{seed}")
    motion = plan_motion(scene, platform, DURATION, np.random.default_rng(seed))
    carrier, things = PLATFORMS[platform], obstacles(scene)
    sensor = motion.position(np.arange(0, DURATION, 0.15))
    assert least_distance(sensor, things).min() >= 0.2
    # What carries it does not touch anything either, from the ankles to the top.
    middle = motion.path(np.arange(0, DURATION, 1.0))[:, :2]
    assert least_distance(column(middle, 0.05, carrier.top, 0.2), things).min() >= carrier.footprint
    travelled = np.linalg.norm(np.diff(sensor[:, :2], axis=0), axis=1).sum()
    assert travelled > {"handheld": 18, "cart": 12, "robot": 7}[platform]
