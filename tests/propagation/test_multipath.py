"""Multipath over mirrors and through slabs: ghosts where the image method puts them, transmission, reciprocity."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.references.brute_force import kirchhoff_mirror, transfer_matrix
from benchmarks.references.reciprocity import CONFIG, DOOR, LAMBDA, sheet, there_and_back
from benchmarks.references.rigs import ELEMENT, Rig, burst
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.signal.heatmaps import Heatmaps
from radarsim.propagation.antenna import ISOTROPIC as ISOTROPIC_ANTENNA
from radarsim.propagation.antenna import Antenna, amplitude_gain
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.media import lag, layer, mirror, sweep_share, window
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.paths import Kind
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Surface
from radarsim.world.materials import MATERIALS, Material, constant
from radarsim.world.movers import Door
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.shapes import box, rectangle

HERE, AHEAD = np.zeros(3), np.eye(3)
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))


def finder(objects, place, **options):
    scene = Scene("test", objects)
    return PathFinder(scene, Scatterers.points(place, np.ones(1)), Reflectors.of(scene, CONFIG), CONFIG, **options)


def points_of(echoes, bounces):
    """Point echoes of one path type, and their amplitudes."""
    some = echoes.where(kind=Kind.POINT, bounces=bounces, through=False)
    return some.points, some.amplitude


GLASS = sheet("glass", "glass", (1.5, 1.0, 0), (5.0, 2.4), (0, -1, 0))
LEFT = sheet("left", "metal", (1.5, 1.2, 0), (5.0, 2.4), (0, -1, 0))
AT_END = sheet("end", "metal", (3.0, 0, 0), (2.4, 2.4), (-1, 0, 0))


@pytest.mark.parametrize(
    ("objects", "place", "phantom"),
    [
        pytest.param([DOOR], (0.6, 0.55, 0.0), (3.4, 0.55, 0.0), id="cul-de-sac behind a metal door"),
        pytest.param([GLASS], (2.6, 0.3, 0.1), (2.6, 1.7, 0.1), id="corridor with glass"),
        pytest.param([LEFT, AT_END], (2.4, 0.5, 0.0), (2.4, 1.9, 0.0), id="two-wall corner, side wall"),
        pytest.param([LEFT, AT_END], (2.4, 0.5, 0.0), (3.6, 0.5, 0.0), id="two-wall corner, end wall"),
    ],
)
def test_phantom_in_the_heat_map(objects, place, phantom):
    """Out and back over the same mirror: a ghost at the image, within one range bin and one degree."""
    echoes = finder(objects, place)(HERE, AHEAD).where(bounces=2, through=False, kind=Kind.POINT)
    seen = [k for k, p in enumerate(echoes.points) if np.allclose(p, phantom)]
    assert len(seen) == 1
    echoes = echoes[seen]
    signal = burst(CONFIG, echoes, Rig())
    signal = signal / np.abs(signal).max() * 3000
    maps = Heatmaps(CONFIG)
    adc = np.rint(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)
    power = maps.range_azimuth(adc[None])[0].numpy()
    r, a = np.unravel_index(np.argmax(power), power.shape)
    assert abs(maps.ranges[r] - np.linalg.norm(phantom)) < CONFIG.range_resolution
    assert abs(np.rad2deg(maps.azimuths[a] - np.arctan2(phantom[1], phantom[0]))) <= 1.0


def test_all_phantoms_of_a_corner():
    """Two walls at right angles: three images of a target, and every combination of paths out and back."""
    place = np.array([2.4, 0.5, 0.0])
    left, end = place * [1, -1, 1] + [0, 2.4, 0], place * [-1, 1, 1] + [6.0, 0, 0]
    both = np.array([end[0], left[1], 0.0])
    echoes = finder([LEFT, AT_END], place, range=8.0)(HERE, AHEAD)
    first, _ = points_of(echoes, 1)
    expected = [(place, left), (left, place), (place, end), (end, place)]
    assert np.sort(first.reshape(4, 6), axis=0) == pytest.approx(np.sort(np.reshape(expected, (4, 6)), axis=0))
    second, amplitude = points_of(echoes, 2)
    expected = [(left, left), (end, end), (left, end), (end, left), (place, both), (both, place)]
    known = np.array([np.ravel(e) for e in expected])
    places = second.reshape(-1, 6)
    for e in known:
        here = np.linalg.norm(places - e, axis=1) < 1e-6
        assert here.any()
        # radar equation over both path segments; conductors reflect all power, so only antenna and distance count
        gain = [amplitude_gain(*q, ELEMENT) / np.linalg.norm(q) for q in (e[:3], e[3:])]
        truth = LAMBDA / (4 * np.pi) ** 1.5 * gain[0] * gain[1]
        assert 20 * np.log10(abs(amplitude[here].sum()) / truth) == pytest.approx(0, abs=0.2)
    assert all(np.linalg.norm(known - e, axis=1).min() < 1e-6 for e in places)


def test_the_hidden_are_seen_over_mirrors():
    """A target behind a metal board has no direct echo, but one out and back over the wall."""
    board = SceneObject("board", box((1.2, 0, 0), (0.05, 0.6, 2.0)), MATERIALS["metal"])
    place = np.array([2.4, 0.0, 0.0])
    echoes = finder([LEFT, board], place)(HERE, AHEAD)
    assert not len(points_of(echoes, 0)[0]) and not len(points_of(echoes, 1)[0])
    points, _ = points_of(echoes, 2)
    assert points == pytest.approx(np.array([[[2.4, 2.4, 0], [2.4, 2.4, 0]]]))


@pytest.mark.parametrize("angle", [0.0, 30.0, 55.0])
@pytest.mark.parametrize("tm", [False, True])
@pytest.mark.parametrize("material", ["glass", "plasterboard"])
def test_pane_in_front_of_a_target(material, tm, angle):
    """Loss and phase of a pane, passed twice, against the transfer matrix; rotated about the vertical it is TE, tilted
    TM."""
    place, tilt = np.array([3.0, 0, 0]), np.deg2rad(angle)
    facing = (-np.cos(tilt), 0, np.sin(tilt)) if tm else (-np.cos(tilt), np.sin(tilt), 0)
    pane = sheet("pane", material, (1.5, 0, 0), (2.0, 2.0), facing)
    echoes = PathFinder(Scene("pane", [pane]), Scatterers.points(place, np.ones(1)), None, CONFIG)(HERE, AHEAD)
    assert echoes.through.tolist() == [True]
    free = PathFinder(None, Scatterers.points(place, np.ones(1)), None, CONFIG)(HERE, AHEAD)
    path = 2 * np.linalg.norm(echoes.points[0, 0])
    found = echoes.amplitude[0] * np.exp(2j * np.pi * (path - 6.0) / LAMBDA) / free.amplitude[0]
    m, f = MATERIALS[material], CONFIG.center_frequency

    def truth(frequency):
        """tau relative to the air that the pane takes the place of, twice; conjugated as in the beat signal."""
        layer = [(m.permittivity_at(frequency), m.thickness)]
        tau, _ = transfer_matrix(layer, np.cos(tilt), frequency, tm)
        air = np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT * m.thickness * np.cos(tilt))
        return np.conj(tau * air) ** 2

    assert 20 * np.log10(abs(found / truth(f))) == pytest.approx(0, abs=0.1)
    assert np.rad2deg(np.angle(found / truth(f))) == pytest.approx(0, abs=2.0)
    assert 0 < path - 6.0 < 0.06  # two passages of a slab slow the wave down by millimetres each


#: Sheets of all materials that waves pass, door leaves and table tops of these and of wood, and walls of a scene file.
SLABS = {
    **{name: m for name, m in MATERIALS.items() if m.thickness},
    **{f"{name} {mm}": replace(MATERIALS[name], thickness=mm / 1000)
       for name in ("wood", "chipboard", "glass", "plasterboard") for mm in (18, 40, 50)},
    "brick 110": replace(MATERIALS["brick"], thickness=0.11),
    "block 250": Material("block", constant(5.0, 0.05), 0.0, 0.0, 0.25),
}  # fmt: skip


@pytest.mark.parametrize("tm", [False, True])
@pytest.mark.parametrize("name", SLABS)
def test_slabs_reflect_as_they_transmit(name, tm):
    """Reflection and transmission coefficients are those of one slab at any angle: transfer matrix and energy
    conservation. Fringes of 40 mm of wood are 4 deg apart."""
    m, f = replace(SLABS[name], roughness=0.0), CONFIG.center_frequency
    cosine, made_of = np.linspace(0.1, 1, 997), layer(m, CONFIG)
    back = np.array([mirror(made_of, c)[int(tm)] for c in cosine])
    through = np.array([window(made_of, c, sweep_share(CONFIG))[int(tm)] for c in cosine])
    truth = np.array([transfer_matrix([(m.permittivity_at(f), m.thickness)], c, f, tm) for c in cosine])
    air = np.exp(2j * np.pi * f / SPEED_OF_LIGHT * m.thickness * cosine)
    assert through == pytest.approx(np.conj(truth[:, 0] * air), abs=1e-9)
    sign = -1 if tm else 1  # P.2040 counts TM by the magnetic field
    assert back == pytest.approx(sign * np.conj(truth[:, 1]), abs=1e-9)
    assert np.max(np.abs(back) ** 2 + np.abs(through) ** 2) <= 1 + 1e-9


@pytest.mark.parametrize("name", SLABS)
def test_delays_are_those_of_unwrapped_phases(name):
    """Delay of transmission at several angles, and of reflection at normal incidence, over the middle of the sweep."""
    m, share = SLABS[name], sweep_share(CONFIG)
    f = CONFIG.center_frequency * (1 + share * np.linspace(-0.5, 0.5, 2001))
    eps = m.permittivity_at(CONFIG.center_frequency)

    def late(cosine, tm, which):
        both = np.array([transfer_matrix([(eps, m.thickness)], cosine, each, tm)[which] for each in f])
        turn = np.unwrap(np.angle(both))
        return (turn[0] - turn[-1]) * SPEED_OF_LIGHT / (2 * np.pi * (f[-1] - f[0]))

    for cosine in (1.0, 0.8, 0.4):
        truth = np.mean([late(cosine, tm, 0) for tm in (False, True)]) - m.thickness * cosine
        found = window(layer(m, CONFIG), cosine, share)[2] * CONFIG.wavelength / (2 * np.pi)
        assert found == pytest.approx(truth, abs=2e-5)
    assert lag(m, CONFIG) == pytest.approx(late(1.0, False, 1), abs=2e-5)


@pytest.mark.parametrize("closed", [False, True], ids=["sheet", "closed body"])
def test_a_pane_reflects_once(closed):
    """At normal incidence a pane echoes lambda |r| / (8 pi R) with r of the slab, as a sheet or as a body with two
    faces."""
    pane = sheet("pane", "glass", (1.5, 0, 0), (4.0, 4.0), (-1, 0, 0))
    if closed:
        pane = SceneObject("pane", box((1.503, 0, 0), (0.006, 4.0, 4.0)), MATERIALS["glass"])
    scene = Scene("pane", [pane])
    echoes = PathFinder(scene, NOTHING, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC_ANTENNA)(HERE, AHEAD)
    m, f = MATERIALS["glass"], CONFIG.center_frequency
    _, r = transfer_matrix([(m.permittivity_at(f), m.thickness)], 1.0, f, False)
    apparent = np.linalg.norm(echoes.images[:, :, 3], axis=1)
    near = np.abs(apparent / 2 - 1.5) < 0.02
    assert 20 * np.log10(np.abs(echoes.amplitude[near]) / (LAMBDA * abs(r) / (12 * np.pi))) == pytest.approx(
        [0], abs=0.05
    )


@pytest.mark.parametrize("angle", [0, 35])
@pytest.mark.parametrize("board", [MATERIALS["plasterboard"], SLABS["block 250"]], ids=["plasterboard", "block"])
def test_delay_of_a_slab(board, angle):
    """A slab with little reflection, or whose rear face hardly contributes, shifts the apparent target by (sqrt(eps -
    sin^2) - cos) d: 0.309 m behind 0.25 m of permittivity 5."""
    place, tilt = np.array([3.0, 0, 0]), np.deg2rad(angle)
    pane = sheet("pane", board, (1.5, 0, 0), (2.0, 2.0), (-np.cos(tilt), np.sin(tilt), 0))
    echoes = PathFinder(Scene("pane", [pane]), Scatterers.points(place, np.ones(1)), None, CONFIG)(HERE, AHEAD)
    eps = board.permittivity_at(CONFIG.center_frequency)
    further = np.linalg.norm(echoes.points[0, 0]) - 3.0
    truth = (np.sqrt(eps - np.sin(tilt) ** 2).real - np.cos(tilt)) * board.thickness
    assert further == pytest.approx(truth, abs=1e-3)


def test_walls_and_doors():
    """A stud wall is two boards, a door leaf one slab of its own thickness; concrete is opaque."""
    place = np.array([3.0, 0, 0])
    f = CONFIG.center_frequency

    def level(*objects):
        echoes = PathFinder(Scene("x", list(objects)), Scatterers.points(place, np.ones(1)), None, CONFIG)(HERE, AHEAD)
        return abs(echoes.amplitude).sum()

    free = PathFinder(None, Scatterers.points(place, np.ones(1)), None, CONFIG)(HERE, AHEAD).amplitude[0].real
    boards = [sheet(f"board {x}", "plasterboard", (x, 0, 0), (2.0, 2.0), (-1, 0, 0)) for x in (1.5, 1.6, 1.7)]
    board = MATERIALS["plasterboard"]
    one = abs(transfer_matrix([(board.permittivity_at(f), board.thickness)], 1.0, f, False)[0])
    assert level(*boards[:2]) / free == pytest.approx(one**4, rel=0.01)
    assert level(*boards) == 0  # given up: three boards
    door = SceneObject("door", box((1.5, 0, 0), (0.04, 2.0, 2.0)), MATERIALS["chipboard"])
    leaf = abs(transfer_matrix([(MATERIALS["chipboard"].permittivity_at(f), 0.04)], 1.0, f, False)[0])
    assert level(door) / free == pytest.approx(leaf**2, rel=0.01)
    assert level(SceneObject("wall", box((1.5, 0, 0), (0.2, 2.0, 2.0)), MATERIALS["concrete"])) == 0


@pytest.fixture(scope="module")
def office():
    scene = Scene.load("office")
    surface = Surface(scene, np.random.default_rng(0), 60.0)
    return PathFinder(scene, surface, Reflectors.of(scene, CONFIG), CONFIG, 7.5e-9)


@pytest.mark.parametrize(("place", "yaw"), [((6.0, 6.0, 1.2), 0.1), ((3.0, 3.0, 1.3), 2.0), ((13.0, 9.0, 1.1), -1.0)])
def test_reciprocity_of_an_office(office, place, yaw):
    """With the places of TX and RX swapped the field is the same to -60 dB, whatever the type of the echoes."""
    place = np.array(place)
    echoes = office(place, Rotation.from_euler("z", yaw).as_matrix())
    assert all(len(echoes.where(bounces=n, kind=Kind.POINT)) for n in (1, 2))
    there, back = there_and_back(echoes, place)
    for bounces in (None, 0, 1, 2, 3):
        some = slice(None) if bounces is None else echoes.bounces == bounces
        difference = abs(there[some].sum() - back[some].sum())
        assert difference <= 1e-3 * np.sqrt(np.sum(np.abs(there[some]) ** 2))


def test_thinning_keeps_the_power_of_ghosts():
    """Of a sampled surface only some scatterers have paths over mirrors, with the power of all: within 0.5 dB over 12
    draws."""
    wall = sheet("wall", "brick", (3.0, 0, 0), (1.6, 1.6), (-1, 0, 0))
    scene = Scene("room", [LEFT, wall])
    facets = Reflectors.of(scene, CONFIG)
    power = {"thinned": np.zeros(2), "whole": np.zeros(2)}
    for seed in range(12):
        scatterers = Surface(scene, np.random.default_rng(seed), 800.0).all()
        ones = np.ones(len(scatterers))
        whole = replace(scatterers, bounces=ones, bounces_twice=ones)
        for name, some in (("thinned", scatterers), ("whole", whole)):
            echoes = PathFinder(scene, some, facets, CONFIG)(HERE, AHEAD)
            for k in (0, 1):
                power[name][k] += np.sum(np.abs(points_of(echoes, k + 1)[1]) ** 2)
    assert 10 * np.log10(power["thinned"] / power["whole"]) == pytest.approx(0, abs=0.5)


@pytest.mark.parametrize("half", [(0.02, 0.02), (0.05, 0.03), (0.1, 0.1), (0.245, 0.25), (0.255, 0.25), (0.6, 0.5)])
@pytest.mark.parametrize("off", [0.0, 0.03])
def test_a_mirror_of_any_size(half, off):
    """A ghost is as strong as what the aperture passes of its Fresnel zones: Kirchhoff's integral.

    Within 1.1 dB: edges farther off than 2 Fresnel units fade from the sum.
    """
    place = np.array([3.0 + 2 * off, 0.0, 0.0])
    board = SceneObject("board", rectangle((1.5, 1.0, 0), (2 * half[0], 2 * half[1]), (0, -1, 0)), MATERIALS["metal"])
    echoes = finder([board], place, antenna=ISOTROPIC_ANTENNA)(HERE, AHEAD).where(
        bounces=1, through=False, moving=False
    )
    assert len(echoes.points) == 2
    other = LAMBDA / (4 * np.pi) ** 1.5 / np.linalg.norm(place)
    truth = abs(kirchhoff_mirror(half, place, LAMBDA)) * other
    assert 20 * np.log10(abs(echoes.amplitude[0]) / truth) == pytest.approx(0, abs=1.1)


def test_an_antenna_of_high_gain_has_its_ghosts():
    """The search uses the antenna's peak gain: it finds paths that 30 dBi lift above the threshold."""
    place, lift = np.array([2.6, 0.3, 0.1]), 19.5
    weak = finder([GLASS], place)(HERE, AHEAD)
    ghosts = weak.where(bounces=2, through=False, moving=False).amplitude
    antenna = Antenna.of(CONFIG.board).model_copy(update={"peak_dbi": 10.5 + lift})
    strong = finder([GLASS], place, antenna=antenna, threshold=abs(ghosts).max() * 10)(HERE, AHEAD)
    found = strong.where(bounces=2, through=False, moving=False).amplitude
    assert 20 * np.log10(abs(found).max() / abs(ghosts).max()) == pytest.approx(2 * lift, abs=0.01)


