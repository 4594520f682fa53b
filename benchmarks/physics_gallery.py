"""The gallery of physical laws: docs/physics.md and its plots, each law's closed form against the simulator.

    python -m benchmarks.physics_gallery

A law is a function that draws on an axis, by what `tests/physics` measure where they do, and returns what came of it.
To add one, write it and enter it in `LAWS`.
"""

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from scipy import stats
from scipy.special import gamma

from radarize.heatmaps import Heatmaps
from radarize.radar.array import virtual_positions
from radarize.radar.presets import PRESETS
from radarsim.physics.antenna import ISOTROPIC, gain_pattern
from radarsim.physics.clutter import CROSS_SECTION, EXPONENT, ON_WALLS, Clutter
from radarsim.physics.coefficients import TABLE, reflection, transmission
from radarsim.physics.echoes import Provenance
from radarsim.physics.finder import EchoFinder
from radarsim.physics.frontend import BOLTZMANN, ROOM_TEMPERATURE, FrontEnd
from radarsim.physics.frontend_config import FrontEndConfig
from radarsim.physics.reflectors import Reflectors
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.search import Search
from radarsim.physics.surface import Surface
from radarsim.physics.unevenness import SCALES, Heights
from radarsim.scene import shapes
from radarsim.scene.life import Life
from radarsim.scene.materials import MATERIALS, material
from radarsim.scene.objects import SceneObject
from radarsim.scene.scene import Scene
from tests.physics.brute_force import kirchhoff_mirror, transfer_matrix
from tests.physics.corners import corner, cross_section, direction, seen_by_all, seen_by_both
from tests.physics.rigs import Rig, burst, field, locate, polar
from tests.physics.test_doors import HALF, MIDDLE, foot_speed, lengths, swinging
from tests.physics.test_doors import finder as finder_of
from tests.physics.test_echoes import speckle as speckles
from tests.physics.test_fresnelzone import wall_past_pole
from tests.physics.test_frontend import db, law, noise_factor, skirt
from tests.physics.test_hollow import RANGES, peak, stud_wall
from tests.physics.test_imagemethod import images_of_a_room, lattice
from tests.physics.test_interference import CASES, brute_force, scenario
from tests.physics.test_laws import slot_phases, tone_ranges
from tests.physics.test_multipath import DOOR, there_and_back
from tests.physics.test_plates import physical_optics
from tests.physics.test_signature import ridge

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
HERE, AHEAD = np.zeros(3), np.eye(3)
NOWHERE = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
DOCS = Path(__file__).parents[1] / "docs"
THEORY = {"color": "black", "lw": 1, "label": "theory"}
LEVEL = "received / transmitted, dB"
FOUND = {"color": "tab:red", "marker": "o", "ms": 3.5, "ls": "", "label": "simulated"}


WORDS = (
    ("one-way, two-way path", "from the radar to a scatterer; out on one and back on another", "radar equation"),
    ("flat, round reflector", "a flat part of a scene with its aperture; a sphere or cylinder", "Knott, RCS"),
    ("specular candidate", "a mirror, or two, over which a scatterer may be seen", "image theory, Balanis"),
    ("image method, chain", "the radar seen in two or three mirrors one after another", "Allen, Berkley, JASA 1979"),
    ("Fresnel unit, aperture", "sqrt(lambda d (L - d) / 2L); what an opening passes", "Born, Wolf, ch. 8"),
    ("flash", "the echo of a reflector that faces the radar", "Gordon, IEEE TAP 1975"),
    ("scattering pattern", "how a rough surface shares out its diffuse echo", "Degli-Esposti, IEEE TAP 2007"),
    ("transmission, slab", "what a pane, door or board lets through, and how late", "ITU-R P.2040"),
    ("moving target", "what moves by itself", "Skolnik, Radar Handbook"),
    ("moving plate", "the leaf of a door: a reflector and a slab that swings", "Chen, Micro-Doppler Effect in Radar"),
    ("sideband", "phase noise beside an echo", "Richards, Fundamentals of Radar Signal Processing"),
)


def compare(axis: Axes, x, theory, found) -> float:
    """Draw both over x; the largest difference."""
    axis.plot(x, theory, **THEORY)
    axis.plot(x, found, **FOUND)
    return np.abs(np.asarray(found) - theory).max()


