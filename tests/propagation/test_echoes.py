"""Echoes of a scene: ghosts where the image method puts them, reciprocity, visibility, coherent speckle."""

import numpy as np
import pytest
import yaml
from scipy import stats

from benchmarks.references.rigs import ELEMENT, Rig, burst
from benchmarks.references.speckle import AHEAD, CONFIG, HERE, speckle
from radarsim.propagation.antenna import amplitude_gain
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.paths import Kind
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Surface
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import rectangle

WALL = {"shape": "rectangle", "name": "wall", "material": "metal", "size": [8, 3], "position": [0, 1.5, 0],
        "facing": [0, -1, 0]}  # fmt: skip


@pytest.fixture(scope="module")
def corner(tmp_path_factory):
    """A metal wall 1.5 m to the left, along the radar's course, and a wooden board 3.5 m to the right behind a box."""
    path = tmp_path_factory.mktemp("scene") / "corner.yaml"
    board = {"shape": "rectangle", "name": "board", "material": "wood", "size": [1, 1], "position": [3.5, -1.2, 0],
             "facing": [-1, 0, 0]}  # fmt: skip
    box = {"shape": "box", "name": "box", "material": "wood", "size": [0.4, 0.6, 1.2], "position": [2, -0.9, 0]}
    path.write_text(yaml.safe_dump({"name": "corner", "objects": [WALL, board, box]}))
    return Scene.load(path)


def finder_with_one_target(scene, place, weakest=0.0):
    return PathFinder(scene, Scatterers.points(place, np.ones(1)), Reflectors.of(scene, CONFIG), CONFIG, weakest)


def test_ghosts_stand_where_the_image_method_puts_them(corner):
    """A target in front of a wall has one image, with one path segment direct and the other over the wall, and vice
    versa."""
    place = np.array([2.2, 0.4, 0.1])
    echoes = finder_with_one_target(corner, place)(HERE, AHEAD).where(bounces=1)
    image = place * [1, -1, 1] + [0, 3.0, 0]
    assert len(echoes) == 2
    assert echoes.points[0] == pytest.approx(np.stack([place, image]))
    assert echoes.points[1] == pytest.approx(np.stack([image, place]))
    # radar equation with both path segments, a conductor's coefficient and the antenna's gain in both directions
    out, back = np.linalg.norm(place), np.linalg.norm(image)
    isotropic = CONFIG.wavelength / (4 * np.pi) ** 1.5 / (out * back)
    gain = amplitude_gain(*place, ELEMENT) * amplitude_gain(*image, ELEMENT)
    assert abs(echoes.amplitude[0]) == pytest.approx(isotropic * gain, rel=0.02)
    assert echoes.amplitude[0] == echoes.amplitude[1]


def test_no_ghost_where_the_bounce_misses_the_mirror():
    """A wall that ends before the specular point: the target has an echo, but no ghost."""
    short = dict(WALL, size=[1, 3], position=[-2, 1.5, 0])
    mesh = rectangle(tuple(short["position"]), tuple(short["size"]), tuple(short["facing"]))
    scene = Scene("short", [SceneObject("wall", mesh, MATERIALS["metal"])])
    echoes = finder_with_one_target(scene, np.array([2.2, 0.4, 0.1]))(HERE, AHEAD)
    assert not len(echoes.where(bounces=1)) and len(echoes.where(bounces=0, kind=Kind.POINT)) == 1


def test_polarisation_of_the_bounce(corner):
    """A vertical field on a vertical wall is TE (a conductor inverts the sign), on a conducting floor TM (it does
    not)."""
    wall_ghost = finder_with_one_target(corner, np.array([2.2, 0.4, 0.0]))(HERE, AHEAD).where(
        bounces=1, through=False, moving=False
    )
    assert wall_ghost.amplitude[0].real < 0
    floor = Scene("floor", [SceneObject("floor", rectangle((0, 0, -0.3), (20, 20), (0, 0, 1)), MATERIALS["metal"])])
    floor_ghost = finder_with_one_target(floor, np.array([3.5, 0.0, 0.1]))(HERE, AHEAD).where(
        bounces=1, through=False, moving=False
    )
    assert floor_ghost.amplitude[0].real > 0


