"""Diffuse multipath: its power in an integrating sphere, and that its walks are fixed in the world."""

from dataclasses import replace

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.propagation import clutter
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.clutter import STRUCTURE
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.mechanisms import diffuse_multipath
from radarsim.propagation.reverberation import STEPS, Albedos, Detours
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Cluttered
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS, Material
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings

CONFIG = PRESETS["radarize"]
AHEAD = np.eye(3)
#: Reflects next to nothing, so that walks end where they are not scattered.
BLACK = Material("black", lambda _: 1 + 1e-6 + 0j, roughness=0.0, sigma0=0.0)


def ball(radius, material=BLACK, level=1.0, *others):
    """A hollow sphere about the origin, seen from inside."""
    mesh = shapes.sphere((0, 0, 0), radius, 4)
    mesh.invert()
    return Scene(
        "ball", [SceneObject("ball", mesh, material), *others], surface_settings=SurfaceSettings(clutter=level)
    )


def multipath(scene, seed=0, position=(0.0, 0.0, 0.0), rotation=AHEAD, threshold=0.0):
    """Detours of a scene, the paths of one frame, and their lengths for a single antenna, m."""
    detours = Detours.of(scene, CONFIG, np.random.default_rng(seed))
    none = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    finder = PathFinder(scene, Cluttered(none, none, detours), None, CONFIG, threshold, range=200.0, antenna=ISOTROPIC)
    paths = diffuse_multipath.find(finder.view(np.array([position]), rotation[None], np.zeros(1)))
    return detours, paths


@pytest.fixture
def uniform(monkeypatch):
    """Structure only, the same on every surface."""
    monkeypatch.setattr(clutter, "densities", lambda scene, place, normal: np.zeros(len(place)))


@pytest.mark.parametrize("level", [0.4, 1.0, 3.0])
def test_an_integrating_sphere(uniform, level):
    """With albedo rho, all of a sphere of radius R is lit uniformly: n scatterings leave rho^n of the power. At
    the middle an isotropic antenna gets lambda^2 rho^n / (4 pi^2 R^2) of it, half of that in its polarisation, twice
    for both ways round, and a quarter of it both from and to where it looks. The mean chord is 4 R / 3."""
    radius, seeds = 6.0, 3
    rho = 1 - np.exp(-level * STRUCTURE)
    order = np.arange(2, STEPS + 2)
    power, late = [], []
    for seed in range(seeds):
        detours, paths = multipath(ball(radius, level=level), seed)
        both = np.abs(paths.amplitude[: len(paths) // 2]) * 2  # there and back are of one phase
        power.append(np.sum(both**2))
        late.append(np.average(detours.between, weights=detours.weight))
    expected = CONFIG.wavelength**2 * np.sum(rho**order) / (4 * np.pi**2 * radius**2) / 4
    assert np.mean(power) == pytest.approx(expected, rel=0.06)
    chords = np.sum((order - 1) * rho**order) / np.sum(rho**order)
    assert np.mean(late) == pytest.approx(chords * 4 / 3 * radius, rel=0.02)


def test_walls_that_mirror_hold_the_power(uniform):
    """A metal sphere reflects all power that it does not scatter: each walk ends detours on all of its surfaces."""
    detours, _ = multipath(ball(2.0, MATERIALS["metal"]))
    begun = len(np.unique(detours.begin, axis=0))
    assert len(detours) == pytest.approx(STEPS * begun, rel=2e-3)  # some slip through between triangles
    dark, _ = multipath(ball(6.0))
    rho = 1 - np.exp(-STRUCTURE)
    begun = len(np.unique(dark.begin, axis=0))
    assert len(dark) / begun == pytest.approx(np.sum(rho ** np.arange(STEPS)), rel=0.03)


def test_shares_of_power_add_up(uniform):
    """For a lossless pane, scattered, reflected and transmitted power add up to one."""
    glass = replace(MATERIALS["glass"], permittivity=lambda _: 6.31 + 0j)
    scene = Scene(
        "pane", [SceneObject("pane", shapes.rectangle((0, 0, 0), (1, 1), (1, 0, 0)), glass)],
        surface_settings=SurfaceSettings(clutter=1.0),
    )  # fmt: skip
    albedos = Albedos(scene, CONFIG)
    cosine = np.linspace(0.2, 1, 9)
    found = albedos.shares(np.zeros(9, int), cosine)
    assert albedos.albedo[0] + found.sum(axis=0) == pytest.approx(np.ones(9), abs=0.02)


def test_paths_are_as_long_as_their_detours(uniform):
    """Out to one end, along the walk, and back from the other, in both directions."""
    here = np.array([0.5, -0.3, 0.2])
    detours, paths = multipath(ball(2.0), position=here)
    seen = [i for i in range(len(detours)) if detours.begin[i, 0] > here[0] and detours.end[i, 0] > here[0]]
    d = detours[np.array(seen)]
    expected = np.linalg.norm(d.begin - here, axis=1) + d.between + np.linalg.norm(d.end - here, axis=1)
    half = len(paths) // 2
    length = np.linalg.norm(paths.points - here, axis=2).sum(axis=1)
    assert np.sort(length[:half]) == pytest.approx(np.sort(expected))
    assert length[half:] == pytest.approx(length[:half])
    assert paths.points[half:] == pytest.approx(paths.points[:half, ::-1])


def test_bare_rooms_have_none():
    """Without clutter there are no detours."""
    assert len(Detours.of(ball(2.0, level=0.0), CONFIG, np.random.default_rng(0))) == 0


def test_what_stands_in_the_way_hides_them(uniform):
    """A metal plate in front of the radar hides each detour with an end behind it."""
    near, half = 0.295, 1.5
    plate = SceneObject("plate", shapes.box((0.3, 0, 0), (0.01, 2 * half, 2 * half)), MATERIALS["metal"])
    detours, paths = multipath(ball(2.0, BLACK, 1.0, plate))
    seen = np.ones(len(detours), bool)
    for end, normal in ((detours.begin, detours.begin_normal), (detours.end, detours.end_normal)):
        crossing = near * end[:, 1:] / end[:, :1]
        hidden = (end[:, 0] > near) & (np.abs(crossing) < half).all(axis=1)
        seen &= (end[:, 0] > 0) & ~hidden & (np.sum(normal * end, axis=1) < 0)
    assert 0 < len(paths) == 2 * seen.sum() < len(detours) / 4


def test_a_threshold_leaves_out_the_weak_ones(uniform):
    """A threshold removes only weak echoes and keeps their order."""
    _, all_ = multipath(ball(2.0))
    threshold = float(np.median(np.abs(all_.amplitude)))
    _, some = multipath(ball(2.0), threshold=threshold)
    assert np.array_equal(some.amplitude, all_.amplitude[np.abs(all_.amplitude) > threshold])