def target(*place: float) -> EchoFinder:
    """Finds a scatterer of 1 m^2 there."""
    return EchoFinder(None, Scatterers.points(np.array(place), np.ones(1)), None, CONFIG, antenna=ISOTROPIC)


def walls_of(scene: Scene) -> EchoFinder:
    """Finds the surfaces of a scene alone."""
    return EchoFinder(scene, NOWHERE, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC)


def clutter(rng: np.random.Generator, count: int) -> Scatterers:
    """A patch of wall 3 m ahead, as scatterers of random phase with one cross section in all."""
    place = np.stack([np.full(count, 3.0), rng.uniform(-3, 3, count), rng.uniform(-1, 1, count)], axis=1)
    return Scatterers.points(place, np.full(count, 12.0 / count), rng.uniform(0, 2 * np.pi, count))


def point_target(axis) -> str:
    """|a|^2 = lambda^2 sigma / ((4 pi)^3 R^4): twice as far, 12 dB less."""
    ranges, found, off = np.geomspace(0.6, 4.2, 15), [], []
    center = virtual_positions(CONFIG).mean(axis=(0, 1)) / 2  # from here the array sees directions
    for r in ranges:
        place = center + polar(r, 15, 5)
        guess = (np.linalg.norm(place) + 0.01, *np.deg2rad([16, 4]), 0.02)
        measured = locate(CONFIG, burst(CONFIG, target(*place)(HERE, AHEAD), Rig()), guess)
        found.append(2 * db(np.abs(measured[4])))
        away = 1e3 * (measured[0] - np.linalg.norm(place))
        off.append([away, *(np.rad2deg(measured[1:3]) - (15, 5)), measured[3]])
    theory = db(LAMBDA**2 / ((4 * np.pi) ** 3 * ranges**4))
    axis.set_xscale("log")
    worst = compare(axis, ranges, theory, found)
    far = np.abs(np.array(off))[ranges > 2].max(axis=0)
    return (
        f"Worst of 15 ranges: {worst:.3f} dB. Beyond 2 m (nearer, wave fronts are curved), by a "
        f"far-field filter: range {far[0]:.3f} mm, azimuth {far[1]:.3f} deg, elevation {far[2]:.3f} deg, velocity "
        f"{far[3]:.4f} m/s."
    )


def wall_flash(axis) -> str:
    """|a| = lambda |Gamma| / (4 pi 2R): a large wall mirrors the radar, twice as far, 6 dB less."""
    away, finder = np.linspace(0.5, 2.9, 13), walls_of(Scene.load("physics/wall"))
    found = [2 * db(np.abs(finder(np.array([3 - r, 0, 0]), AHEAD).amplitude).max()) for r in away]
    what = material("concrete")
    gamma = abs(what.fresnel(np.array(1.0), CONFIG.center_frequency)[0])
    gamma *= np.exp(-8 * (np.pi * what.roughness / LAMBDA) ** 2)
    theory = 20 * np.log10(LAMBDA * gamma / (8 * np.pi * away))
    return f"Worst of 13 distances: {compare(axis, away, theory, found):.3f} dB."


def plate(axis) -> str:
    """A 10 cm metal plate from a circle of 3 m around it: physical optics, summed point by point."""
    finder = walls_of(Scene.load("physics/plate"))
    angles = np.linspace(-20, 20, 321)
    places = 3 * np.stack([1 - np.cos(np.deg2rad(angles)), np.sin(np.deg2rad(angles)), 0 * angles], axis=1)
    found = [field(finder(place, AHEAD), place, LAMBDA) for place in places]
    theory = [physical_optics((0.05, 0.05), place - [3, 0, 0], across=400) for place in places]
    found, theory = (20 * np.log10(np.abs(x)) for x in (found, theory))
    axis.plot(angles, theory, **THEORY)
    axis.plot(angles, found, color="tab:red", lw=0.8, ls="--", label="simulated")
    axis.set(ylim=(theory.max() - 45, None))
    off = np.abs(found - theory)[theory > theory.max() - 30]
    return f"Within 30 dB of the peak: median {np.median(off):.3f} dB off, 95 % within {np.quantile(off, 0.95):.2f} dB."


def plate_of(area: float) -> float:
    """Cross section of a plate seen face on."""
    return 4 * np.pi * area**2 / LAMBDA**2