def test_the_hidden_are_not_seen(corner):
    """Scatterers of the board behind the box have no direct echo; those beside the box do."""
    scatterers = Surface(corner, np.random.default_rng(0), density=400.0).all()
    echoes = PathFinder(corner, scatterers, None, CONFIG)(HERE, AHEAD)
    seen = echoes.points[:, 0]
    board = scatterers.position[np.abs(scatterers.position[:, 0] - 3.5) < 1e-9]
    # brute force: the line of sight to the board crosses the box's slab of x in 1.8 ... 2.2 at |y + 0.9| < 0.3
    crossing = board[:, None] * (np.linspace(1.8, 2.2, 41)[:, None] / 3.5)
    hidden = np.any((np.abs(crossing[..., 1] + 0.9) < 0.3) & (np.abs(crossing[..., 2]) < 0.6), axis=1)
    in_reach = np.linalg.norm(board, axis=1) < 1.05 * CONFIG.max_range
    found = np.array([np.any(np.all(seen == b, axis=1)) for b in board])
    assert 0.2 < hidden.mean() < 0.9
    assert np.array_equal(found, ~hidden & in_reach)


def test_reciprocity(corner):
    """Swapping the paths of every echo, that is TX and RX, leaves the set of echoes as it was."""
    scatterers = Surface(corner, np.random.default_rng(1), density=100.0).all()
    echoes = PathFinder(corner, scatterers, Reflectors.of(corner, CONFIG), CONFIG)(HERE, AHEAD)
    assert len(echoes.where(bounces=1)) > 50
    key = np.concatenate([echoes.points.reshape(-1, 6), echoes.amplitude[: len(echoes.points), None].view(float)], 1)
    swapped = np.concatenate([echoes.points[:, ::-1].reshape(-1, 6), key[:, 6:]], axis=1)
    assert np.array_equal(np.unique(key, axis=0), np.unique(swapped, axis=0))


def test_speckle_is_the_same_world_from_elsewhere(corner):
    """After a shift of d the field equals that of the same frozen scatterers: none are drawn again."""
    scatterers = Surface(corner, np.random.default_rng(2), density=150.0).all()
    finder = PathFinder(corner, scatterers, None, CONFIG)
    reference = finder(HERE, AHEAD)
    for shift in (1e-4, 5e-4, 2e-3, 1e-2):
        moved = np.array([0.0, shift, 0.0])

        class Shifted(Rig):
            def position(self, t, moved=moved):
                return super().position(t) + moved

        truth = burst(CONFIG, reference, Shifted())
        found = burst(CONFIG, finder(moved, AHEAD), Shifted())
        correlation = abs(np.vdot(truth, found)) / np.linalg.norm(truth) / np.linalg.norm(found)
        assert correlation > 0.999


def test_speckle_is_rayleigh():
    """Kolmogorov-Smirnov test of amplitudes against a Rayleigh distribution."""
    assert stats.kstest(speckle(60), stats.rayleigh.cdf).pvalue > 0.01


def test_power_does_not_depend_on_the_number_of_scatterers(corner):
    """Twice the scatterers: the same mean power, within 0.3 dB over 8 draws each."""
    levels = []
    for density in (150.0, 300.0):
        power = []
        for seed in range(8):
            scatterers = Surface(corner, np.random.default_rng(seed), density).all()
            echoes = PathFinder(corner, scatterers, None, CONFIG)(HERE, AHEAD)
            power.append(np.sum(np.abs(echoes.amplitude) ** 2))
        levels.append(10 * np.log10(np.mean(power)))
    assert levels[1] - levels[0] == pytest.approx(0, abs=0.3)


def test_wall_reflection_survives_the_whole_chain(corner):
    """The metal wall at normal incidence: lambda / (8 pi R) times the gain at boresight, at its range."""
    facing = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # boresight towards +y
    scatterers = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    echoes = PathFinder(corner, scatterers, Reflectors.of(corner, CONFIG), CONFIG)(HERE, facing)
    strongest = np.argmax(np.abs(echoes.amplitude))
    gain = 10 ** (10.5 / 10)
    rough = np.exp(-8 * (np.pi * 2e-5 / CONFIG.wavelength) ** 2)
    expected = gain * rough * CONFIG.wavelength / (8 * np.pi * 1.5)
    assert 20 * np.log10(abs(echoes.amplitude[strongest]) / expected) == pytest.approx(0, abs=0.1)
    lengths = echoes.lengths(CONFIG, Rig(), 0.0)
    assert lengths[strongest, 0, 0] == pytest.approx(3.0, abs=1e-6)
