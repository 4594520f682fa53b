"""The small objects that a room is full of, as points: on desks and shelves, on walls and under ceilings.

Objects down to 2 cm are drawn (`radarsim.world.generators.small_objects`). What is smaller, and parts of larger ones
(handles, edges, screws, plugs), is a Poisson process with a density per square metre of the surface that they stand or
hang on, and their radar cross sections follow Weibull's law: so Ram, Singh and Ghatak (IEEE Open J. Signal Process. 2,
2021) model the discrete clutter of rooms. The exponent of a cross section (1: Swerling's, the smaller the spikier)
is that of strong indoor scatterers; log-normal laws that fit measured targets in halls (Azim et al., arXiv 2411.03206)
have tails of that length. Densities and the mean were chosen beside the pictures of RadarHD's 25 training walks
(`benchmarks.realism`), never its test walks: no measurement of rooms at 77 GHz is published.

Energy is conserved. A point and the surface behind it scatter as Lambert has it, sigma cos(in) cos(out) with sigma the
radar cross section head-on: it takes sigma / 4 of what falls on the surface from anywhere, while an isotropic point
takes the same from grazing waves, of which hardly anything falls on the surface. Cross sections a square metre, over 4,
add up to the share that would be scattered if no point were in another's shadow. The structure of the room (frames,
recesses, shelves and what is on them, services under ceilings: `STRUCTURE`) scatters much more than they do, but hardly
back at once: its faces are upright or level. Its echoes come over other surfaces (`reverberation`). With both the share
is s. A Poisson field of objects covers 1 - exp(-s) (Chiu, Stoyan, Kendall, Mecke, Stochastic Geometry and its
Applications, 3rd ed., section 3.1), so each has (1 - exp(-s)) / s of its cross section, and the surface reflects,
scatters and lets through exp(-s) of the power that it would without them (`uncovered`).

A point keeps its place, cross section and phase for good, so it is coherent under motion; it is hidden, mirrored and
seen through panes as any other scatterer is, but not from behind its own surface.
"""

from dataclasses import replace
from math import gamma, log

import numpy as np
from jaxtyping import Float
from scipy.special import gammaincc

from radarize.io.errors import InputError
from radarsim.propagation.hashgrid import Grid
from radarsim.propagation.scatterers import BOUNCE_STRIDE, Scatterers
from radarsim.world.scene import Scene
from radarsim.world.shapes import areas, scattered

#: Objects a square metre at level 1: on walls (plugs, handles, screws, cables), on what stands at the height of desks
#: and shelves (pens, clips, keys), under ceilings (nozzles, hangers, grids), on the floor. Before larger ones were
#: drawn it was 4, 16 and 3; of those there are some 0.2, 3 and 0.1.
ON_WALLS, ON_TOPS, UNDER_CEILINGS, ON_FLOORS = 3.5, 12.0, 2.75, 1.0
#: Mean radar cross section of a lone object head-on, m^2 (half of it at 45 deg), and exponent of its distribution
#: P(sigma > s) = exp(-(s / scale)^exponent).
CROSS_SECTION, EXPONENT = 0.01, 0.7
#: Share of the power on any surface that structure would scatter at level 1 if it were in no shadow. Rooms absorb about
#: half of the power on their surfaces (Andersen et al., see `reverberation`); structure scatters 0.42 of it.
STRUCTURE = 0.55
#: Points of a scene, some 200 bytes each: a floor of the largest buildings has ten thousand.
MOST = 5_000_000
#: Mean distance from the surface, m, over the least: half the depth of what hangs or stands there.
STANDOFF, NEAREST = 0.03, 0.01
#: Below the first height over the lowest floor an upward face is a floor, above the second none is within reach, m.
LOW, HIGH = 0.15, 2.0


class Clutter:
    """All small objects of a scene.

    Args:
        scene: the world; its `surface_settings.clutter` scales the densities.
        rng: draws them.

    Raises:
        InputError: there were to be more than `MOST`.
    """

    def __init__(self, scene: Scene, rng: np.random.Generator):
        corners, normals = scene.triangles, scene.normals
        middles, level = corners.mean(axis=1), scene.surface_settings.clutter
        mean = level * densities(scene, middles, normals) * areas(corners)
        if mean.sum() > MOST:
            raise InputError(
                f"scene {scene.name}: clutter is {level:g}, which makes {mean.sum():.2g} points, expected "
                f"at most {MOST:g}"
            )
        count = rng.poisson(mean)
        on = np.repeat(np.arange(len(corners)), count)
        place = scattered(corners[on], rng)
        place += (NEAREST + rng.exponential(STANDOFF, len(on)))[:, None] * normals[on]
        size = rng.exponential(1.0, len(on))
        sigma = cross_section(size) * in_the_open(crowding(scene, middles, normals))[on]
        self._points = replace(
            Scatterers.points(place, sigma, rng.uniform(0, 2 * np.pi, len(on))),
            normal=normals[on],
            horizontal=scene.floors_and_ceilings[on],
            bounces=_strongest(size, BOUNCE_STRIDE),
            bounces_twice=_strongest(size, BOUNCE_STRIDE**2),
        )
        self._grid = Grid(place, place)

    def __len__(self) -> int:
        return len(self._points)

    def near(self, positions: Float[np.ndarray, "position 3"], reach: float) -> Scatterers:
        """Those within `reach` (m) of any of the positions."""
        index, _ = self._grid.near(positions, reach)
        return self._points[index]


def densities(
    scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """Objects a square metre of surface at level 1, by where it faces and how high its place (m) is.

    Undersides below a ceiling have none, and sheets have theirs on the side of their normal.
    """
    up, height = normal[:, 2], place[:, 2] - scene.bounds[0, 2]
    kinds = {
        "wall": np.abs(up) < 0.5,
        "floor": (up >= 0.5) & (height < LOW),
        "top": (up >= 0.5) & (height >= LOW) & (height < HIGH),
        "ceiling": (up <= -0.5) & (height >= HIGH),
    }
    return np.select(list(kinds.values()), [ON_WALLS, ON_FLOORS, ON_TOPS, UNDER_CEILINGS], 0.0)


def crowding(scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Share of what falls on surfaces that their objects would scatter if none were in another's shadow: above 1 where
    they are many."""
    return scene.surface_settings.clutter * (STRUCTURE + densities(scene, place, normal) * CROSS_SECTION / 4)


def uncovered(
    scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """Share of the power that falls on surfaces, at places (m) on them, that objects leave for the surface itself."""
    return np.exp(-crowding(scene, place, normal))


def in_the_open(crowding: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """What is left of each object's cross section on average, with the shadows of the others."""
    return -np.expm1(-crowding) / np.maximum(crowding, 1e-12)


def cross_section(size: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Weibull's law from exponential numbers of mean 1, m^2."""
    return CROSS_SECTION / gamma(1 + 1 / EXPONENT) * size ** (1 / EXPONENT)


def _strongest(size: Float[np.ndarray, "n"], stride: int) -> Float[np.ndarray, "n"]:
    """Weights of power where one point in `stride`, the strongest ones, stands for all; mean power stays."""
    least = log(stride)
    held = gammaincc(1 + 1 / EXPONENT, least)  # share of the mean cross section that they have
    return (size > least) / held
