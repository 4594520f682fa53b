"""Flat regions of scanned meshes echo as planes; polygons are covered by rectangles."""

from functools import cache

import numpy as np
import pytest
import shapely
import trimesh

from benchmarks.references.rigs import field
from radarize.radar.presets import PRESETS
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import planes, shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]


def scanned_wall(seed, noise, step=0.05, size=2.0):
    """A wall at x = 2 m, facing -x, as a scanner gives it: triangles of `step`, corners with `noise` RMS error."""
    n = round(size / step) + 1
    y, z = np.meshgrid(np.linspace(-size / 2, size / 2, n), np.linspace(-size / 2, size / 2, n), indexing="ij")
    vertices = np.stack([np.full(y.size, 2.0), y.ravel(), z.ravel()], axis=1)
    vertices += np.random.default_rng(seed).normal(0, noise, vertices.shape)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return trimesh.Trimesh(vertices, np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)]), process=False)


def finder(mesh):
    """Finder of the paths to a concrete wall."""
    scene = Scene("scan", [SceneObject("wall", mesh, MATERIALS["concrete"])])
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    return PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG)


#: The same of a scanned one, by its seed and noise.
scanned = cache(lambda seed, noise: finder(scanned_wall(seed, noise)))


def coherent_field(finder, position):
    """Sum of all visible specular reflections, edges and corners."""
    echoes = finder(position, np.eye(3))
    return field(echoes, position, CONFIG.wavelength)


@pytest.mark.parametrize("position", [(0, 0, 0), (0.3, 0.4, -0.2), (0, 0.97, 0.3)])
def test_a_scanned_wall_does_not_sparkle(position):
    """A 2 m wall of 5 cm triangles with 0.5 mm noise returns within 1 dB of the flat one, whatever the seed."""
    position = np.array(position, float)
    flat = abs(coherent_field(scanned(0, 0.0), position))
    for seed in range(8):
        assert 20 * np.log10(abs(coherent_field(scanned(seed, 5e-4), position)) / flat) == pytest.approx(0, abs=1)


def test_a_scanned_corner_is_two_planes():
    """Two noisy walls that share an edge stay separate."""
    wall = scanned_wall(3, 5e-4, size=1.0)
    other = wall.copy()
    other.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1], [2, 0.5, 0]))
    corner = trimesh.util.concatenate([wall, other])
    corner.merge_vertices(digits_vertex=2)
    areas = sorted(corner.area_faces[r].sum() for r in planes.regions(corner))[-2:]
    assert areas == pytest.approx([1, 1], abs=0.15)


def test_curved_surfaces_are_no_planes():
    """Facets of a finely tessellated pipe and sphere are not joined: the surface bends too much."""
    for mesh, side in ((shapes.cylinder((0, 0, 0), 0.05, 1, 60), 2), (shapes.sphere((0, 0, 0), 0.1), 1)):
        on_side = [r for r in planes.regions(mesh) if abs(mesh.face_normals[r[0]] @ [0, 0, 1]) < 0.999]
        assert max(len(r) for r in on_side) <= side


def tiled(quads, region):
    """Whether quadrilaterals do not overlap and together cover a region."""
    shapes_ = [shapely.Polygon(q) for q in quads]
    assert sum(s.area for s in shapes_) == pytest.approx(region.area)
    assert shapely.union_all(shapes_).symmetric_difference(region).area < 1e-5


def test_right_angles_are_covered_exactly():
    """An L of two rectangles, a wall with a window of four, a wall with a doorway of three."""
    window = shapely.box(0, 0, 5, 3) - shapely.box(1, 1, 2, 2)
    doorway = shapely.box(0, 0, 5, 3) - shapely.box(1, 0, 2, 2)
    ell = shapely.Polygon([(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)])
    for region, count in ((ell, 2), (window, 4), (doorway, 3)):
        quads = planes.trapezoids(region)
        assert len(quads) == count
        tiled(quads, region)


@pytest.mark.parametrize(
    ("region", "count"),
    [
        (shapely.Polygon([(0, 0), (1, 0), (0.7, 0.6), (0.2, 0.6)]), 1),
        (shapely.Polygon([(0, 0), (1, 0), (0, 0.8)]), 1),
        (shapely.Polygon([(0, 0), (1, 0.2), (0.3, 0.8)]), 2),
        (shapely.Point(0, 0).buffer(0.5, quad_segs=3), 6),
        (shapely.Point(0, 0).buffer(0.5, quad_segs=3) - shapely.box(0, -0.1, 1, 0.1), 8),
    ],
    ids=["trapezoid", "right triangle", "triangle", "disc", "notched disc"],
)
def test_slanted_edges_are_covered_exactly(region, count):
    quads = planes.trapezoids(region)
    assert len(quads) <= count
    tiled(quads, region)
    for quad in quads:
        inner = shapely.box(*planes.inner_rectangle(quad))
        assert inner.difference(shapely.Polygon(quad)).area < 1e-9
        assert inner.area > 0.3 * shapely.Polygon(quad).area


def test_leaning_faces_are_covered_to_the_bit_as_their_outlines_are_cut(monkeypatch):
    """Boxes out of square, and wedges: in arrays as by cutting the union of each face's triangles."""
    rng = np.random.default_rng(1)
    boxes = [shapes.box(rng.uniform(-5, 5, 3), rng.uniform(0.02, 3, 3)) for _ in range(40)]
    for box in boxes:
        box.vertices = box.vertices @ (np.eye(3) + rng.normal(0, 0.003, (3, 3)))
        top = box.vertices[:, 2] > box.vertices[:, 2].mean()
        box.vertices[top, 0] += 0.01 * rng.integers(0, 2) * np.ptp(box.vertices[:, 0]) * np.sign(box.vertices[top, 1])
    meshes = [(box, rng.random(12) < 0.9) for box in boxes]
    found = planes.plates_of_each(meshes, 1e-5)
    apart = [planes.plates(*each, 1e-5) for each in meshes]
    monkeypatch.setattr(planes, "_lone_trapezoids", lambda flat, _: (np.zeros(len(flat), bool), flat[:, 0]))
    cut = [planes.plates(*each, 1e-5) for each in meshes]
    assert sum(map(len, found)) > 200
    for one, *others in zip(found, apart, cut, strict=True):
        for other in others:
            assert [[np.asarray(x).tobytes() for x in vars(p).values()] for p in one] == [
                [np.asarray(x).tobytes() for x in vars(p).values()] for p in other
            ]


def test_an_ell_shaped_wall_reflects_where_it_is():
    """The coherent echo of an L-shaped mesh is that of a large wall in front of it and none in front of the notch."""
    ell = shapely.Polygon([(-1, -1), (1, -1), (1, 0), (0, 0), (0, 1), (-1, 1)])
    mesh = shapes.polygon(ell, (2, 0, 0), (0, -1, 0), (0, 0, 1))
    wall = abs(coherent_field(scanned(0, 0.0), np.zeros(3)))
    beside, notch = (abs(coherent_field(finder(mesh), np.array(p))) for p in ([0.0, 0.5, 0.5], [0.0, -0.5, 0.5]))
    assert 20 * np.log10(beside / wall) == pytest.approx(0, abs=2)
    assert notch < 0.2 * wall