def slab(material, cosine, tm=False):
    """Factor of a sheet on an amplitude, relative to the air in its place; as in the beat signal."""
    m, f = MATERIALS[material], CONFIG.center_frequency
    tau, _ = transfer_matrix([(m.permittivity_at(f), m.thickness)], cosine, f, tm)
    return np.conj(tau * np.exp(2j * np.pi * f / SPEED_OF_LIGHT * m.thickness * cosine))


@pytest.mark.parametrize("angle", [0.0, 25.0])
@pytest.mark.parametrize("moving", [False, True])
def test_a_corner_behind_a_pane(moving, angle):
    """A metal dihedral behind 6 mm of glass: the image in its edge, lambda / (4 pi 2 R), attenuated by the pane twice;
    for a static pane and for the leaf of a door."""
    side, turn = 0.6 / np.sqrt(8), np.deg2rad(angle)
    plates = [sheet(f"plate {k}", "metal", (2.5 - side, k * side, 0), (0.6, 0.6), (-1, -k, 0)) for k in (1, -1)]
    along = np.array([np.sin(turn), np.cos(turn), 0.0])
    pane, movers = [sheet("pane", "glass", (1, 0, 0), (3.0, 3.0), (-np.cos(turn), np.sin(turn), 0))], []
    if moving:
        leaf = {"width": 3.0, "height": 3.0, "thickness": MATERIALS["glass"].thickness, "material": "glass"}
        angles = (90.0 - angle, 90.0 - angle)
        pane, movers = [], [Door(name="pane", hinge=tuple([1, 0, 0] - 1.5 * along), angles=angles, **leaf)]
    scene = Scene("corner", [*plates, *pane])
    crowd = MovingTargets(movers, np.random.default_rng(0))
    crowd.sigma[:] = 1e-30
    reflectors = Reflectors.of(scene, CONFIG)
    finder = PathFinder(scene, NOTHING, reflectors, CONFIG, 1e-12, antenna=ISOTROPIC_ANTENNA, moving=crowd)
    found = finder(HERE, AHEAD)
    path = np.linalg.norm(found.images[:, :, 3], axis=1)
    turns = np.abs(found.images[:, :, :3] - np.diag([-1, -1, 1])).max(axis=(1, 2)) < 1e-9
    some = turns & (np.abs(path - 5.02) < 0.03)
    echo = np.sum(found.amplitude[found.kind == Kind.IMAGE][some] * np.exp(2j * np.pi * (path[some] - 5.0) / LAMBDA))
    echo /= LAMBDA / (20 * np.pi) * slab("glass", np.cos(turn)) ** 2
    assert 20 * np.log10(abs(echo)) == pytest.approx(0, abs=0.3)
    assert np.rad2deg(np.angle(echo)) == pytest.approx(0, abs=6)
    assert 0.005 < path[some].min() - 5.0 and path[some].max() - 5.0 < 0.04


def test_all_phantoms_behind_a_pane():
    """A target in a corner of two walls, all behind 6 mm of glass: every pair of paths, over one mirror, over two,
    direct, as without the pane, times its transmission of both paths."""
    walls = [sheet("left", "metal", (2.7, 1.2, 0), (3.0, 2.4), (0, -1, 0)), AT_END]
    pane = sheet("pane", "glass", (0.8, 0, 0), (6.0, 4.0), (-1, 0, 0))
    place = np.array([2.4, 0.5, 0.0])
    clear, behind = (finder(objects, place, range=8.0)(HERE, AHEAD) for objects in (walls, [*walls, pane]))
    clear, behind = (each.where(kind=Kind.POINT) for each in (clear, behind))
    assert len(clear.where(bounces=2)) >= 6
    for points, amplitude in zip(clear.points, clear.amplitude, strict=True):
        truth = abs(amplitude * np.prod([slab("glass", c) for c in points[:, 0] / np.linalg.norm(points, axis=1)]))
        same = (np.linalg.norm(behind.points - points, axis=2) < 0.03).all(axis=1)
        assert same.any()
        error = 20 * np.log10(np.abs(behind.amplitude[same]) / truth)
        assert np.abs(error).min() == pytest.approx(0, abs=0.2)
