"""What motion explains of a walk through a room, and what it does not."""

import numpy as np
import pytest

from benchmarks.steadiness import CONFIG, changes
from radarsim.motion.walk import Walk
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.paths import Paths
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    scene = Scene.load("physics/room")
    places = np.array([[-0.8, 0.0], [0.4, 0.5]])
    return Scenario(scene, Walk("cart", 1.0, waypoints=places).through(scene, 0), CONFIG)


def test_a_room_is_steady(scenario):
    assert changes(scenario, scenario.times[:8]).max() < -25


def test_what_becomes_weaker_is_not(scenario, monkeypatch):
    """Half of the amplitude in every other frame: a quarter of the power is gone, or as much as there was comes."""
    batch = PathFinder.batch

    def every_other(finder, *poses) -> list[Paths]:
        found = batch(finder, *poses)
        for echoes in found[1::2]:
            echoes.amplitude[:] /= 2
        return found

    monkeypatch.setattr(PathFinder, "batch", every_other)
    assert changes(scenario, scenario.times[:4]) == pytest.approx([-6.0, 0.0, -6.0], abs=0.5)
