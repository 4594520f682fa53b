"""Images of the radar in two and three mirrors: box rooms, dihedral and trihedral corners."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from benchmarks.references.box_room import CONFIG, images_of_a_room, lattice
from benchmarks.references.corners import (
    chains,
    corner,
    cross_section,
    direction,
    looking,
    seen_by_all,
    seen_by_both,
)
from benchmarks.references.rigs import isotropic
from radarsim.propagation import apertures, plates
from radarsim.propagation.antenna import Antenna, gain_pattern
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.mechanisms import image_chains
from radarsim.propagation.path_types import PathType, PathTypes
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.frontend import FrontEnd
from radarsim.world.scene import Scene

LAMBDA = CONFIG.wavelength


@pytest.mark.parametrize("off", [-20, -10, 0, 7, 20])
@pytest.mark.parametrize(("a", "b"), [(0.03, 0.03), (0.04, 0.02)])
def test_dihedral(off, a, b):
    """sigma = 8 pi a^2 b^2 / lambda^2 at normal incidence; off it, by the width that both plates share, 2 a min(sin,
    cos)."""
    azimuth = np.deg2rad(45 + off)
    area = seen_by_both(a, b, azimuth)
    found = cross_section(corner(2, a, b), direction(azimuth, 0))
    assert 10 * np.log10(found / (4 * np.pi * area**2 / LAMBDA**2)) == pytest.approx(0, abs=0.2)
    if off == 0:
        assert 10 * np.log10(found / (8 * np.pi * a**2 * b**2 / LAMBDA**2)) == pytest.approx(0, abs=0.2)


def test_dihedral_turns_polarisation():
    """Rolled by 45 deg about boresight, a dihedral returns only the crossed polarisation; by 90 deg, nothing is
    lost."""
    mirrors, ahead = corner(2, 0.03, 0.03), direction(np.pi / 4, 0)
    level = cross_section(mirrors, ahead)
    assert cross_section(mirrors, ahead, roll=np.pi / 4) < 1e-4 * level
    assert cross_section(mirrors, ahead, roll=np.pi / 2) == pytest.approx(level, rel=1e-3)


@pytest.mark.parametrize("off", [(0, 0), (20, 0), (-12, 0), (0, 15), (0, -20), (14, 14), (-9, 11)])
def test_trihedral(off):
    """Triangles: 4 pi a^4 / (3 lambda^2) head on, and Robertson's projected area off it (BSTJ 26, 1947)."""
    a = 0.04
    azimuth, elevation = np.pi / 4 + np.deg2rad(off[0]), np.arcsin(1 / np.sqrt(3)) + np.deg2rad(off[1])
    towards = direction(azimuth, elevation)
    area = seen_by_all(a, towards)
    found = cross_section(corner(3, a, a, triangles=True), towards)
    assert 10 * np.log10(found / (4 * np.pi * area**2 / LAMBDA**2)) == pytest.approx(0, abs=0.3)
    if off == (0, 0):
        assert 10 * np.log10(found / (4 * np.pi * a**4 / (3 * LAMBDA**2))) == pytest.approx(0, abs=0.2)


def test_square_trihedral():
    """Squares: 12 pi a^4 / lambda^2."""
    found = cross_section(corner(3, 0.03, 0.03), np.ones(3) / np.sqrt(3))
    assert 10 * np.log10(found / (12 * np.pi * 0.03**4 / LAMBDA**2)) == pytest.approx(0, abs=0.2)


def test_wide_corner_is_the_image_in_its_edge():
    """At short range a corner of two walls equals one infinite mirror at the edge: lambda / (4 pi 2 R)."""
    for azimuth in np.deg2rad([20, 45, 63]):
        found = cross_section(corner(2, 5.0, 3.0), direction(azimuth, 0.0), distance=2.0)
        expected = (LAMBDA / (8 * np.pi * 2)) ** 2 * (4 * np.pi) ** 3 * 2**4 / LAMBDA**2
        assert 10 * np.log10(found / expected) == pytest.approx(0, abs=0.2)


def test_no_step_as_the_image_leaves_the_corner():
    """Moving past the end of a dihedral's edge in tenths of a millimetre, the echo is continuous."""
    mirrors = corner(2, 1.0, 1.0)
    values = []
    for z in 0.5 + np.arange(-100, 100) * 1e-3:
        position = np.array([1.4, 1.4, z])
        pose = looking(np.array([-1, -1, 0]) / np.sqrt(2))
        values.append(np.sum(chains(mirrors, isotropic(position, LAMBDA, pose)).amplitude))
    assert np.max(np.abs(np.diff(values))) < 0.03 * np.max(np.abs(values))
    assert abs(values[0]) > 10 * abs(values[-1])