def round_and_corners(axis) -> str:
    """Sphere pi a^2; dihedral 8 pi a^2 b^2 / lambda^2 and trihedral 4 pi a^4 / (3 lambda^2), and off their axes the
    width or area that all plates share (Robertson, BSTJ 26, 1947)."""
    off, a, worst = np.arange(-20, 21, 2.0), 0.04, 0.0
    ball = Scene("ball", [SceneObject("ball", shapes.sphere((0, 0, 0), 0.1), material("metal"))])
    finder = walls_of(ball)
    curves = {"trihedral, 4 cm": [], "dihedral, 4 cm": [], "sphere, 10 cm": []}
    for angle in np.deg2rad(off):
        towards = direction(np.pi / 4 + angle, np.arcsin(1 / np.sqrt(3)))
        found = cross_section(corner(3, a, a, triangles=True), towards)
        curves["trihedral, 4 cm"].append((found, plate_of(seen_by_all(a, towards))))
        found = cross_section(corner(2, a, a), direction(np.pi / 4 + angle, 0))
        curves["dihedral, 4 cm"].append((found, plate_of(seen_by_both(a, a, np.pi / 4 + angle))))
        position = 4.0 * np.array([-np.cos(angle), np.sin(angle), 0.0])
        echo = field(finder(position, AHEAD), position, LAMBDA)
        curves["sphere, 10 cm"].append((abs(echo) ** 2 * (4 * np.pi) ** 3 * 4.0**4 / LAMBDA**2, np.pi * 0.1**2))
    for (name, values), color in zip(curves.items(), ("tab:red", "tab:blue", "tab:green"), strict=True):
        found, theory = db(np.array(values)).T
        axis.plot(off, theory, color="black", lw=1)
        axis.plot(off, found, "o", ms=3.5, color=color, label=name)
        worst = max(worst, np.abs(found - theory).max())
    return f"Worst: {worst:.2f} dB (the sphere, seen from 4 m, echoes from its near side)."


def box_room(axis) -> str:
    """Images of the radar by order in a metal box room, walls, edges and corners: 6, 18 and 38."""
    p = np.array([0.37, -0.21, 1.23])
    # A level of -1 keeps those too that leave ahead and come back from behind, between opposite walls: unheard.
    isometry, _, orders = images_of_a_room(
        Search(p[None], AHEAD[None], np.zeros(1), 14.0, LAMBDA, -1.0, *gain_pattern(ISOTROPIC))
    )
    places, counts = isometry[:, :, :3] @ p + isometry[:, :, 3], []
    for order in (1, 2, 3):
        theory = np.sort([np.linalg.norm(image - p) for length, _, image in lattice(p) if length == order])
        found = np.sort(np.linalg.norm(np.unique(places[orders == order].round(6), axis=0) - p, axis=1))
        counts.append(str(len(found)))
        axis.plot(theory, np.arange(len(theory)), **THEORY | {"label": "theory" if order == 1 else None})
        axis.plot(found, np.arange(len(found)), "o", ms=3.5, label=f"order {order}: {len(found)} of {len(theory)}")
    return f"Found {', '.join(counts)} of 6, 18, 38."


def small_mirrors(axis) -> str:
    """A ghost over a square metal mirror of any size, against Kirchhoff's integral over the mirror."""
    place, sides = np.array([3.0, 0.0, 0.0]), np.geomspace(0.02, 1.0, 15)
    straight, theory, found = LAMBDA / (4 * np.pi) ** 1.5 / np.linalg.norm(place), [], []
    for side in sides:
        board = SceneObject("board", shapes.rectangle((1.5, 1.0, 0), (side, side), (0, -1, 0)), MATERIALS["metal"])
        scene = Scene("mirror", [board])
        finder = EchoFinder(
            scene, Scatterers.points(place, np.ones(1)), Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC
        )
        found.append(2 * db(abs(finder(HERE, AHEAD).of(Provenance.GHOST_1).amplitude[0])))
        theory.append(2 * db(straight * abs(kirchhoff_mirror((side / 2, side / 2), place, LAMBDA))))
    worst = compare(axis, sides, np.array(theory), np.array(found))
    return (
        f"Worst of {len(sides)} sizes: {worst:.1f} dB (edges farther off than two Fresnel units fade from the sum). "
        "Every flat part of a squared wavelength or more echoes and mirrors so; scatterers are seen over two mirrors "
        "in turn only where both have 0.05 m^2."
    )


