"""Scatterers generated on demand: the same world from any position, the same power at any distance, no popping."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from benchmarks.references.rigs import ELEMENT, Rig, burst
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import amplitude_gain
from radarsim.propagation.clutter import Clutter
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.level_of_detail import detail, share
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.surface import DENSITY, Surface
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings

CONFIG = PRESETS["radarize"]
AHEAD = np.eye(3)


def room(length=6.0):
    """Walls at y = +-2 m along x, floor, ceiling, and a wall across at x = `length`."""
    parts = {
        "left": shapes.rectangle((length / 2, 2, 0), (length, 2.6), (0, -1, 0)),
        "right": shapes.rectangle((length / 2, -2, 0), (length, 2.6), (0, 1, 0)),
        "floor": shapes.rectangle((length / 2, 0, -1.3), (length, 4), (0, 0, 1)),
        "ceiling": shapes.rectangle((length / 2, 0, 1.3), (length, 4), (0, 0, -1)),
        "end": shapes.rectangle((length, 0, 0), (4, 2.6), (-1, 0, 0)),
    }
    return Scene("room", [SceneObject(name, mesh, MATERIALS["concrete"]) for name, mesh in parts.items()])


SCENE = room()


def surface(seed=0, **options):
    return Surface(SCENE, np.random.default_rng(seed), **options)


def weights(scatterers, position):
    """Amplitude factor of each scatterer from a position, looking along x."""
    offset = scatterers.position - position
    shares = [share(amplitude_gain(*d, ELEMENT) / ELEMENT.peak_gain, np.linalg.norm(d)) for d in offset]
    return np.array([detail(rank, used) for rank, used in zip(scatterers.rank, shares, strict=True)])


def table(scatterers):
    """Position and phase of each scatterer as bytes, with its row."""
    rows = np.column_stack([scatterers.position, scatterers.phase, scatterers.sigma])
    return {row.tobytes(): n for n, row in enumerate(rows)}


def test_the_same_scatterers_from_everywhere():
    """Scatterers visible from two positions are the same, and all of them are in the list of the whole world."""
    world = surface()
    here, there, everywhere = (table(s) for s in (
        world.near(np.array([[1.0, 0, 0]]), 3.0), world.near(np.array([[2.0, 0.5, 0.2]]), 3.0), world.all(),
    ))  # fmt: skip
    assert len(here.keys() & there.keys()) > 0.5 * len(here)
    assert here.keys() <= everywhere.keys() and there.keys() <= everywhere.keys()
    assert table(surface().near(np.array([[1.0, 0, 0]]), 3.0)) == here
    assert not here.keys() & table(surface(seed=1).near(np.array([[1.0, 0, 0]]), 3.0)).keys()


def test_nothing_in_reach_is_missing():
    """Every scatterer with a nonzero `detail` weight from a position is generated there."""
    world, position = surface(), np.array([1.3, -0.4, 0.1])
    drawn, ranked = world.near(position[None], 3.0), world.near(np.array([[x, 0.0, 0] for x in range(7)]), 10.0)
    distance = np.linalg.norm(ranked.position - position, axis=1)
    used = (distance < 3.0) & (weights(ranked, position) > 0)
    keys = table(drawn)
    needed = [row.tobytes() for row in np.column_stack([ranked.position, ranked.phase, ranked.sigma])[used]]
    assert len(needed) > 1000 and all(key in keys for key in needed)


def test_scatterers_lie_evenly_on_their_surfaces():
    """Number and cross section per area are the surface's, also in parts of it and for the lowest ranks alone."""
    s = surface().all()
    left = s.position[np.abs(s.position[:, 1] - 2) < 1e-9]
    ranks = surface().near(np.array([[3.0, 0, 0]]), 10.0)
    for points, expected in ((left, DENSITY), (ranks.position[ranks.rank < 0.05], DENSITY / 20)):
        on_left = points[np.abs(points[:, 1] - 2) < 1e-9]
        count, *_ = np.histogram2d(on_left[:, 0], on_left[:, 2], bins=[[0, 2, 4, 6], [-1.3, 0, 1.3]])
        assert count / (2 * 1.3) == pytest.approx(expected, rel=0.15)
    assert s.sigma.sum() == pytest.approx(
        MATERIALS["concrete"].sigma0 * sum(o.mesh.area for o in SCENE.objects), rel=0.01
    )


@pytest.mark.parametrize("used", [0.01, 0.1, 0.3, 0.5, 0.51, 0.8, 1.0, 5.0])
def test_mean_power_does_not_depend_on_the_share(used):
    ranks = (np.arange(100_000) + 0.5) / 100_000
    power = np.mean([detail(r, used) ** 2 for r in ranks])
    assert power == pytest.approx(1, abs=1e-4)


