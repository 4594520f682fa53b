"""References for `tests/propagation/test_patches.py` and the gallery."""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from benchmarks.references.rigs import isotropic
from radarize.radar.presets import PRESETS
from radarsim.propagation import patches
from radarsim.propagation.curved import path_over
from radarsim.propagation.reflectors import Reflectors
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]

LAMBDA = CONFIG.wavelength


def reflectors(mesh, material="metal"):
    return Reflectors.of(Scene("body", [SceneObject("body", mesh, MATERIALS[material])]), CONFIG)


def ahead(position):
    """Return the rotation of a radar at a position that faces the origin."""
    way = -np.asarray(position, float) / np.linalg.norm(position)
    return Rotation.align_vectors([way], [[1.0, 0.0, 0.0]])[0].as_matrix()


def field(found, position):
    """Return the echo of smooth surfaces, with an isotropic antenna."""
    position = np.asarray(position, float)
    return summed(patches.specular_points(isotropic(position, LAMBDA, ahead(position)), 0, found.smooth), position)


def summed(points, position):
    """Sum the echoes of curved reflectors at a position, each with the phase of its path."""
    path = [path_over(geometry, tuple(position), tuple(position)) for geometry in points.geometry]
    return np.sum(points.amplitude * np.exp(2j * np.pi * np.array(path) / LAMBDA))


def physical_optics(surface, position, soft=0.3):
    """Return the echo amplitude by physical optics: -(1 / 4 pi j) sum of cos exp(j 2 k rho) / rho^2 dA over the lit
    side of a conductor, tapered to the shadow."""
    place, normal, area = surface
    away = np.asarray(position, float) - place
    rho = np.linalg.norm(away, axis=1)
    cosine = np.sum(away * normal, axis=1) / rho
    lit = np.clip(cosine / soft, 0, 1)
    lit = lit * lit * (3 - 2 * lit)
    return -np.sum(lit * cosine * np.exp(4j * np.pi * rho / LAMBDA) / rho**2 * area) / (4j * np.pi)


def grid(first, second, sizes):
    """Return all pairs of the midpoints of two intervals, and the area of a cell."""
    (a, b), (c, d), (n, m) = first, second, sizes
    x, y = a + (np.arange(n) + 0.5) / n * (b - a), c + (np.arange(m) + 0.5) / m * (d - c)
    x, y = (each.ravel() for each in np.meshgrid(x, y, indexing="ij"))
    return x, y, (b - a) * (d - c) / (n * m)


def ellipsoid(axes, fine=1200):
    """Return positions, normals and areas of the surface elements of an ellipsoid."""
    theta, phi, cell = grid((0, np.pi), (0, 2 * np.pi), (fine // 2, fine))
    way = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    gradient = way / axes
    size = np.linalg.norm(gradient, axis=1)
    return way * axes, gradient / size[:, None], np.prod(axes) * size * np.sin(theta) * cell


def tube(radius, half, begin, end, fine=(600, 1200)):
    phi, z, cell = grid((begin, end), (-half, half), fine)
    normal = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    return radius * normal + z[:, None] * [0, 0, 1], normal, np.full(len(z), radius * cell)


def rounded(radius, half):
    """Return the surface elements of a cylinder with hemispheres on its ends."""
    theta, phi, cell = grid((0, np.pi / 2), (0, 2 * np.pi), (250, 900))
    parts = [tube(radius, half, 0, 2 * np.pi)]
    for s in (1, -1):
        normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), s * np.cos(theta)], axis=1)
        parts.append((radius * normal + [0, 0, s * half], normal, radius**2 * np.sin(theta) * cell))
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def half_cylinder(radius, height, sides, back=True):
    """Return the mesh of half a cylinder, whose curved side faces -x."""
    angle = np.linspace(np.pi / 2, 3 * np.pi / 2, sides + 1)
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(sides + 1, -height / 2)])
    i, n = np.arange(sides), sides + 1
    faces = [np.stack([i, i + 1, i + 1 + n], 1), np.stack([i, i + 1 + n, i + n], 1)]
    if back:
        fan = np.stack([np.zeros(n - 2, int), np.arange(1, n - 1), np.arange(2, n)], 1)
        faces += [[[n - 1, 0, n], [n - 1, n, 2 * n - 1]], fan + n, fan[:, ::-1]]
    return shapes.exact(np.concatenate([low, low + [0, 0, height]]), np.concatenate(faces))


def capsule(radius, half, count=24):
    mesh = trimesh.creation.capsule(height=2 * half, radius=radius, count=[count, count])
    return shapes.exact(mesh.vertices - mesh.bounds.mean(axis=0), mesh.faces)


def stretched(axes, subdivisions=3):
    ball = shapes.sphere((0, 0, 0), 1.0, subdivisions)
    return shapes.exact(ball.vertices * axes, ball.faces)