def thin_pole(axis) -> str:
    """A wall's flash, 2 m away, past an opaque pole of 1 cm half way, against Kirchhoff's integral on both passages."""
    offsets = np.arange(-15, 16) * 0.003
    theory, found = wall_past_pole(offsets)
    compare(axis, 1000 * offsets, theory, found)
    off = (found - theory)[np.abs(offsets) < 0.032]
    return (
        f"Over the pole's first Fresnel zone {np.abs(off).max():.1f} dB off at worst, {np.std(off):.1f} dB RMS;"
        " what it diffracts from farther off is left out. Flashes and chains of mirrors 16 dB over noise are seen "
        "so, by the rays of a lattice; edges, corners and scatterers by one ray each."
    )


def slab(axis) -> str:
    """A pane reflects and lets through what ITU-R P.2040 says of a slab; the theory multiplies matrices of layers."""
    angles, worst = np.linspace(0, 80, 81), 0.0
    cosine = np.cos(np.deg2rad(angles))
    table = np.linspace(0, 1, TABLE)
    for name, color in (("glass", "tab:blue"), ("plasterboard", "tab:orange")):
        what = material(name)
        layer = [(what.permittivity_at(CONFIG.center_frequency), what.thickness)]
        truth = np.abs([transfer_matrix(layer, c, CONFIG.center_frequency, False) for c in cosine])
        tables = transmission(what, CONFIG)[0][0], reflection(replace(what, roughness=0.0), CONFIG)[0]
        for k, (values, mark) in enumerate(zip(tables, ("o", "^"), strict=True)):
            found = np.abs(np.interp(cosine, table, values))
            axis.plot(angles, 2 * db(truth[:, k]), color="black", lw=1)
            label = f"{name}, {'reflected' if k else 'through'}"
            axis.plot(angles[::4], 2 * db(found[::4]), mark, ms=3.5, color=color, label=label)
            worst = max(worst, np.abs(found - truth[:, k]).max())
    axis.set(ylim=(-35, 2))
    return f"Worst coefficient: {worst:.4f} off, interpolation between table entries included."


def hollow_wall(axis) -> str:
    """A stud wall of two boards, 10 cm deep: range profile of its leaves, against transfer matrices of all layers."""
    truth, found = stud_wall()
    axis.plot(RANGES, truth - truth.max(), **THEORY)
    axis.plot(RANGES[::8], found[::8] - truth.max(), **FOUND)
    axis.set(ylim=(-45, 3))
    (there, size), (place, level) = peak(truth, 0.07, 0.15), peak(found, 0.07, 0.15)
    return (
        f"The rear leaf {1000 * (place - there):+.0f} mm and {level - size:+.1f} dB off. Waves that go to and fro "
        "between the leaves more than once are left out, and inner faces mirror nothing else."
    )


def moving_door(axis) -> str:
    """A door's flash closes in as fast as the door's point nearest the radar does: omega times its way to the hinge."""
    angles = np.arange(78.0, 103.0)
    doors = [swinging(angle) for angle in angles]
    theory, found = [foot_speed(door) for door in doors], []
    for door in doors:
        echoes = finder_of([], [door])(HERE, AHEAD, MIDDLE)
        path = lengths(echoes)[np.abs(echoes.amplitude).argmax()].mean(axis=0)
        found.append((path[0] - path[2]) / (4 * HALF))
    worst = compare(axis, angles, theory, found)
    return (
        f"At most {1e3 * worst:.1f} mm/s off. Doors that move flash, mirror, let through and scatter as the same doors "
        "do that stand; of a body seen over one, the nearest point is held through the burst."
    )