def test_mean_power_does_not_depend_on_distance():
    """A board face on, small enough to be all at one range: R^4 power is constant within 0.2 dB from 0.5 to 4 m."""
    board = Scene(
        "board", [SceneObject("board", shapes.rectangle((0, 0, 0), (0.3, 0.1), (-1, 0, 0)), MATERIALS["brick"])]
    )
    levels = []
    for distance in (0.7, 1.0, 2.0, 4.0):
        power = 0.0
        for seed in range(60):
            finder = PathFinder(None, Surface(board, np.random.default_rng(seed)), None, CONFIG)
            echoes = finder(np.array([-distance, 0, 0]), AHEAD)
            place = echoes.points[:, 0] + [distance, 0, 0]
            gain = np.array([amplitude_gain(*d, ELEMENT) for d in place])
            away = np.linalg.norm(place, axis=1)
            power += np.sum(np.abs(echoes.amplitude) ** 2 * (away / gain) ** 4 / (distance / away) ** 2)
        levels.append(10 * np.log10(power))
    assert np.ptp(levels) < 0.5


def amplitudes(finder, position):
    """Amplitude of each visible scatterer by its place."""
    echoes = finder(position, AHEAD)
    return {p.tobytes(): abs(a) for p, a in zip(echoes.points[:, 0], echoes.amplitude, strict=True)}


def test_nothing_pops_along_a_walk():
    """On a straight walk no scatterer appears or changes by more than a fraction of its neighbours between frames."""
    finder = PathFinder(None, surface(), None, CONFIG, range=4.0)
    path = [np.array([x, 0.1, 0.0]) for x in 0.5 + 0.03 * np.arange(12)]
    frames = [amplitudes(finder, p) for p in path]
    for before, after, position in zip(frames, frames[1:], path, strict=False):
        strongest: dict[int, float] = {}
        for key, a in before.items():
            r = int(4 * np.linalg.norm(np.frombuffer(key) - position))
            strongest[r] = max(strongest.get(r, 0), a)
        for key in before.keys() | after.keys():
            distance = np.linalg.norm(np.frombuffer(key) - position)
            if distance < 3.9 and np.frombuffer(key)[0] - position[0] > 0.3:  # not at the edge of reach or behind
                step = abs(after.get(key, 0) - before.get(key, 0))
                assert step < 0.15 * strongest.get(int(4 * distance), np.inf)


@pytest.mark.parametrize("step", [(1e-4, 0, 0), (0, 2e-3, 0), (0.01, 0, 0), (0.1, 0, 0), (0, 0.1, 0)])
def test_speckle_stays_coherent(step):
    """The field after a step equals that of the very same scatterers, weights frozen: only their fading differs."""
    world, start = surface(), np.array([1.0, 0.2, 0.1])
    finder = PathFinder(None, world, None, CONFIG)
    moved = start + np.array(step)
    drawn = world.near(np.stack([start, moved]), finder.range)
    whole = PathFinder(None, replace(drawn, rank=np.full(len(drawn), -1.0)), None, CONFIG)(moved, AHEAD)
    before, now = (dict(zip(map(bytes, drawn.position), weights(drawn, p), strict=True)) for p in (start, moved))

    class Shifted(Rig):
        def position(self, t):
            return super().position(t) + moved

    found = burst(CONFIG, finder(moved, AHEAD), Shifted())
    again, truth = (
        burst(CONFIG, replace(whole, amplitude=whole.amplitude * [w[bytes(p)] for p in whole.points[:, 0]]), Shifted())
        for w in (now, before)
    )
    assert np.linalg.norm(again - found) < 1e-3 * np.linalg.norm(found)
    correlation = abs(np.vdot(truth, found)) / np.linalg.norm(truth) / np.linalg.norm(found)
    assert correlation > 0.999


def test_speckle_is_rayleigh():
    """Amplitude of one range-azimuth cell over independent worlds (Kolmogorov-Smirnov)."""
    cells = []
    for seed in range(150):
        echoes = PathFinder(None, surface(seed), None, CONFIG)(np.array([2.0, 0, 0]), AHEAD)
        place = echoes.points[:, 0] - [2.0, 0, 0]
        r, azimuth = np.linalg.norm(place, axis=1), np.arctan2(place[:, 1], place[:, 0])
        for low in (2.4, 2.8, 3.2):
            inside = (r > low) & (r < low + CONFIG.range_resolution) & (np.abs(azimuth - 0.7) < 0.11)
            phase = 4 * np.pi * r[inside] / CONFIG.wavelength
            cells.append(np.sum(echoes.amplitude[inside] * np.exp(1j * phase)))
    amplitude = np.abs(np.array(cells).reshape(-1, 3))
    amplitude = (amplitude / np.sqrt(np.mean(amplitude**2, axis=0))).ravel()
    assert stats.kstest(amplitude, stats.rayleigh(scale=np.sqrt(0.5)).cdf).pvalue > 0.01


