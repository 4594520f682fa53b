"""Meshes of any shape and orientation, thin ones included, are covered by plates and can be simulated."""

import numpy as np
import pytest
import trimesh
from hypothesis import example, given, settings
from hypothesis import strategies as st

from radarize.radar.presets import PRESETS
from radarsim.propagation.bodies import recognise
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.smooth import pieces
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.planes import regions
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
SMALLEST = CONFIG.wavelength**2
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
FLOOR = SceneObject("floor", shapes.rectangle((0, 0, 0), (8, 8), (0, 0, 1)), MATERIALS["concrete"])

size = st.floats(np.log(1e-3), np.log(5.0)).map(np.exp)
angle = st.floats(-180, 180) | st.sampled_from([-90.0, 0.0, 45.0, 90.0])
sides = st.integers(3, 60)
bodies = st.one_of(
    st.builds(lambda r, h, n: shapes.cylinder((0, 0, 0), r, h, n), size, size, sides),
    st.builds(lambda *a: shapes.box((0, 0, 0), a), size, size, size),
    st.builds(lambda r, n: shapes.sphere((0, 0, 0), r, n), size, st.integers(0, 3)),
    st.builds(lambda a, b: shapes.rectangle((0, 0, 0), (a, b), (1, 0, 0)), size, size),
    st.builds(lambda r, h, n: trimesh.creation.cone(r, h, sections=n), size, size, sides),
)


def flat_area(mesh):
    """Area of all regions that are neither curved nor below a squared wavelength, m^2."""
    _, is_round = recognise(mesh)
    _, is_curved = pieces(mesh, ~is_round, SMALLEST)
    if (is_round | is_curved).all():
        return 0.0
    flat = trimesh.Trimesh(mesh.vertices, mesh.faces[~(is_round | is_curved)], process=False)
    return sum(area for faces in regions(flat) if (area := flat.area_faces[faces].sum()) >= SMALLEST)


def area(corners):
    """Areas of quadrilaterals, m^2: half the cross product of the diagonals."""
    return np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1).sum() / 2


@given(bodies, st.tuples(angle, angle, angle), st.sampled_from(["metal", "plasterboard", "glass"]))
@settings(max_examples=60, deadline=None, derandomize=True)
@example(shapes.cylinder((0, 0, 0), 0.03, 0.2, 24), (-8.4, -65.9, -17.4), "metal")
@example(shapes.cylinder((0, 0, 0), 0.005, 0.7, 48), (3.9, -34.4, -18.8), "metal")
@example(shapes.cylinder((0, 0, 0), 0.4032, 0.0274, 57), (-93.9, 74.6, -115.6), "metal")
def test_any_shape_is_covered_and_found(mesh, rotation, material):
    """Plates cover 99 % of the flat area and nothing else, and a frame has finite echoes."""
    mesh = shapes.placed(mesh, (2, 0, 1), np.deg2rad(rotation))
    scene = Scene("one", [SceneObject("body", mesh, MATERIALS[material]), FLOOR])
    reflectors = Reflectors.of(scene, CONFIG)
    assert area(reflectors.flat.corners) == pytest.approx(flat_area(mesh) + 64, abs=0.01 * flat_area(mesh) + 1e-6)
    echoes = PathFinder(scene, NOTHING, reflectors, CONFIG)(np.array([0.0, 0.0, 1.0]), np.eye(3))
    assert np.isfinite(echoes.amplitude).all()