def phantom(axis) -> str:
    """Behind a metal door a target appears a second time, mirrored: the range-azimuth map of all echoes together."""
    scene, place = Scene("door", [DOOR]), np.array([0.6, 0.55, 0.0])
    finder = EchoFinder(scene, Scatterers.points(place, np.full(1, 10.0)), Reflectors.of(scene, CONFIG), CONFIG)
    maps, signal = Heatmaps(CONFIG), burst(CONFIG, finder(HERE, AHEAD), Rig())
    signal *= 20000 / np.abs(signal).max()
    power = maps.range_azimuth(np.rint(np.stack([signal.real, signal.imag], axis=-1)).astype(np.int16)[None])[0].numpy()
    axis.pcolormesh(np.rad2deg(maps.azimuths), maps.ranges, db(power), vmin=db(power.max()) - 60, rasterized=True)
    image = np.array([3.4, 0.55, 0.0])
    for name, at, color in (("target", place, "white"), ("image", image, "tab:red")):
        axis.plot(np.rad2deg(np.arctan2(at[1], at[0])), np.linalg.norm(at), "o", mfc="none", color=color, label=name)
    near = np.abs(maps.ranges - np.linalg.norm(image)) < 0.25
    part = power * near[:, None] * (np.abs(maps.azimuths - np.arctan2(image[1], image[0])) < 0.15)
    r, a = np.unravel_index(np.argmax(part), power.shape)
    return (
        f"Phantom's peak: {1e3 * (maps.ranges[r] - np.linalg.norm(image)):.0f} mm and "
        f"{np.rad2deg(maps.azimuths[a] - np.arctan2(image[1], image[0])):.1f} deg off the image (bins of "
        f"{1e3 * CONFIG.range_resolution:.0f} mm)."
    )


def doppler(axis) -> str:
    """The static world draws v cos(phi - theta) into the Doppler-azimuth map of a moving radar."""
    maps, power, found = ridge(Rig(velocity=(0.85, 0.85, 0)))
    axis.pcolormesh(np.rad2deg(maps.azimuths), maps.velocities, db(power), vmin=db(power.max()) - 25, rasterized=True)
    theory = 0.85 * np.cos(maps.azimuths) + 0.85 * np.sin(maps.azimuths)
    axis.plot(np.rad2deg(maps.azimuths), theory, color="white", lw=1, label="0.85 cos + 0.85 sin")
    error = (found - theory)[np.abs(maps.azimuths) < 0.87]
    return f"The ridge lies {abs(np.median(error)):.4f} m/s off the curve in the median of all columns within 50 deg."


def tdm(axis) -> str:
    """TX3 fires one slot after TX1 and TX2 two: a closing echo's phase has moved by -4 pi v Tc / lambda a slot."""
    speeds = np.linspace(-1.8, 1.8, 13)
    found, theory = map(np.array, zip(*map(slot_phases, speeds), strict=True))
    for k, name in ((2, "TX3"), (1, "TX2")):
        axis.plot(speeds, np.rad2deg(theory[:, k]), color="black", lw=1)
        axis.plot(speeds, np.rad2deg(np.unwrap(found[:, k])), ls="", marker="o", ms=3.5, label=name)
    error = np.rad2deg(np.abs(np.angle(np.exp(1j * (found - theory)))).max())
    return f"Worst slot phase: {error:.2f} deg off. Speeds are unambiguous to {CONFIG.max_velocity:.3f} m/s."


def range_walk(axis) -> str:
    """An echo moves through range bins within one burst, chirp by chirp."""
    speed = 1.6
    found = tone_ranges(burst(CONFIG, target(3.0, 0, 0)(HERE, AHEAD), Rig(velocity=(speed, 0, 0))), 3.0)
    # the Doppler shift within the ramp makes range read f_c v / S too short
    theory = 3 - speed * CONFIG.chirp_times[:, 0] - CONFIG.center_frequency * speed / CONFIG.slope
    worst = compare(axis, np.arange(len(found)), theory, found)
    walk = 1e3 * (found[0] - found[-1])
    return (
        f"At 1.6 m/s the echo walks {walk:.2f} mm of {1e3 * CONFIG.range_resolution:.1f} mm bins; worst chirp "
        f"{1e3 * worst:.3f} mm off, range-Doppler coupling included."
    )


def noise(axis) -> str:
    """k T B F, with the noise figure of the receive gain (Friis's formula through 15.6 dB at 30, 15 dB at 48 dB)."""
    gains, found = np.arange(24.0, 50, 4), []
    silence = np.zeros(CONFIG.frame_shape[:-1], np.complex64)
    for gain in gains:
        front = FrontEnd(CONFIG.model_copy(update={"rx_gain_db": gain}), FrontEndConfig.ideal(noise=True))
        counts = front.receive(silence, np.random.default_rng(0))
        watts = np.mean(np.abs(counts) ** 2) / front.counts**2
        found.append(watts / (BOLTZMANN * ROOM_TEMPERATURE * CONFIG.sample_rate))
    worst = compare(axis, gains, db(noise_factor(gains)), db(np.array(found)))
    return f"Worst of {len(gains)} gains: {worst:.3f} dB."


