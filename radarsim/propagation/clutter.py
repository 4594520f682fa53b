"""Clutter of rooms as point scatterers: small objects on desks and shelves, on walls and under ceilings.

Objects down to 2 cm are meshes (`radarsim.world.generators.small_objects`). Smaller ones, and parts of larger ones
(handles, edges, screws, plugs), are a Poisson process with a density per square metre of the surface behind them, and
their radar cross sections have a Weibull distribution: the model of Ram, Singh and Ghatak (IEEE Open J. Signal Process.
2, 2021) for discrete clutter of rooms. The exponent of the cross section (1: Swerling's; smaller: spikier) is that of
strong indoor scatterers; log-normal distributions fitted to measured targets in halls (Azim et al., arXiv 2411.03206)
have tails of that length. Densities and mean were tuned on RadarHD's 25 training walks (`benchmarks.realism`), not on
its test walks: no measurement of rooms at 77 GHz is published.

Energy is conserved. A point and the surface behind it are Lambertian, sigma cos(in) cos(out) with sigma the radar cross
section at normal incidence: the point takes sigma / 4 of the power on the surface at any incidence, while an isotropic
point takes the same at grazing incidence, where hardly any power falls on the surface. Cross sections per square metre
over 4 add up to the fraction that would be scattered without mutual shadowing. The structure of the room (frames,
recesses, shelves and their contents, services under ceilings: `STRUCTURE`) scatters much more power, but little of it
directly back: its faces are vertical or horizontal. Its echoes come over other surfaces (`reverberation`). Let s
    be
the fraction of both. A Poisson field of objects covers 1 - exp(-s) (Chiu, Stoyan, Kendall, Mecke, Stochastic Geometry
and its Applications, 3rd ed., section 3.1), so each has (1 - exp(-s)) / s of its cross section, and the surface
reflects, scatters and transmits exp(-s) of its power without them (`uncovered`).

A point has a constant position, cross section and phase, so it is coherent under motion; it is occluded, mirrored and
seen through panes as any other scatterer, but not from behind its own surface.
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

#: Objects per square metre at level 1: on walls (plugs, handles, screws, cables), on surfaces at the height of desks
#: and shelves (pens, clips, keys), under ceilings (nozzles, hangers, grids), on the floor. Larger objects are meshes,
#: about 0.2, 3 and 0.1 per square metre.
ON_WALLS, ON_TOPS, UNDER_CEILINGS, ON_FLOORS = 3.5, 12.0, 2.75, 1.0
#: Mean radar cross section of an object without shadowing at normal incidence, m^2 (half of it at 45 deg), and exponent
#: of its distribution P(sigma > s) = exp(-(s / scale)^exponent).
CROSS_SECTION, EXPONENT = 0.01, 0.7
#: Fraction of the power on any surface that structure would scatter at level 1 without shadowing. Rooms absorb about
#: half of the power on their surfaces (Andersen et al., see `reverberation`); structure scatters 0.42 of it.
STRUCTURE = 0.55
#: Largest number of points in a scene, some 200 bytes each: a floor of the largest buildings has ten thousand.
MOST = 5_000_000
#: Mean distance from the surface beyond the smallest, m: half the depth of what hangs or stands there.
STANDOFF, NEAREST = 0.03, 0.01
#: Up to the first height above the lowest floor an upward face is a floor, above the second none is within reach, m.
LOW, HIGH = 0.15, 2.0


class Clutter:
    """Clutter of a scene as point scatterers.

    Args:
        scene: the world; its `surface_settings.clutter` scales the densities.
        rng: random generator.

    Raises:
        InputError: there would be more than `MOST` points.
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
        """Scatterers within `reach` (m) of any of the positions."""
        index, _ = self._grid.near(positions, reach)
        return self._points[index]


def densities(
    scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """Objects per square metre of surface at level 1, by the surface's orientation and height (m).

    Undersides below a ceiling have none, and sheets only on the side of their normal.
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
    """Fraction of the power on surfaces that their objects would scatter without mutual shadowing; above 1 where they
    are many."""
    return scene.surface_settings.clutter * (STRUCTURE + densities(scene, place, normal) * CROSS_SECTION / 4)


def uncovered(
    scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """Fraction of the power on surfaces, at places (m) on them, that is left for the surface itself."""
    return np.exp(-crowding(scene, place, normal))


def in_the_open(crowding: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Mean factor on the cross section of each object by the shadows of the others."""
    return -np.expm1(-crowding) / np.maximum(crowding, 1e-12)


def cross_section(size: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Cross sections with a Weibull distribution from exponential random numbers of mean 1, m^2."""
    return CROSS_SECTION / gamma(1 + 1 / EXPONENT) * size ** (1 / EXPONENT)


def _strongest(size: Float[np.ndarray, "n"], stride: int) -> Float[np.ndarray, "n"]:
    """Weights of power if one point in `stride`, the strongest ones, represents all; the mean power is preserved."""
    least = log(stride)
    held = gammaincc(1 + 1 / EXPONENT, least)  # their fraction of the mean cross section
    return (size > least) / held
