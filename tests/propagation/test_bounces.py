"""Echoes over mirrors only, against rays shot into the office: existence and strength of corner reflections."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.references.brute_force import bounced, fan
from benchmarks.references.corners import looking
from benchmarks.references.rigs import isotropic
from radarize.radar.presets import PRESETS
from radarsim.propagation.environment import Environment, View
from radarsim.propagation.mechanisms import image_chains
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import span

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def office():
    """The office with an additional cabinet and without door frames, all of metal, and its reflectors."""
    cabinet = SceneObject(
        "one more", span((8.7123, 6.458, 0.0), (9.7123, 6.98, 1.6), ("-z",)), MATERIALS["metal"], True
    )
    office = [
        replace(item, material=MATERIALS["metal"])
        for item in Scene.of({"building": {"kind": "office", "seed": 7}, "clutter": 0, "unevenness": 0}, "o").objects
        if not item.name.endswith("frame")
    ]
    scene = Scene("metal", [*office, cabinet])
    return scene, Reflectors.of(scene, CONFIG)


def by_chains(office, position, axis, spread, bounces):
    """Amplitude of all chains of a number of mirrors within a fan, weighted like its rays."""
    scene, reflectors = office
    level = axis * [1, 1, 0] / np.hypot(axis[0], axis[1])
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    environment = Environment.of(scene, nothing, reflectors, CONFIG)
    found = image_chains.find(View(environment, isotropic(position, LAMBDA, looking(level), 7.0)))
    away = np.einsum("pij,j->pi", found.images[..., :3], position) + found.images[..., 3] - position
    path, ahead = np.linalg.norm(away, axis=1), away @ axis
    off = np.linalg.norm(np.cross(away, axis), axis=1) / np.where(ahead > 0, ahead, 1e-9)
    return np.sum((found.amplitude * np.exp(2j * np.pi * path / LAMBDA) * fan(off, spread))[found.bounces == bounces])


HERE, THERE = np.array([8.3705, 5.6786, 1.1985]), np.array([10.4405, 6.1516, 1.1822])


@pytest.mark.parametrize(
    ("position", "target", "bounces"),
    [
        (HERE, (8.712, 7.0, 1.1985), 2),  # a cabinet's side and the wall
        (HERE, (8.3705, 7.0, 0.0), 2),  # wall and floor
        (THERE, (10.4405, 5.0, 2.7), 2),  # wall and ceiling
        (THERE, (10.4405, 5.0, -1.52), 3),  # floor, wall and ceiling
    ],
)
def test_corners_that_there_are(office, position, target, bounces):
    """Corner reflections are within 1.5 dB of physical optics on the last surface that rays meet."""
    axis = (np.array(target) - position) / np.linalg.norm(np.array(target) - position)
    truth = bounced(office[0], position, UP, axis, 0.2, bounces, LAMBDA)
    found = by_chains(office, position, axis, 0.2, bounces)
    assert 20 * np.log10(abs(found / truth)) == pytest.approx(0, abs=1.5)


@pytest.mark.parametrize(
    ("position", "edge", "spread"),
    [
        (HERE, (8.712, 6.48, 1.1985), 0.1),  # of the cabinet
        (HERE, (4.69, 5.0, 1.1985), 0.05),  # of doorways
        (THERE, (4.69, 5.0, 1.1822), 0.05),
        (THERE, (12.94, 7.0, 1.1822), 0.05),
    ],
)
def test_outer_edges_are_no_corners(office, position, edge, spread):
    """No ray comes back over both faces of an outer edge: 20 dB and more below what a corner there would return.

    At these edges chains return nothing, in fans of 0.05 and 0.1, with door frames and without. Only the rays of the
    reference are over the limit, about the doorway: a fan of 0.1 returns 0.12 to 0.19 of a corner, one of 0.05 at most
    0.02. So it comes from what the wider fan takes in beside the edge; which surface that is was not looked for.
    """
    distance = np.linalg.norm(edge - position)
    axis, corner = (edge - position) / distance, LAMBDA / (8 * np.pi * distance)
    assert abs(bounced(office[0], position, UP, axis, spread, 2, LAMBDA)) < 0.1 * corner
    assert abs(by_chains(office, position, axis, spread, 2)) < 0.1 * corner
