"""Panes and hollow bodies over the sweep, against the transfer matrix: where a pane echoes, and where a rear leaf."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from tests.propagation.brute_force import transfer_matrix

CONFIG = PRESETS["radarize"]
BOARD = MATERIALS["plasterboard"]
NEAR, DEEP = 2.0, 0.1
SWEEP = CONFIG.center_frequency + CONFIG.bandwidth * ((np.arange(CONFIG.samples) + 0.5) / CONFIG.samples - 0.5)
RANGES = NEAR + np.arange(-0.1, 0.3, 0.0005)


def echoes(*objects):
    """What faces the radar at the origin."""
    scene = Scene("hollow", list(objects))
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    return PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC)(np.zeros(3), np.eye(3))


def profile(spectrum):
    """Level over range of a beat signal, dB."""
    turns = np.exp(-4j * np.pi / SPEED_OF_LIGHT * SWEEP * RANGES[:, None])
    return 20 * np.log10(np.abs(turns @ (spectrum * np.hanning(len(SWEEP)))))


def reflected(layers):
    """Range profile of layers (permittivity, thickness) by their transfer matrix at each frequency, dB."""
    gamma = np.array([transfer_matrix(layers, 1.0, f, False)[1] for f in SWEEP])
    return profile(np.conj(gamma) * np.exp(4j * np.pi / SPEED_OF_LIGHT * SWEEP * NEAR) / NEAR)


def simulated(*objects):
    """Range profile of what faces the radar, dB, over an endless conductor's echo times its distance."""
    found = echoes(*objects)
    path = np.linalg.norm(found.images[:, :, 3], axis=1)
    facing = path < 2 * (NEAR + 2 * DEEP)
    turns = np.exp(2j * np.pi / SPEED_OF_LIGHT * SWEEP[:, None] * path[facing])
    return profile(8 * np.pi / CONFIG.wavelength * turns @ found.amplitude[facing])


def stud_wall():
    """Range profiles of a wall of two boards, 10 cm deep: by transfer matrices at each frequency, and simulated, dB."""
    layers = [(BOARD.permittivity_at(CONFIG.center_frequency), BOARD.thickness), (1.0, DEEP - 2 * BOARD.thickness)]
    wall = SceneObject("wall", shapes.box((NEAR + DEEP / 2, 0, 0), (DEEP, 6, 6)), BOARD)
    return reflected([*layers, layers[0]]), simulated(wall)


def peak(level, low, high):
    """Range of the highest peak within a span, m, and its level, dB."""
    some = np.flatnonzero((RANGES > NEAR + low) & (RANGES < NEAR + high))
    best = some[level[some].argmax()]
    return RANGES[best], level[best]


#: All that is not so thick that its rear face does not count.
PANES = "glass", "plasterboard", "ceiling board", "acrylic", "plywood"


def pane(name):
    """Range profiles of a smooth sheet: by its transfer matrix at each frequency, and simulated, dB."""
    material = replace(MATERIALS[name], roughness=0.0)
    sheet = shapes.polygon(shapely.box(-3, -3, 3, 3), (NEAR, 0, 0), (0, 1, 0), (0, 0, 1))
    layer = material.permittivity_at(CONFIG.center_frequency), material.thickness
    return reflected([layer]), simulated(SceneObject("pane", sheet, material))


@pytest.mark.parametrize("name", PANES)
def test_where_a_pane_echoes(name):
    """Between its faces, or before them where these nearly cancel: by up to 6 mm, taken at the centre of the sweep."""
    (there, size), (place, level) = (peak(profile, -0.05, 0.05) for profile in pane(name))
    assert place == pytest.approx(there, abs=0.0015) and level == pytest.approx(size, abs=0.7)


def test_the_rear_leaf_of_a_stud_wall():
    truth, found = stud_wall()
    for low, high in ((-0.03, 0.04), (0.07, 0.15)):
        (there, size), (place, level) = peak(truth, low, high), peak(found, low, high)
        assert place == pytest.approx(there, abs=0.008) and level == pytest.approx(size, abs=1.5)
    assert peak(found, 0.07, 0.15)[1] - peak(found, -0.03, 0.04)[1] == pytest.approx(-14, abs=2)


def test_inner_faces_count_where_the_material_lets_through():
    """Of a cabinet of chipboard; not of one of metal, nor of a solid wooden block."""
    far = {}
    for name in ("chipboard", "metal", "wood"):
        found = echoes(SceneObject("cabinet", shapes.box((NEAR + 0.2, 0, 0), (0.4, 2, 2)), MATERIALS[name]))
        path = np.linalg.norm(found.images[:, :, 3], axis=1)
        far[name] = (np.abs(path / 2 - NEAR - 0.4) < 0.05) & found.through
    assert far["chipboard"].any() and not far["metal"].any() and not far["wood"].any()