def phase_noise(axis) -> str:
    """4 L(f) sin^2(pi f tau): the skirt of an echo vanishes with its delay."""
    bins, step, worst = np.arange(CONFIG.samples), CONFIG.sample_rate / CONFIG.samples, 0.0
    for cell, color in ((10, "tab:blue"), (40, "tab:orange"), (90, "tab:green")):
        off = np.where(bins == cell, np.nan, bins - cell)  # the echo itself is none of its skirt
        theory, found, far = law(cell, off) / step, skirt(cell) / step + 0 * off, np.abs(bins - cell) > 4
        axis.plot(bins, db(theory), color="black", lw=1)
        label = f"echo at {CONFIG.ranges[cell]:.2f} m"
        axis.plot(bins, db(found), ".", ms=4, color=color, label=label)
        worst = max(worst, abs(db(found[far].mean() / theory[far].mean())))
    axis.set(ylim=(-150, -98))
    return f"Mean level of each skirt: {worst:.2f} dB off at worst."


def speckle(axis) -> str:
    """Many scatterers in a cell: Rayleigh amplitudes."""
    amplitude, x = speckles(150), np.linspace(0, 4, 200)
    axis.plot(x, stats.rayleigh.cdf(x), **THEORY)
    axis.plot(np.sort(amplitude), (np.arange(150) + 0.5) / 150, **FOUND | {"ms": 2})
    return f"Kolmogorov-Smirnov: p = {stats.kstest(amplitude, stats.rayleigh.cdf).pvalue:.2f} over 150 positions."


def decorrelation(axis) -> str:
    """Speckle belongs to the world: what a moved radar finds anew is the field of the same frozen scatterers."""
    shifts = np.geomspace(1e-4, 0.1, 16)
    own, frozen, kept = [], [], []
    finders = [EchoFinder(None, clutter(np.random.default_rng(k), 3000), None, CONFIG, range=9.0) for k in range(40)]
    first = [f(HERE, AHEAD) for f in finders]
    start = np.array([field(e, HERE, LAMBDA) for e in first])
    for shift in shifts:
        moved = np.array([0.0, shift, 0.0])
        anew = np.array([field(f(moved, AHEAD), moved, LAMBDA) for f in finders])
        same = np.array([field(e, moved, LAMBDA) for e in first])
        for values, pair in ((own, (start, anew)), (frozen, (start, same)), (kept, (same, anew))):
            values.append(abs(np.vdot(*pair)) / np.linalg.norm(pair[0]) / np.linalg.norm(pair[1]))
    axis.semilogx(1e3 * shifts, frozen, **THEORY | {"label": "frozen scatterers"})
    axis.semilogx(1e3 * shifts, own, **FOUND | {"label": "found anew"})
    near = np.array(kept)[shifts <= 0.0101]
    return (
        f"Correlation of the field found anew with that of the frozen scatterers: at least {near.min():.5f} up to 10 "
        f"mm, {np.min(kept):.5f} up to 10 cm (amplitudes follow the antenna pattern)."
    )


def convergence(axis) -> str:
    """More scatterers, the same mean power per range cell of the coherent sum."""
    counts, draws, levels = [250, 500, 1000, 2000, 4000, 8000], 300, []
    once = CONFIG.model_copy(update={"loops": 1, "tx_order": (0,)})
    for count in counts:
        power = []
        for seed in range(draws):
            finder = EchoFinder(None, clutter(np.random.default_rng((count, seed)), count), None, once, range=9.0)
            spectrum = np.fft.fft(burst(once, finder(HERE, AHEAD), Rig()), axis=-1)
            power.append(np.mean(np.abs(spectrum[..., 67:85]) ** 2))  # 3 to 3.8 m
        levels.append(db(np.mean(power)))
    axis.axhline(0, **THEORY)
    axis.semilogx(counts, np.array(levels) - np.mean(levels), base=2, **FOUND)
    axis.set(ylim=(-0.5, 0.5))
    return f"Doubling the scatterers changes it by at most {np.abs(np.diff(levels)).max():.2f} dB ({draws} draws each)."