@pytest.mark.parametrize("seed", range(6))
def test_kirchhoff_integral(seed):
    """The sum over edges equals the integral over the polygon, wherever the path passes it."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 5))
    polygon = rng.uniform(0.3, 2.5) * np.stack([np.cos(angles), np.sin(angles)], 1) + rng.uniform(-1.5, 1.5, 2)
    low, high, n = polygon.min(0), polygon.max(0), 1500
    x, y = (low + (high - low) * ((np.arange(n) + 0.5) / n)[:, None]).T
    inside = np.ones((n, n), bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, 0), strict=True):
        inside &= (x1 - x0) * (y[:, None] - y0) - (y1 - y0) * (x - x0) > 0
    cell = np.prod(high - low) / n**2
    truth = np.sum(inside * np.exp(0.5j * np.pi * (x**2 + y[:, None] ** 2))) * cell / 2j
    assert apertures.kirchhoff(polygon, 5) == pytest.approx(truth, abs=3e-3)


@pytest.mark.parametrize("seed", range(8))
def test_what_an_edge_diffracts(seed):
    """The tabulated integral along an edge equals the integral itself, near the path and away from it; it is odd."""
    rng = np.random.default_rng(seed)
    s, ends = rng.uniform(0, apertures.FADE) * 10.0 ** rng.uniform(-4, 0), rng.uniform(-1, 1, 2) * apertures.FADE
    low, high = np.sort(ends)
    peak = [t for t in (-s, 0.0, s) if low < t < high]
    truth, _ = quad(
        lambda t: np.exp(0.5j * np.pi * (s * s + t * t)) * s / (s * s + t * t), low, high,
        points=peak or None, limit=500, complex_func=True,
    )  # fmt: skip
    assert apertures.diffracted(s, low, high) == pytest.approx(truth, abs=5e-4)
    assert apertures.diffracted(-s, low, high) == -apertures.diffracted(s, low, high)


def test_box_room_has_all_its_images(monkeypatch):
    """6 images of first, 18 of second and 38 of third order and no others, with delay, sign and strength.

    The reference is the lattice of images, and each one's path followed through the walls as a straight line in the
    lattice: a conductor turns the field E into 2 (E n) n - E. The antenna is made isotropic, and tilted, because two
    opposite walls send the wave out in front and take it in from behind.
    """
    for module, kernel in ((image_chains, "_search"), (plates, "_specular_points")):
        monkeypatch.setattr(module, "gain_towards", lambda *_: 1.0)
        monkeypatch.setattr(module, kernel, getattr(module, kernel).py_func)
    p, pose = np.array([0.37, -0.21, 1.23]), Rotation.from_euler("ZYX", [0.3, 0.4, 0.5]).as_matrix()
    isometry, amplitude, order = images_of_a_room(isotropic(p, LAMBDA, pose))
    found = isometry[:, :, :3] @ p + isometry[:, :, 3]

    counted, known = {1: 0, 2: 0, 3: 0}, np.zeros(len(found), bool)
    for length, turned, image in lattice(p):
        turns = np.where(turned, -1.0, 1.0)  # the product of reflections in a box is diagonal
        path = np.linalg.norm(image - p)
        out = (image - p) / path
        sent = pose[:, 2] - pose[:, 2] @ out * out
        arriving = turns * out
        taken = pose[:, 2] - pose[:, 2] @ arriving * arriving
        field = (-1) ** length * turns * sent / np.linalg.norm(sent)
        expected = LAMBDA / (4 * np.pi * path) * field @ taken / np.linalg.norm(taken)
        here = (np.linalg.norm(found - image, axis=1) < 1e-6) & (order == length)
        assert here.any(), image
        counted[length] += 1
        known |= here
        assert np.sum(amplitude[here]) == pytest.approx(expected, abs=0.023 * LAMBDA / (4 * np.pi * path)), image
    assert counted == {1: 6, 2: 18, 3: 38}
    assert known.all()


def test_ghosts_of_a_box_room():
    """Echoes of a room's edges and corners are at their positions; images farther behind its walls than the radar can
    resolve are ghosts."""
    scene = Scene.load("physics/room")
    finder = PathFinder(scene, Scatterers.points(np.zeros((0, 3)), np.zeros(0)), Reflectors.of(scene, CONFIG), CONFIG)
    position = np.array([0.37, -0.21, 1.23])
    finder.range = 8.0
    pose = looking(direction(0.2, 0.1))
    paths = finder(position, pose)
    apparent = (position + paths.images[:, :, :3] @ position + paths.images[:, :, 3]) / 2
    low, high = np.array([-2.5, -2, 0]), np.array([2.5, 2, 3])
    outside = np.maximum(np.maximum(low - apparent, apparent - high), 0).max(axis=1)
    types = PathTypes(scene, CONFIG, gain_pattern(Antenna.of(CONFIG.board)))
    still = SimpleNamespace(
        position=lambda t: np.tile(position, (len(t), 1)),
        rotation=lambda t: Rotation.from_matrix(np.tile(pose, (len(t), 1, 1))),
    )
    lengths = paths.lengths(CONFIG, still, 0.0)[..., 0]
    (found,) = types([paths], [lengths], position[None], pose[None])
    assert (found[outside < 1e-6] <= PathType.FLOOR_CEILING).all() and (outside < 1e-6).sum() > 10
    far = outside > 1.0
    assert far.sum() > 5 and (found[far] == PathType.GHOST).mean() > 0.9


def test_images_fade_out_before_their_paths_get_too_long():
    """Through the room in steps of 1 cm, images appear at the longest path only where the IF filter has closed."""
    scene, front = Scene.load("physics/room"), FrontEnd(CONFIG)
    reach = front.settings.band.high * CONFIG.max_range
    mirrors, ahead = Reflectors.of(scene, CONFIG).flat, looking(direction(0.4, 0.1))
    frames = []
    for x in np.arange(-1.5, 1.5, 0.01):
        position = np.array([x, 0.1, 1.4])
        found = chains(mirrors, isotropic(position, LAMBDA, ahead, reach))
        path = np.linalg.norm(position - found.isometry[:, :, :3] @ position - found.isometry[:, :, 3], axis=1)
        frames.append({tuple(c): p for c, p in zip(found.mirrors.tolist(), path, strict=True)})
    pops = []
    for before, after in zip(frames, frames[1:], strict=False):
        for some, other in ((before, after), (after, before)):
            pops += [p for c, p in some.items() if c not in other and p > 2 * reach - 0.05]
    assert len(pops) > 2
    assert np.abs(front.if_response(np.array(pops))).max() < 0.05
