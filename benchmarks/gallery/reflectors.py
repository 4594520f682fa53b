"""What points, plates, corners and smooth bodies echo."""

import numpy as np

from benchmarks.gallery.drawing import AHEAD, CONFIG, HERE, LAMBDA, THEORY, compare, target, walls_of
from benchmarks.references.brute_force import kirchhoff_mirror
from benchmarks.references.corners import (
    both_ways,
    corner,
    cross_section,
    direction,
    image_out_of_square,
    looking,
    seen_by_all,
    seen_by_both,
)
from benchmarks.references.corners import out_of_square as wedge
from benchmarks.references.front_end import db
from benchmarks.references.plates import physical_optics
from benchmarks.references.rigs import Rig, burst, field, isotropic, locate, polar
from benchmarks.references.smooth_bodies import capsule, ellipsoid, half_cylinder, rounded, stretched, tube
from benchmarks.references.smooth_bodies import field as smooth_field
from benchmarks.references.smooth_bodies import physical_optics as surface_optics
from benchmarks.references.smooth_bodies import reflectors as smooth_reflectors
from radarize.radar.array import virtual_positions
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS, material
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene


def point_target(axis) -> str:
    """The received power of a point follows the radar equation, |a|^2 = lambda^2 sigma / ((4 pi)^3 R^4). At
    twice the distance it is 12 dB less."""
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
        f"Power: error of {worst:.3f} dB at the worst of 15 ranges. Place, located by a filter for flat wave fronts, "
        f"at ranges beyond 2 m: error of {far[0]:.3f} mm, {far[1]:.3f} deg in azimuth, {far[2]:.3f} deg in elevation, "
        f"and {far[3]:.4f} m/s in velocity."
    )


def wall_flash(axis) -> str:
    """A large wall mirrors the radar: |a| = lambda |Gamma| / (4 pi 2R). At twice the distance the echo is 6 dB less."""
    away, finder = np.linspace(0.5, 2.9, 13), walls_of(Scene.load("physics/wall"))
    found = [2 * db(np.abs(finder(np.array([3 - r, 0, 0]), AHEAD).amplitude).max()) for r in away]
    what = material("concrete")
    gamma = abs(what.fresnel(np.array(1.0), CONFIG.center_frequency)[0])
    gamma *= np.exp(-8 * (np.pi * what.roughness / LAMBDA) ** 2)
    theory = 20 * np.log10(LAMBDA * gamma / (8 * np.pi * away))
    return f"Error: {compare(axis, away, theory, found):.3f} dB at the worst of 13 distances."


def plate(axis) -> str:
    """The echo of a metal plate with sides of 10 cm, along a circle of 3 m around it. Theory: physical optics, summed
    point by point."""
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
    return (
        f"Where the echo is within 30 dB of its peak: error of {np.median(off):.3f} dB in the median, and less than "
        f"{np.quantile(off, 0.95):.2f} dB at 95 % of the angles."
    )


def small_mirrors(axis) -> str:
    """The ghost of a point over a square metal mirror, for mirrors of 2 cm to 1 m. Theory: Kirchhoff's integral over
    the mirror."""
    place, sides = np.array([3.0, 0.0, 0.0]), np.geomspace(0.02, 1.0, 15)
    straight, theory, found = LAMBDA / (4 * np.pi) ** 1.5 / np.linalg.norm(place), [], []
    for side in sides:
        board = SceneObject("board", shapes.rectangle((1.5, 1.0, 0), (side, side), (0, -1, 0)), MATERIALS["metal"])
        scene = Scene("mirror", [board])
        finder = PathFinder(
            scene, Scatterers.points(place, np.ones(1)), Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC
        )
        found.append(2 * db(abs(finder(HERE, AHEAD).where(bounces=1, through=False, moving=False).amplitude[0])))
        theory.append(2 * db(straight * abs(kirchhoff_mirror((side / 2, side / 2), place, LAMBDA))))
    worst = compare(axis, sides, np.array(theory), np.array(found))
    return (
        f"Error: {worst:.1f} dB at the worst of {len(sides)} sizes, because edges farther off than two Fresnel units "
        "are left out of the sum. Every flat part larger than a squared wavelength echoes and mirrors like this. "
        "Ghosts over two mirrors need mirrors of at least 0.05 m^2."
    )