def reciprocity(axis) -> str:
    """Swapping TX and RX leaves the field as it was, for every cause of echoes in the office."""
    scene = Scene.load("office")
    surface = Surface(scene, np.random.default_rng(1), density=60.0)
    position = np.array([8.0, 6.0, 1.2])
    echoes = EchoFinder(scene, surface, Reflectors.of(scene, CONFIG), CONFIG, 1e-7)(position, AHEAD)
    (there, back), names, levels = there_and_back(echoes, position), [], []
    for cause in sorted(map(Provenance, set(echoes.provenance))):
        some = echoes.provenance == cause
        names.append(f"{cause.name.lower()} ({some.sum()})".replace("_", " "))
        levels.append(2 * db(abs((there - back)[some].sum()) / abs(there[some].sum()) + 1e-15))
    axis.barh(names, levels, color="tab:red")
    axis.axvline(-60, color="black", lw=1)
    axis.set(xlim=(min(levels) * 1.1, 0))
    axis.figure.subplots_adjust(left=0.3)
    return f"Worst cause: {max(levels):.0f} dB."


def small_things(axis) -> str:
    """Small things, a Poisson process on every surface, have Weibull's cross sections, P(> s) = exp(-(s / s0)^0.7)."""
    wall = SceneObject("wall", shapes.rectangle((3, 0, 1.5), (40, 3), (-1, 0, 0)), material("wood"))
    things = Clutter(Scene("wall", [wall], life=Life(clutter=1)), np.random.default_rng(0))
    sigma = np.sort(things.near(np.zeros((1, 3)), 50.0).sigma)
    weibull = stats.weibull_min(EXPONENT, scale=CROSS_SECTION / gamma(1 + 1 / EXPONENT))
    dbsm, share = db(sigma), (np.arange(len(sigma)) + 0.5) / len(sigma)
    axis.plot(dbsm, weibull.cdf(sigma), **THEORY)
    axis.plot(dbsm[::20], share[::20], **FOUND)
    return (
        f"{len(sigma) / 120:.2f} things a square metre of wall where {ON_WALLS:g} are meant, of {db(sigma.mean()):.1f} "
        f"dBsm on average where {db(CROSS_SECTION):.1f} are; Kolmogorov-Smirnov: p = "
        f"{stats.kstest(sigma, weibull.cdf).pvalue:.2f}. Levels were chosen beside RadarHD's training walks, never "
        "its test walks (`benchmarks.realism`)."
    )


def uneven_walls(axis) -> str:
    """The flash along an uneven wall is correlated as the wall's own phases are, exp(-(2k)^2 (<z z> - <z z'>))."""
    wall = SceneObject("wall", shapes.rectangle((0, 0, 0), (6, 6), (1, 0, 0)), material("plasterboard"))
    steps, level, walls = np.append(np.geomspace(2e-3, 0.3, 16), 10.0), 0.25, 300
    place = np.stack([np.full_like(steps, 2.0), steps, np.zeros_like(steps)], axis=1)
    place = np.concatenate([[[2.0, 0.0, 0.0]], place])
    scene, factors = Scene("wall", [wall], life=Life(unevenness=level)), []
    for seed in range(walls):
        heights = Heights.of(scene, np.random.default_rng(seed))
        factors.append(heights.factors(place, place * [0, 1, 1], np.ones(len(place)), LAMBDA))
    factors = np.array(factors)
    found = np.abs(np.mean(factors[:, 1:] * factors[:, :1].conj(), axis=0))
    lost = sum((level * rms) ** 2 * (1 - np.exp(-((steps / length) ** 2))) for rms, length in SCALES)
    theory = np.exp(-((4 * np.pi / LAMBDA) ** 2) * lost)
    axis.set_xscale("log")
    worst = compare(axis, 1e3 * steps[:-1], theory[:-1], found[:-1])
    return (
        f"Correlation at most {worst:.3f} off ({walls} walls, a quarter of the usual unevenness, 2 m away); mean power "
        f"of the flash {np.mean(np.abs(factors) ** 2):.2f} of the flat wall's: unevenness makes it fade, not faint."
    )


