"""Samples from Sionna RT's paths are correct if the paths are."""

import numpy as np
import pytest

from benchmarks.references.rigs import Rig, locate, polar
from benchmarks.sionna import PathSolverFinder, SionnaScenario
from radarize.radar.array import virtual_positions
from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.receiver.synthesis import Synthesizer
from radarsim.scenario import Scenario
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import rectangle

CONFIG = PRESETS["radarize"]


@pytest.fixture(scope="module")
def wall():
    """A metal wall with its specular point 20 deg to the left at 2.5 m."""
    normal = np.array([np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20)), 0])
    mesh = rectangle(tuple(2.5 * normal), (8, 8), tuple(-normal))
    return Scene("wall", [SceneObject("wall", mesh, MATERIALS["metal"])])


def test_specular_reflection_of_a_wall(wall):
    """The amplitude is lambda / (8 pi R), and the closing speed v cos(20 deg) for a sensor that moves forward."""
    rig = Rig(velocity=(0.8, 0, 0))
    middle = np.array([CONFIG.burst_center])
    paths = PathSolverFinder(wall, CONFIG, antenna=ISOTROPIC)(rig.position(middle)[0], np.eye(3))
    strongest = np.argmax(np.abs(paths.amplitude))
    single = np.arange(len(paths)) == strongest
    lengths = paths.lengths(CONFIG, rig, 0.0)[single]
    signal = Synthesizer(CONFIG)(lengths, paths.amplitude[single])
    away = 2.5 - 0.8 * CONFIG.burst_center * np.cos(np.deg2rad(20))
    speed = 0.8 * np.cos(np.deg2rad(20))
    range_, azimuth, elevation, closing, amplitude = locate(CONFIG, signal, (away, np.deg2rad(20), 0.0, speed))
    assert range_ == pytest.approx(away, abs=3e-3)  # seen from the array's origin, 3 mm from its centre
    assert np.rad2deg([azimuth, elevation]) == pytest.approx([20, 0], abs=0.2)
    assert closing == pytest.approx(speed, abs=0.005)
    assert 20 * np.log10(abs(amplitude) * 8 * np.pi * away / CONFIG.wavelength) == pytest.approx(0, abs=0.2)


@pytest.mark.parametrize("velocity", [(0.9, 0, 0), (0, -1.1, 0), (0, 0.5, 0.6)])
def test_one_point_of_a_small_board(velocity):
    """A diffuse path to a 20 cm board 25 deg to the right and 10 deg up has the position and closing speed of its
    point.

    The point is computed from the length of the path and the plane of the board, as a check of the path's directions.
    """
    towards = polar(1.0, -25, 10)
    board = rectangle(tuple(3.0 * towards), (0.2, 0.2), tuple(-towards))
    scene = Scene("board", [SceneObject("board", board, MATERIALS["brick"])])
    rig = Rig(velocity=velocity)
    middle = rig.position(np.array([CONFIG.burst_center]))[0]
    paths = PathSolverFinder(scene, CONFIG, antenna=ISOTROPIC)(middle, np.eye(3))
    points = (paths.tx_center + paths.rx_center) / 2 + paths.length[:, None] / 2 * paths.departure
    assert np.abs((points - 3.0 * towards) @ towards).max() < 2e-3
    off = np.linalg.norm(points - 3.0 * towards, axis=1)
    assert off.max() < 0.15
    one = np.arange(len(paths)) == np.argmax(off)  # not the specular reflection
    signal = Synthesizer(CONFIG)(paths.lengths(CONFIG, rig, 0.0)[one], paths.amplitude[one])
    array = middle + virtual_positions(CONFIG).mean(axis=(0, 1)) / 2
    x, y, z = place = points[one][0] - array
    truth = np.arctan2(y, x), np.arcsin(z / np.linalg.norm(place))
    speed = np.dot(velocity, place) / np.linalg.norm(place)
    guess = (np.linalg.norm(place), truth[0] + 0.01, truth[1] - 0.01, speed + 0.02)
    range_, azimuth, elevation, closing, _ = locate(CONFIG, signal, guess)
    assert range_ == pytest.approx(np.linalg.norm(points[one][0] - middle), abs=3e-3)
    assert np.rad2deg([azimuth, elevation]) == pytest.approx(np.rad2deg(truth), abs=0.2)
    assert closing == pytest.approx(speed, abs=0.005)


def test_same_pose_same_paths(wall):
    finder = PathSolverFinder(wall, CONFIG)
    first, again = finder(np.zeros(3), np.eye(3)), finder(np.zeros(3), np.eye(3))
    assert len(first) > 0 and np.array_equal(np.sort(first.length), np.sort(again.length))


def test_frames_of_a_scenario():
    """The strongest echo of a frame has the range of the wall, 3 m."""
    scenario = SionnaScenario.of(Scenario(Scene.load("physics/wall"), Motion.still((0, 0, 0)), CONFIG))
    adc = scenario.frames(np.zeros(1)).samples[0].astype(float)
    power = np.abs(np.fft.fft(adc[..., 0] + 1j * adc[..., 1], axis=-1)).mean(axis=(0, 1, 2))
    assert CONFIG.ranges[power.argmax()] == pytest.approx(3.0, abs=0.05)