def plate_of(area: float) -> float:
    """Cross section of a plate seen face on."""
    return 4 * np.pi * area**2 / LAMBDA**2


def round_and_corners(axis) -> str:
    """Radar cross sections: a sphere has pi a^2, a dihedral 8 pi a^2 b^2 / lambda^2, a trihedral
    4 pi a^4 / (3 lambda^2). Off the axis of a corner, the part of it counts that a ray meets on every plate (Robertson,
    BSTJ 26, 1947)."""
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
    return f"Error: {worst:.2f} dB at most. That is the sphere: seen from 4 m, its near side is nearer than its centre."


def corner_out_of_square(axis) -> str:
    """Two walls that meet at nearly 90 deg make two images of the radar, one for each order of the walls, which are one
    image for a square corner. Where the angle is larger, a gap opens between them; where it is smaller, both are whole.
    Buildings with unevenness have such corners. Theory: Fresnel's diffraction by half a plane; 2 m from the edge."""
    off, square = np.linspace(-1.0, 1.0, 31), LAMBDA / (4 * np.pi * 4.0)
    theory, found = [], []
    for angle in np.deg2rad(off):
        theory.append(db(abs(2 * image_out_of_square(angle, 2.0)[1] / square) ** 2))
        search = isotropic((2.0, 0.0, 0.0), LAMBDA, looking((-1.0, 0.0, 0.0)))
        _, _, amplitude = both_ways(wedge(angle), search)  # both paths are equally long
        found.append(db(abs(amplitude.sum() / square) ** 2))
    return f"Error: {compare(axis, off, theory, found):.2f} dB at most."


def smooth_surfaces(axis) -> str:
    """A smooth surface echoes by its curvature at the specular point, and by its borders. Three coarse meshes: an
    ellipsoid (15, 20, 30 cm), seen along a circle of 1.5 m; a half cylinder of 12 sides and a capsule, seen along a
    line 2 m away that passes their ends. Theory: physical optics, summed over the smooth bodies that the meshes stand
    for."""
    tracks = {
        "ellipsoid": 1.5 * np.array([polar(1, a, 20) for a in np.linspace(0, 90, 10)]),
        "half cylinder": np.array([(-2.0, 0.1, z) for z in np.linspace(0, 0.57, 11)]),
        "capsule": np.array([(-2.0, 0.0, z) for z in np.linspace(0, 0.3, 11)]),
    }
    bodies = {
        "ellipsoid": (stretched((0.15, 0.2, 0.3)), ellipsoid((0.15, 0.2, 0.3))),
        "half cylinder": (half_cylinder(0.15, 1.0, 12), tube(0.15, 0.5, np.pi / 2, 3 * np.pi / 2)),
        "capsule": (capsule(0.05, 0.2), rounded(0.05, 0.2)),
    }
    worst = []
    for (name, (mesh, surface)), color in zip(bodies.items(), ("tab:red", "tab:blue", "tab:green"), strict=True):
        reflectors, along = smooth_reflectors(mesh), np.linspace(0, 1, len(tracks[name]))
        theory = 2 * db(np.abs([surface_optics(surface, place) for place in tracks[name]]))
        found = 2 * db(np.abs([smooth_field(reflectors, place) for place in tracks[name]]))
        axis.plot(along, theory, color="black", lw=1)
        axis.plot(along, found, "o", ms=3.5, color=color, label=name)
        worst.append(f"{name} {np.abs(found - theory).max():.1f} dB")
    return (
        f"Error at most: {', '.join(worst)}. Three simplifications: borders farther off than three to five Fresnel "
        "units are left out; a piece of similar curvature has one specular point; where neighbouring triangles meet "
        "at more than 21 deg, there is an edge and no curvature."
    )