def interference(axis) -> str:
    """Another radar's chirp is in the IF band for its width over the difference of slopes, at Friis's power
    P G G' (lambda / 4 pi d)^2 (Brooker, IEEE Trans. EMC 49, 2007)."""
    other, _ = CASES["steep"]
    made = scenario(other)
    found = made.interference(made.motion, 0.0)[0, 0, 2]
    product = brute_force(made, 0.0, 0, 0, 2)
    at = 1e6 * (CONFIG.adc_start_time + np.arange(CONFIG.samples) / CONFIG.sample_rate)
    compare(axis, at, db(np.abs(product) ** 2), db(np.abs(found) ** 2))
    worst = np.abs(found - product).max() / np.abs(product).max()
    return (
        "Both waveforms multiplied in steps of 0.1 ns and filtered, against the Fresnel integrals of the simulator: a "
        f"slope 2 MHz/us less, 4 m away; worst sample {100 * worst:.3f} % of the peak off. Only the straight path "
        "counts, through what stands in its way."
    )


#: Sections of the page: what draws and measures, its docstring says the law; and labels of x and y.
LAWS = {
    "Point target": (point_target, "range, m", LEVEL),
    "Wall": (wall_flash, "distance of a concrete wall, m", LEVEL),
    "Plate": (plate, "angle off the normal, deg", LEVEL),
    "Small mirrors": (small_mirrors, "side, m", LEVEL),
    "Sphere and corners": (round_and_corners, "angle off the axis, deg", "radar cross section, dBsm"),
    "Box room": (box_room, "path, m", "images up to it"),
    "Thin pole": (thin_pole, "offset of the pole, mm", "of the flash without it, dB"),
    "Slab": (slab, "angle of incidence, deg", "TE coefficient, dB"),
    "Hollow wall": (hollow_wall, "range, m", "over the front, dB"),
    "Phantom": (phantom, "azimuth, deg (left positive)", "range, m"),
    "Moving door": (moving_door, "angle, deg", "closing speed of the flash, m/s"),
    "Doppler signature": (doppler, "azimuth, deg (left positive)", "closing speed, m/s"),
    "TDM slots": (tdm, "closing speed, m/s", "phase against TX1, deg"),
    "Within a burst": (range_walk, "loop", "range that the beat frequency stands for, m"),
    "Thermal noise": (noise, "receive gain, dB", "noise over k T B, dB"),
    "Phase noise": (phase_noise, "range bin", "dBc/Hz"),
    "Interference": (interference, "since the ramp's start, us", LEVEL),
    "Speckle": (speckle, "amplitude over its scale", "share of cells below"),
    "Speckle under motion": (decorrelation, "sideways displacement, mm", "correlation with the field at rest"),
    "Convergence": (convergence, "scatterers on 12 m2 of wall", "mean power per cell, dB"),
    "Clutter": (small_things, "radar cross section, dBsm", "share below"),
    "Uneven walls": (uneven_walls, "along the wall, mm", "correlation of the flash"),
    "Reciprocity": (reciprocity, "power of the difference over the field's, dB", ""),
}


def main() -> None:
    pictures = DOCS / "physics"
    pictures.mkdir(parents=True, exist_ok=True)
    page = (
        "# The physics, law by law\n\n"
        "Each plot sets a closed form, or an independent sum, against what the simulator makes of it, with the "
        f"`radarize` preset (centre {CONFIG.center_frequency / 1e9:.2f} GHz). Text, figures and plots are written by "
        "`python -m benchmarks.physics_gallery`; the same laws are tests in `tests/physics`.\n"
        "\n## Words\n\n| here | is | source |\n|---|---|---|\n" + "".join(f"| {' | '.join(row)} |\n" for row in WORDS)
    )
    for title, (draw, x, y) in LAWS.items():
        figure, axis = plt.subplots(figsize=(5.4, 3.2))
        measured, name, about = draw(axis), draw.__name__, " ".join(draw.__doc__.split())
        print(f"{title}: {measured}")
        axis.set(xlabel=x, ylabel=y)
        axis.grid(alpha=0.3)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(fontsize=8)
        figure.savefig(pictures / f"{name}.png", dpi=90, bbox_inches="tight")
        plt.close(figure)
        page += f"\n## {title}\n\n{about}\n\n![{title}](physics/{name}.png)\n\n{measured}\n"
    (DOCS / "physics.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