def cell_powers(seed, density):
    """Mean power per cell, 0.5 m of range by 20 deg of azimuth."""
    position = np.array([1.5, 0.3, 0.0])
    echoes = PathFinder(None, surface(seed, density=density), None, CONFIG)(position, AHEAD)
    place = echoes.points[:, 0] - position
    r, azimuth = np.linalg.norm(place, axis=1), np.rad2deg(np.arctan2(place[:, 1], place[:, 0]))
    edges = [1.5, 2, 2.5, 3, 3.5, 4], np.arange(-50, 51, 20)
    return np.histogram2d(r, azimuth, edges, weights=np.abs(echoes.amplitude) ** 2)[0]


def test_mean_power_converges():
    """Twice the scatterers: within 0.2 dB in all; ten times: within 0.5 dB in every cell."""
    plain, double, tenfold = (
        np.mean([cell_powers(seed, DENSITY * factor) for seed in range(count)], axis=0)
        for factor, count in ((1, 24), (2, 12), (10, 3))
    )
    assert 10 * np.log10(double.sum() / plain.sum()) == pytest.approx(0, abs=0.2)
    assert 10 * np.log10(double / plain).mean() == pytest.approx(0, abs=0.2)
    assert np.max(np.abs(10 * np.log10(plain / tenfold))) < 0.5


def test_cells_hold_ten_scatterers():
    """Range-azimuth cells on the walls to either side hold ten or more, near and far."""
    position = np.array([0.5, 0.0, 0])
    azimuth_cell = 0.22  # of eight virtual antennas half a wavelength apart
    counts = {2.3: [], 3.0: [], 4.0: []}
    for seed in range(6):
        echoes = PathFinder(None, surface(seed), None, CONFIG)(position, AHEAD)
        place = echoes.points[np.abs(np.abs(echoes.points[:, 0, 1]) - 2) < 1e-9, 0] - position
        r, azimuth = np.linalg.norm(place, axis=1), np.arctan2(place[:, 1], place[:, 0])
        for distance, found in counts.items():
            # broadened by the angle, as the array's beam is
            bearing = np.arcsin(2 / distance)
            near = np.abs(np.abs(azimuth) - bearing) < azimuth_cell / 2 / np.cos(bearing)
            in_range = np.abs(r - distance) < CONFIG.range_resolution / 2
            found += [np.sum(near & in_range & (place[:, 1] * side > 0)) for side in (-1, 1)]
    assert min(np.mean(found) for found in counts.values()) >= 10


def test_cost_does_not_depend_on_the_building():
    """A corridor of 12 m and one of 120 m: as many scatterers around the sensor, and no memory for the rest."""
    near = []
    for length in (12.0, 120.0):
        world = Surface(room(length), np.random.default_rng(0))
        near.append(len(world.near(np.array([[5.0, 0, 0]]), 4.5)))
    assert near[0] == pytest.approx(near[1], rel=0.03)
    held = sum(a.nbytes for a in vars(world).values() if isinstance(a, np.ndarray))
    assert held < 0.05 * 100 * len(world)  # a scatterer in memory takes more than 100 bytes


def test_a_room_in_one_mesh_has_the_floor_of_one_in_parts():
    """As in a scan: scatterers, flat parts and objects on floor and ceiling are distinguished from those on walls."""
    parts = [item.mesh for item in SCENE.objects]
    whole = Scene(
        "scan",
        [SceneObject("room", shapes.joined(*parts), MATERIALS["concrete"])],
        surface_settings=SurfaceSettings(clutter=1.0),
    )
    found = Surface(whole, np.random.default_rng(0)).all()
    assert (found.horizontal == (np.abs(np.abs(found.position[:, 2]) - 1.3) < 1e-6)).all()
    flat = Reflectors.of(whole, CONFIG).flat
    assert (flat.horizontal == (np.abs(flat.normal[:, 2]) > 0.9)).all() and flat.horizontal.sum() == 2
    small = Clutter(whole, np.random.default_rng(0)).near(np.zeros((1, 3)), 10.0)
    assert small.horizontal.any() and (np.abs(small.position[small.horizontal, 2]) > 0.9).all()
