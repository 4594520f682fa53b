"""What walls, panes, poles and doors make of a room."""

from dataclasses import replace

import numpy as np

from benchmarks.gallery.drawing import (
    AHEAD,
    CONFIG,
    FOUND,
    HERE,
    LAMBDA,
    THEORY,
    compare,
)
from benchmarks.references.box_room import images_of_a_room, lattice
from benchmarks.references.brute_force import transfer_matrix
from benchmarks.references.doors import HALF, MIDDLE, foot_speed, lengths, swinging
from benchmarks.references.doors import finder as finder_of
from benchmarks.references.front_end import db
from benchmarks.references.hollow_walls import NEAR, PANES, RANGES, pane, peak, stud_wall
from benchmarks.references.poles import wall_past_pole
from benchmarks.references.reciprocity import DOOR
from benchmarks.references.rigs import Rig, burst
from radarize.signal.heatmaps import Heatmaps
from radarsim.propagation.antenna import ISOTROPIC, gain_pattern
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.media import layer, mirror, sweep_share, window
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world.materials import material
from radarsim.world.scene import Scene


def box_room(axis) -> str:
    """In a box room of metal the radar has 6 images over one wall, 18 over two and 38 over three. All should be found,
    at the right distance."""
    p = np.array([0.37, -0.21, 1.23])
    # A level of -1 keeps those too that leave ahead and come back from behind, between opposite walls: unheard.
    isometry, _, orders = images_of_a_room(
        Observation(p[None], AHEAD[None], np.zeros(1), 14.0, LAMBDA, -1.0, *gain_pattern(ISOTROPIC))
    )
    places, counts = isometry[:, :, :3] @ p + isometry[:, :, 3], []
    for order in (1, 2, 3):
        theory = np.sort([np.linalg.norm(image - p) for length, _, image in lattice(p) if length == order])
        found = np.sort(np.linalg.norm(np.unique(places[orders == order].round(6), axis=0) - p, axis=1))
        counts.append(str(len(found)))
        axis.plot(theory, np.arange(len(theory)), **THEORY | {"label": "theory" if order == 1 else None})
        axis.plot(found, np.arange(len(found)), "o", ms=3.5, label=f"order {order}: {len(found)} of {len(theory)}")
    return f"Found: {', '.join(counts)} of 6, 18, 38."


def thin_pole(axis) -> str:
    """A wall's specular reflection, 2 m away, while an opaque pole of 1 cm passes half way to the wall. Theory:
    Kirchhoff's integral, there and back."""
    offsets = np.arange(-15, 16) * 0.003
    theory, found = wall_past_pole(offsets)
    compare(axis, 1000 * offsets, theory, found)
    off = (found - theory)[np.abs(offsets) < 0.032]
    return (
        f"While the pole is in the first Fresnel zone: error of {np.abs(off).max():.1f} dB at worst, {np.std(off):.1f} "
        "dB RMS. What it diffracts from farther off is left out. The visibility of specular reflections, of edges and "
        "corners of plates, and of chains of mirrors that are 16 dB above the noise is measured like this, by a "
        "lattice of rays. Scatterers have one ray each."
    )


def slab(axis) -> str:
    """What a pane reflects and lets through. Theory: ITU-R P.2040, computed by the transfer matrices of its layers."""
    angles, worst = np.linspace(0, 80, 81), 0.0
    cosine = np.cos(np.deg2rad(angles))
    for name, color in (("glass", "tab:blue"), ("plasterboard", "tab:orange")):
        what = material(name)
        layers = [(what.permittivity_at(CONFIG.center_frequency), what.thickness)]
        truth = np.abs([transfer_matrix(layers, c, CONFIG.center_frequency, False) for c in cosine])
        smooth = layer(replace(what, roughness=0.0), CONFIG)
        both = [window(smooth, c, sweep_share(CONFIG))[0] for c in cosine], [mirror(smooth, c)[0] for c in cosine]
        for k, (values, mark) in enumerate(zip(both, ("o", "^"), strict=True)):
            found = np.abs(values)
            axis.plot(angles, 2 * db(truth[:, k]), color="black", lw=1)
            label = f"{name}, {'reflected' if k else 'through'}"
            axis.plot(angles[::4], 2 * db(found[::4]), mark, ms=3.5, color=color, label=label)
            worst = max(worst, np.abs(found - truth[:, k]).max())
    axis.set(ylim=(-35, 2))
    return f"The largest error of a coefficient is {worst:.1e}."


