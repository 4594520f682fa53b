"""Buildings out of square: realistic angles, planes that stay planes, and the echo of their corners."""

import numpy as np
import pytest

from benchmarks.references import corners
from benchmarks.references.corners import LAMBDA
from benchmarks.references.rigs import isotropic
from radarsim.world.description import built
from radarsim.world.generators.buildings import Building
from radarsim.world.planes import plates
from radarsim.world.squareness import CORNER, LEAN, out_of_square, shear

BUILDING = Building(kind="C", seed=4, furnished=False)


def slants(by):
    """Angles between the walls along x and along y less 90 deg, and of both from the vertical."""
    across_x, across_y = (np.linalg.inv(by).T @ axis for axis in np.eye(3)[:2])  # normals
    cosine = across_x @ across_y / np.linalg.norm(across_x) / np.linalg.norm(across_y)
    return abs(np.arcsin(cosine)), *(abs(np.arctan2(n[2], np.hypot(n[0], n[1]))) for n in (across_x, across_y))


@pytest.mark.parametrize("level", [0.5, 1.0, 2.0])
def test_angles_are_those_that_are_built(level):
    found = np.array([slants(shear(level, seed)) for seed in range(60)]).T
    for angles, (least, most) in zip(found, (CORNER, LEAN, LEAN), strict=True):
        # the shear by one angle changes the others in second order
        assert np.all((angles > 0.95 * level * least) & (angles < 1.05 * level * most + 1e-5))
        assert angles.mean() == pytest.approx(level * (least + most) / 2, rel=0.15)
    assert 15 < sum(shear(level, seed)[0, 1] > 0 for seed in range(60)) < 45


def test_the_drawing_itself():
    """Without unevenness the same objects; with it, the default, the same triangles shifted by a few centimetres, and
    floors level."""
    drawn = BUILDING.build()
    assert out_of_square(drawn, 0.0, 4) is drawn
    _, objects, *_ = built({"building": BUILDING.model_dump(), "clutter": 0}, "c", None)
    again = out_of_square(drawn, 1.0, 4)
    for one, two, three in zip(drawn, objects, again, strict=True):
        assert one.name == two.name and one.material == two.material and one.solid == two.solid
        assert np.array_equal(one.mesh.faces, two.mesh.faces)
        assert np.array_equal(two.mesh.vertices, three.mesh.vertices)
        moved = two.mesh.vertices - one.mesh.vertices
        assert np.all(moved[:, 2] == 0) and 0 < np.abs(moved).max() < 0.3
        assert two.two_sided == one.two_sided


def sizes(mesh):
    """Areas of a mesh's flat parts, m^2."""
    found = [p.corners for p in plates(mesh, np.ones(len(mesh.faces), bool), 1e-4)]
    return [np.linalg.norm(np.cross(c[2] - c[0], c[3] - c[1])) / 2 for c in found]


def test_planes_stay_planes():
    """As many flat parts as drawn, without overlaps and gaps."""
    drawn = [item for item in BUILDING.build() if "wall" in item.name]
    for one, two in zip(drawn, out_of_square(drawn, 1.0, 4), strict=True):
        found = sizes(two.mesh)
        assert len(found) == len(sizes(one.mesh)) and np.sum(found) == pytest.approx(two.mesh.area, rel=1e-4)


@pytest.mark.parametrize("off", [-1.0, -0.3, 0.0, 0.3, 1.0])
@pytest.mark.parametrize("distance", [1.0, 3.0])
def test_a_corner_out_of_square(off, distance):
    """Each order of its walls makes an image, with the position and strength of half a plane's diffraction."""
    angle = np.deg2rad(off)
    walls, position = corners.out_of_square(angle), np.array([distance, 0.0, 0.0])
    assert np.all(np.einsum("md,md->m", walls.normal, position - walls.center) > 0)

    _, isometry, amplitude = corners.both_ways(walls, isotropic(position, LAMBDA, corners.looking([-1.0, 0, 0])))
    images = isometry[:, :, :3] @ position + isometry[:, :, 3]
    aside = distance * np.sin(2 * angle)
    assert np.sort(images[:, 1]) == pytest.approx([-abs(aside), abs(aside)], abs=1e-9)
    assert images[:, 0] == pytest.approx(-distance * np.cos(2 * angle))
    assert np.abs(amplitude) == pytest.approx(abs(corners.image_out_of_square(angle, distance)[1]), rel=0.02)
