"""Diffuse multipath of rooms: waves that are scattered from surface to surface before they return to the radar.

A room continues to echo for some metres of range beyond its walls: power scattered by structure and small objects falls
on others, and some of it returns (Andersen, Nielsen, Pedersen, Bauch, Herdin, "Room electromagnetics", IEEE Antennas
and Propagation Magazine 49(2), 2007). The model is a random walk of waves, as in acoustics and in radiosity. A walk
begins at a place on a surface, drawn with a density proportional to the fraction of power that is scattered there (its
albedo), in a direction with a Lambertian distribution. At each surface the wave is scattered, reflected, transmitted or
absorbed at random with the probability of the corresponding power fraction. Every place of scattering ends a detour:
the radar's wave is incident on one end, and returns from the other. With A, the area represented by a walk at its
start, albedos rho, and the antenna's gains G, the power of a detour in one direction is

    P / P_t = lambda^2 / (16 pi^3)  A rho_begin rho_end  (G cos / r^2)_begin  (G cos / r^2)_end,

half of it in the receiver's polarisation, because two scatterings depolarise. Both directions of a detour have the
same length, so their amplitudes add (coherent backscattering, twice the power).

The walks are fixed in the world, so their echoes are coherent under motion like all others.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarize.radar.config import RadarConfig
from radarsim.propagation.clutter import NEAREST, uncovered
from radarsim.propagation.fields import facing, gain_towards, length, minus, vec
from radarsim.propagation.media import as_slab, layer, mirror, sweep_share, window
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table
from radarsim.world.scene import Scene
from radarsim.world.shapes import areas, scattered

#: Number of walks per square metre of albedo 1; largest number in a scene.
DENSITY, MOST = 40.0, 1_000_000
#: Largest number of surfaces of a walk.
STEPS = 6
# m^2: at a distance below the width of the area represented by a walk, the radar sees only a part of it
_NEAR = 1 / (np.pi * DENSITY)


@dataclass(frozen=True)
class Detours(Table):
    """Paths of waves between two places of scattering.

    Attributes:
        begin, end: positions, m.
        begin_normal, end_normal: outward normals of the surfaces there.
        between: length of the walk, m.
        weight: area represented by the start times both albedos, m^2.
        phase: rad, random.
    """

    begin: Float[np.ndarray, "detour 3"]
    end: Float[np.ndarray, "detour 3"]
    begin_normal: Float[np.ndarray, "detour 3"]
    end_normal: Float[np.ndarray, "detour 3"]
    between: Float[np.ndarray, "detour"]
    weight: Float[np.ndarray, "detour"]
    phase: Float[np.ndarray, "detour"]

    @classmethod
    def of(cls, scene: Scene, config: RadarConfig, rng: np.random.Generator) -> "Detours":
        """Draw the detours of a scene; without clutter there are none.

        Args:
            scene: the world.
            config: radar configuration; its frequency determines reflection.
            rng: random generator.
        """
        surfaces = Albedos(scene, config)
        corners, normals, albedo = scene.triangles, scene.normals, surfaces.albedo
        scattering = albedo * areas(corners) * np.where(surfaces.two_sided, 2, 1)
        density = min(DENSITY, MOST / max(scattering.sum(), 1e-9))
        on = np.repeat(np.arange(len(corners)), rng.poisson(density * scattering))
        behind = surfaces.two_sided[on] & (rng.random(len(on)) < 0.5)
        normal = np.where(behind, -1.0, 1.0)[:, None] * normals[on]
        begin = scattered(corners[on], rng) + NEAREST * normal
        walk, place, way = np.arange(len(on)), begin, _lambert(normal, rng)
        gone, parts = np.zeros(len(on)), [cls.zeros(0)]
        for _ in range(STEPS):
            distance, triangle = scene.hit(place, way)
            met = triangle >= 0
            walk, way, distance, triangle = walk[met], way[met], distance[met], triangle[met]
            gone, place = gone[met] + distance, place[met] + distance[:, None] * way
            against = np.sum(way * normals[triangle], axis=1)
            outward, here = normals[triangle] * -np.sign(against)[:, None], albedo[triangle]
            in_front = (against < 0) | surfaces.two_sided[triangle]
            end = np.flatnonzero(in_front & (here > 0))
            parts.append(cls(
                begin[walk[end]], place[end] + NEAREST * outward[end], normal[walk[end]], outward[end], gone[end],
                here[end] / density, rng.uniform(0, 2 * np.pi, len(end)),
            ))  # fmt: skip
            mirrored, passed = surfaces.shares(triangle, np.abs(against))
            edges = np.cumsum(np.where(in_front, [here, mirrored, passed], [[0], [0], [1]]), axis=0)
            fate = np.sum(rng.random(len(walk)) >= edges, axis=0)  # scattered, mirrored, let through, lost
            way = np.where((fate == 1)[:, None], way - 2 * against[:, None] * normals[triangle], way)
            way[fate == 0] = _lambert(outward[fate == 0], rng)
            place = place + NEAREST / 10 * np.where((fate == 2)[:, None], -outward, outward)
            left = fate < 3
            walk, place, way, gone = walk[left], place[left], way[left], gone[left]
        return cls.joined(parts)


class Albedos:
    """Fractions of the incident power that the triangles of a scene scatter, reflect and transmit.

    Attributes:
        albedo: fraction scattered by structure and small objects, for each triangle.
        two_sided: whether a triangle scatters on both sides.
    """

    def __init__(self, scene: Scene, config: RadarConfig):
        slabs = [as_slab(item)[0] for item in scene.objects]
        number = {slab: k for k, slab in enumerate(dict.fromkeys(slabs))}
        self._layers = np.array([layer(slab, config) for slab in number])
        self._layer = np.array([number[slab] for slab in slabs], int)[scene.triangle_object]
        self._sweep = sweep_share(config)
        self.two_sided = np.array([item.two_sided for item in scene.objects], bool)[scene.triangle_object]
        self.albedo = 1 - uncovered(scene, scene.triangles.mean(axis=1), scene.normals)

    def shares(self, triangle: Int[np.ndarray, "n"], cosine: Float[np.ndarray, "n"]) -> Float[np.ndarray, "2 n"]:
        """Power fractions reflected and transmitted by triangles at cosines of incidence, of both polarisations."""
        found = np.empty((2, len(triangle)))
        _shares(self._layers, self._layer[triangle], cosine, self._sweep, found)
        return found * (1 - self.albedo[triangle])


@njit(cache=True)
def _shares(layers, which, cosine, sweep, found):
    for i in range(len(which)):
        one = layers[which[i]]
        te, tm = mirror(one, cosine[i])
        found[0, i], found[1, i] = (abs(te) ** 2 + abs(tm) ** 2) / 2, 0.0
        if one[1].real > 0:
            te, tm, _ = window(one, max(cosine[i], 1e-3), sweep)
            found[1, i] = (abs(te) ** 2 + abs(tm) ** 2) / 2


def _lambert(normal: Float[np.ndarray, "n 3"], rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Random directions about normals with a density proportional to the cosine (Malley): to a point of the unit sphere
    that touches the surface."""
    ball = rng.standard_normal((len(normal), 3))
    way = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
    return way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)