def panes(axis) -> str:
    """Range profile of a pane of 6 mm glass, whose faces echo together. Theory: its transfer matrix over the sweep."""
    truth, found = pane("glass")
    axis.plot(RANGES, truth - truth.max(), **THEORY)
    axis.plot(RANGES[::8], found[::8] - truth.max(), **FOUND)
    axis.axvline(NEAR, color="gray", lw=0.8, ls=":", label="front face")
    axis.set(xlim=(NEAR - 0.1, NEAR + 0.1), ylim=(-25, 3))
    places = np.array([[peak(profile, -0.05, 0.05)[0] for profile in pane(name)] for name in PANES])
    off, lag = 1000 * np.ptp(places, axis=1).max(), 1000 * np.abs(places[:, 0] - NEAR).max()
    return (
        f"Panes of {', '.join(PANES)} seem to be up to {lag:.0f} mm off their front faces. The simulator is within "
        f"{off:.1f} mm of that."
    )


def hollow_wall(axis) -> str:
    """Range profile of a stud wall: two boards, 10 cm apart. Theory: transfer matrices of all layers."""
    truth, found = stud_wall()
    axis.plot(RANGES, truth - truth.max(), **THEORY)
    axis.plot(RANGES[::8], found[::8] - truth.max(), **FOUND)
    axis.set(ylim=(-45, 3))
    (there, size), (place, level) = peak(truth, 0.07, 0.15), peak(found, 0.07, 0.15)
    return (
        f"The rear board has an error of {1000 * (place - there):+.0f} mm and {level - size:+.1f} dB. Waves that are "
        "reflected between the boards more than once are left out, and inner faces mirror nothing else."
    )


def phantom(axis) -> str:
    """A metal door mirrors a target, so it appears a second time behind the door. Range-azimuth map of all echoes."""
    scene, place = Scene("door", [DOOR]), np.array([0.6, 0.55, 0.0])
    finder = PathFinder(scene, Scatterers.points(place, np.full(1, 10.0)), Reflectors.of(scene, CONFIG), CONFIG)
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
        f"The phantom's peak has an error of {1e3 * (maps.ranges[r] - np.linalg.norm(image)):.0f} mm and "
        f"{np.rad2deg(maps.azimuths[a] - np.arctan2(image[1], image[0])):.1f} deg; a bin is "
        f"{1e3 * CONFIG.range_resolution:.0f} mm."
    )


def moving_door(axis) -> str:
    """The specular reflection of a turning door comes nearer as fast as the point of the door that is nearest to the
    radar: by the angular rate times that point's distance from the hinge."""
    angles = np.arange(78.0, 103.0)
    doors = [swinging(angle) for angle in angles]
    theory, found = [foot_speed(door) for door in doors], []
    for door in doors:
        echoes = finder_of([], [door])(HERE, AHEAD, MIDDLE)
        path = lengths(echoes)[np.abs(echoes.amplitude).argmax()].mean(axis=0)
        found.append((path[0] - path[2]) / (4 * HALF))
    worst = compare(axis, angles, theory, found)
    return (
        f"Error: {1e3 * worst:.1f} mm/s at most. A moving door reflects, mirrors, lets through and scatters as the "
        "same door at rest does. One simplification: the point where a round body, seen over the door, reflects "
        "stays the same during a burst."
    )
