"""Path types: distinction between real targets and ghosts by the radar's resolution."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import Antenna, gain_pattern
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.path_types import PathType, PathTypes
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import box, cylinder, placed, rectangle

CONFIG = PRESETS["radarize"]
HERE, AHEAD = np.zeros(3), np.eye(3)
STILL = SimpleNamespace(position=lambda t: np.zeros((len(t), 3)), rotation=lambda t: Rotation.identity(len(t)))
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))


def found(objects, points=NOTHING, config=CONFIG):
    """Paths of a radar at the origin, and their types."""
    scene = Scene("place", [SceneObject(f"{k}", mesh, MATERIALS[name]) for k, (mesh, name) in enumerate(objects)])
    paths = PathFinder(scene, points, Reflectors.of(scene, CONFIG), config, 1e-9)(HERE, AHEAD)
    lengths = paths.lengths(config, STILL, 0.0)[..., 0]
    (types,) = PathTypes(scene, config, gain_pattern(Antenna.of(config.board)))(
        [paths], [lengths], HERE[None], AHEAD[None]
    )
    return paths, types


def point(*place):
    """Target with a cross section of 1 m^2."""
    return Scatterers.points(np.array(place), np.ones(1))


def wall(distance, side=0.0, size=(6.0, 3.0)):
    """Metal wall in front of the radar, or beside it."""
    if side:
        return rectangle((distance, side, 0), size, (0, -np.sign(side), 0)), "metal"
    return rectangle((distance, 0, 0), size, (-1, 0, 0)), "metal"


@pytest.mark.parametrize("shear", [0.0, 0.05, 0.5])
def test_a_corner_that_is_not_quite_square_is_none(shear):
    """Corners out of square by some tenths of a degree are no ghosts: their echo is at their position."""
    corner = []
    for bearing, towards in ((135.0, -135.0), (-135.0 + shear, 135.0 + shear)):
        along, facing = (np.array([np.cos(a), np.sin(a), 0]) for a in np.deg2rad([bearing, towards]))
        corner.append((rectangle(np.array([2.2, 0, 0]) + 0.6 * along, (1.2, 1.2), facing), "metal"))
    paths, types = found(corner)
    twice = paths.bounces == 2
    strength = np.sum(np.abs(paths.amplitude[twice]) ** 2)
    assert strength > 10 * np.sum(np.abs(paths.amplitude[~twice]) ** 2)
    assert (types[twice] == PathType.DIRECT).all()


@pytest.mark.parametrize(("gap", "ghost"), [(0.015, False), (0.5, True)])
def test_an_image_behind_a_wall(gap, ghost):
    """The image of an object in a wall is a ghost, if the radar resolves their ranges."""
    paths, types = found([wall(3.0)], point(3.0 - gap, 0.3, 0.0))
    mirrored = paths.bounces == 2
    assert mirrored.any()
    assert (types[mirrored] == PathType.GHOST).all() == ghost and (types[mirrored] == PathType.DIRECT).all() != ghost


@pytest.mark.parametrize(("gap", "ghost"), [(0.1, False), (1.0, True)])
def test_an_image_beside_a_wall(gap, ghost):
    """At equal range, the beam distinguishes them: 0.33 m wide to either side at 3 m."""
    paths, types = found([wall(3.0, side=1.2)], point(3.0, 1.2 - gap, 0.0))
    mirrored = paths.bounces == 2
    assert mirrored.any()
    assert (types[mirrored] == PathType.GHOST).all() == ghost


@pytest.mark.filterwarnings("error")
def test_one_antenna_resolves_no_directions():
    """The image beside a wall that a row of eight antennas separates from the wall is at its range: no ghost for
    one."""
    alone = CONFIG.model_copy(update={"tx_order": (0,), "rx": (0,)})
    paths, types = found([wall(3.0, side=1.2)], point(3.0, 0.2, 0.0), alone)
    mirrored = paths.bounces == 2
    assert mirrored.any() and (types[mirrored] == PathType.DIRECT).all()


def test_what_stands_before_a_wall_is_no_slab():
    """A metal pole in front of a concrete wall blocks part of its reflection; no path passes a slab."""
    pole = placed(cylinder((0, 0, 0), 0.02, 3.0, 24), (2.0, 0.03, 0))
    paths, types = found([(box((3.1, 0, 0), (0.2, 6, 3)), "concrete"), (pole, "metal")])
    assert not paths.through.any()
    reflection = np.flatnonzero(np.abs(np.linalg.norm(paths.apparent(HERE)[:, 0], axis=1) - 3.0) < 1e-3)[0]
    assert 0.05 < paths.blocked[reflection] < 1
    assert types[reflection] == PathType.DIRECT


def test_what_passes_a_pane_has_passed_a_slab():
    paths, types = found([(box((1.0, 0, 0), (0.006, 4, 3)), "glass"), wall(3.0)])
    behind = np.abs(np.linalg.norm(paths.apparent(HERE).mean(axis=1), axis=1) - 3.0) < 0.05
    assert behind.any() and paths.through[behind].all()
    assert (types[behind] == PathType.THROUGH_SLAB).all()
    strongest = np.abs(paths.amplitude).argmax()
    assert not paths.through[strongest] and types[strongest] == PathType.DIRECT
