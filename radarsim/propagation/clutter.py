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
add up to the share s that would be scattered if no point were in another's shadow. A Poisson field of objects covers
1 - exp(-s) (Chiu, Stoyan, Kendall, Mecke, Stochastic Geometry and its Applications, 3rd ed., section 3.1), so each has
(1 - exp(-s)) / s of its cross section, and the surface reflects, scatters and lets through exp(-s) of the power that it
would without them (`uncovered`).

Corners of objects and of the building (frames, fins, hinges, recesses, edges of shelves: dihedrals and trihedrals of 2
to 20 cm) echo back to where the wave comes from, and hardly elsewhere: as many more points that have the backscatter
lobe alone. They are large. A reflector of area A and power reflectivity R has a cross section of 4 pi R A^2 / lambda^2
far away only; near by it is a mirror, whose echo grows with its distance (`scatterers.extended_factor`). So small ones
decide near the radar, and large ones farther away. What their lobes scatter is taken from the surface, too.

A point keeps its place, cross section and phase for good, so it is coherent under motion; it is hidden, mirrored and
seen through panes as any other scatterer is, but not from behind its own surface.
"""

from dataclasses import replace
from math import gamma, log
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import gammaincc

from radarize.errors import InputError
from radarsim.propagation.hashgrid import Grid
from radarsim.propagation.media import LAMBERT, concentration
from radarsim.propagation.scatterers import BOUNCE_STRIDE, Scatterers
from radarsim.world.scene import Scene
from radarsim.world.shapes import scattered

#: Objects a square metre at level 1: on walls (plugs, handles, screws, cables), on what stands at the height of desks
#: and shelves (pens, clips, keys), under ceilings (nozzles, hangers, grids), on the floor. Before larger ones were
#: drawn it was 4, 16 and 3; of those there are some 0.2, 3 and 0.1.
ON_WALLS, ON_TOPS, UNDER_CEILINGS, ON_FLOORS = 3.5, 12.0, 2.75, 1.0
#: Points of a scene, of either population, some 200 bytes each: a floor of the largest buildings has ten thousand.
MOST = 5_000_000
#: Mean distance from the surface, m, over the least: half the depth of what hangs or stands there.
STANDOFF, NEAREST = 0.03, 0.01
#: Below the first height over the lowest floor an upward face is a floor, above the second none is within reach, m.
LOW, HIGH = 0.15, 2.0


class Population(NamedTuple):
    """Objects of one sort.

    Attributes:
        mean: radar cross section of a lone one head-on, far away, m^2 (half of it at 45 deg).
        exponent: of its distribution P(sigma > s) = exp(-(s / scale)^exponent).
        lobe: scattering pattern (`media.scattering`).
        reflectivity: of power, of extended ones (`scatterers.extended_factor`); None: points.
    """

    mean: float
    exponent: float
    lobe: tuple[float, float, float, float] = LAMBERT
    reflectivity: float | None = None

    @property
    def taken(self) -> float:
        """What one takes from what falls on the surface, m^2."""
        return self.mean / 4 * (self.lobe[0] + self.lobe[2] / concentration(self.lobe[3]))

    def cross_sections(self, size: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Weibull's law from exponential numbers of mean 1, m^2."""
        return self.mean / gamma(1 + 1 / self.exponent) * size ** (1 / self.exponent)

    def strongest(self, size: Float[np.ndarray, "n"], stride: int) -> Float[np.ndarray, "n"]:
        """Weights of power where one in `stride`, the strongest ones, stands for all; mean power stays."""
        least = log(stride)
        held = gammaincc(1 + 1 / self.exponent, least)  # share of the mean cross section that they have
        return (size > least) / held

    def drawn(
        self, place: Float[np.ndarray, "n 3"], left: Float[np.ndarray, "n"], rng: np.random.Generator
    ) -> Scatterers:
        """Some at places (m), of which others' shadows leave a share of the cross section."""
        size = rng.exponential(1.0, len(place))
        sigma = self.cross_sections(size) * left
        extended = 0 * sigma if self.reflectivity is None else np.sqrt(sigma / (np.pi * self.reflectivity))
        return replace(
            Scatterers.points(place, sigma, rng.uniform(0, 2 * np.pi, len(place))),
            bounces=self.strongest(size, BOUNCE_STRIDE), bounces_twice=self.strongest(size, BOUNCE_STRIDE**2),
            lobe=np.tile(self.lobe, (len(place), 1)), extended=extended,
        )  # fmt: skip


#: At each density there are as many small objects as corners.
SMALL = Population(0.2, 0.7)
CORNERS = Population(2.0, 0.5, lobe=(0.0, 0.0, 1.0, 200.0), reflectivity=0.3)


class Clutter:
    """All small objects of a scene.

    Args:
        scene: the world; its `life.clutter` scales the densities.
        rng: draws them.

    Raises:
        InputError: there were to be more than `MOST`.
    """

    def __init__(self, scene: Scene, rng: np.random.Generator):
        triangles, normals = scene.triangles, scene.normals
        sides = triangles[:, 1:] - triangles[:, :1]
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
        middles, level = triangles.mean(axis=1), scene.surface_settings.clutter
        mean = level * densities(scene, middles, normals) * area
        if mean.sum() > MOST:
            raise InputError(
                f"scene {scene.name}: clutter is {level:g}, which makes {mean.sum():.2g} points, expected "
                f"at most {MOST:g}"
            )
        left, parts = in_the_open(crowding(scene, middles, normals)), []
        for population in (SMALL, CORNERS):
            on = np.repeat(np.arange(len(area)), rng.poisson(mean))
            place = scattered(triangles[on], rng)
            place += (NEAREST + rng.exponential(STANDOFF, len(on)))[:, None] * normals[on]
            found = population.drawn(place, left[on], rng)
            parts.append(replace(found, normal=normals[on], horizontal=scene.floors_and_ceilings[on]))
        self._points = Scatterers.joined(parts)
        place = self._points.position
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
    return scene.surface_settings.clutter * densities(scene, place, normal) * (SMALL.taken + CORNERS.taken)


def uncovered(
    scene: Scene, place: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """Share of the power that falls on surfaces, at places (m) on them, that objects leave for the surface itself."""
    return np.exp(-crowding(scene, place, normal))


def in_the_open(crowding: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """What is left of each object's cross section on average, with the shadows of the others."""
    return -np.expm1(-crowding) / np.maximum(crowding, 1e-12)