def echoes(
    observation: Observation, detours: Detours
) -> tuple[Int[np.ndarray, "echo"], Int[np.ndarray, "echo"], Float[np.ndarray, "echo"]]:
    """Select detours that may echo in each frame, before visibility tests of their ends.

    Returns:
        Frame, detour, and amplitude in either direction (square root of received over transmitted power).
    """
    count = np.zeros(observation.frames, np.int64)
    index = np.empty((observation.frames, len(detours)), np.int32)
    amplitude = np.empty(index.shape, np.float32)
    _look(observation, detours.columns, count, index, amplitude)
    rows = range(observation.frames)
    return (
        np.repeat(rows, count), np.concatenate([index[k, : count[k]] for k in rows]).astype(int),
        np.concatenate([amplitude[k, : count[k]] for k in rows]).astype(float),
    )  # fmt: skip


@njit(parallel=True, cache=True)
def _look(observation, detours, count, index, amplitude):
    scale = observation.wavelength / (8 * np.pi**1.5)
    for frame in prange(len(observation.position)):
        p, rotation, n = vec(observation.position[frame]), observation.rotation[frame], 0
        for i in range(len(detours.weight)):
            begin, end = minus(vec(detours.begin[i]), p), minus(vec(detours.end[i]), p)
            near, far = length(begin), length(end)
            if near + detours.between[i] + far > 2 * observation.range:
                continue
            here = facing(detours.begin_normal[i], (-begin[0] / near, -begin[1] / near, -begin[2] / near), False)
            there = facing(detours.end_normal[i], (-end[0] / far, -end[1] / far, -end[2] / far), False)
            if here <= 0 or there <= 0:
                continue
            spread = (near * near + _NEAR) * (far * far + _NEAR)
            most = scale * np.sqrt(detours.weight[i] * here * there / spread)
            if most * observation.peak_gain**2 <= observation.threshold:
                continue
            value = most * gain_towards(begin, rotation, observation) * gain_towards(end, rotation, observation)
            if value > observation.threshold:
                index[frame, n], amplitude[frame, n] = i, value
                n += 1
        count[frame] = n
