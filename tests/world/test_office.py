"""The office: reproducible, accessible, and with clean geometry."""

import zlib

import numpy as np
import pytest
import trimesh
from scipy import ndimage

from radarsim.world.clearance import Clearance
from radarsim.world.generators import walls
from radarsim.world.generators.buildings import Building, Office
from radarsim.world.scene import Scene


def test_same_seed_same_bytes():
    first, second, other = (Office(seed=s).build() for s in (5, 5, 6))
    assert [o.name for o in first] == [o.name for o in second]
    assert all(a.mesh.vertices.tobytes() == b.mesh.vertices.tobytes() for a, b in zip(first, second, strict=True))
    assert all(a.mesh.faces.tobytes() == b.mesh.faces.tobytes() for a, b in zip(first, second, strict=True))
    assert any(a.mesh.vertices.tobytes() != b.mesh.vertices.tobytes() for a, b in zip(first, other, strict=False))


#: Number of objects and of their corners, and weighted sums of positions that identify objects and materials.
KNOWN = {
    Office(seed=7): (303, 8548, 204063.0104, 141929.0465, 29369.4556),
    Office(seed=11, length=40, depth=9.6, corridor=2.4, room=4.0): (538, 16504, 1540320.7812, 385908.7593, 87630.1675),
    Building(kind="B", seed=9, floor=1): (847, 25966, 3231261.2557, 2000244.4808, 217556.0269),
    Building(kind="D", seed=4): (950, 26112, 3585067.5563, 2815691.2398, 271996.7872),
}


@pytest.mark.parametrize("building", KNOWN, ids=lambda b: f"{b.kind} {b.seed}")
def test_floors_are_those_that_results_were_made_with(building):
    objects = building.build()
    checksums = [zlib.crc32(f"{o.name} {o.material.name} {o.solid}".encode()) / 2**32 for o in objects]
    sums = np.arange(1, len(objects) + 1) * checksums @ np.array([o.mesh.vertices.mean(axis=0) for o in objects])
    found = (len(objects), sum(len(o.mesh.vertices) for o in objects), *sums)
    assert found == pytest.approx(KNOWN[building], abs=1e-3, rel=0)


def test_a_meeting_room_may_be_narrow():
    names = {o.name for o in Office(seed=656290, length=43, depth=24, room=3).build()}
    assert any("table 1" in name for name in names)


def test_walls_of_a_solid_with_a_window():
    found = walls.faces([(0, 0, 0, 4, 0.2, 3)], [(1, 0, 1, 2, 0.2, 2)])
    area = {axis: sum(f.area for f in found if f.axis == axis) for axis in range(3)}
    assert area[1] == pytest.approx(2 * (4 * 3 - 1))  # both sides, less the window
    assert area[0] == pytest.approx(2 * 0.2 * 3 + 2 * 0.2)  # ends and jambs
    assert area[2] == pytest.approx(2 * 0.2)  # sill and lintel; floor and ceiling are not drawn
    mesh = walls.surface(found)
    # Every normal points from the solid into the open.
    for center, normal in zip(mesh.triangles_center, mesh.face_normals, strict=True):
        inside, outside = center - 0.01 * normal, center + 0.01 * normal
        assert _solid(inside) and not _solid(outside)


def _solid(p):
    window = 1 < p[0] < 2 and 1 < p[2] < 2
    return 0 < p[0] < 4 and 0 < p[1] < 0.2 and 0 < p[2] < 3 and not window


def test_touching_walls_hide_nothing():
    # A T junction: the strip where one wall meets the other is no face.
    found = walls.faces([(0, 0, 0, 4, 0.2, 3), (2, 0.2, 0, 2.2, 3, 3)], [])
    north = [f for f in found if f.axis == 1 and f.sign == 1 and f.level == pytest.approx(0.2)]
    assert sum(f.area for f in north) == pytest.approx((4 - 0.2) * 3)


def test_is_an_office(office):
    low, high = office.bounds
    assert np.all(high[:2] - low[:2] >= [15, 10])
    names = " ".join(o.name for o in office.objects)
    for thing in ("desk", "chair", "cabinet", "radiator", "shelf", "whiteboard", "lamp", "door", "window", "ceiling"):
        assert thing in names
    used = {o.material.name for o in office.objects}
    assert {"plasterboard", "concrete", "glass", "metal", "carpet", "vinyl", "ceiling board", "wood"} <= used
    assert all(len(o.mesh.facets) or len(o.mesh.faces) == 1 for o in office.objects)


@pytest.mark.parametrize("building", [Office(seed=0), Office(seed=7), Building(kind="A"), Building(kind="C")])
def test_no_face_lies_on_another(building):
    """The nearest surface just outside any face is that face itself, not a coplanar copy."""
    scene = Scene("x", building.build())
    rng = np.random.default_rng(0)
    weight = rng.dirichlet(np.ones(3), len(scene.triangles))
    points = np.einsum("tk,tkd->td", weight, scene.triangles)
    flat = np.linalg.norm(np.cross(*np.moveaxis(scene.triangles[:, 1:] - scene.triangles[:, :1], 1, 0)), axis=1) > 1e-4
    start = points + 1.5e-3 * scene.normals
    distance, index = scene.hit(start[flat], -scene.normals[flat])
    own = scene.triangle_object[index] == scene.triangle_object[flat]
    same_place = np.abs(distance - 1.5e-3) < 1e-5
    assert (own & same_place).mean() > 0.995


@pytest.mark.parametrize("seed", range(4))
def test_corridor_and_rooms_are_connected(seed):
    office = Office(seed=seed)
    scene = Scene("office", office.build())
    clearance = Clearance.of(scene, 0.06, 1.8)
    labels, _ = ndimage.label(clearance.distance >= 0.4)
    sizes = np.bincount(labels.ravel())[1:]
    cell = 0.025**2
    # The corridor with at least 1.2 m of its width, and rooms besides.
    assert sizes.max() * cell > 1.2 * (office.length - 2) + 10


def test_clearance_is_a_distance(office):
    clearance = Clearance.of(office, 0.06, 1.8)
    # Without what is nearer above or below than beside: floor, ceiling, lamps; and short of the lintels.
    beside = [o for o in office.objects if not o.is_floor_or_ceiling and o.mesh.bounds[0, 2] < 1.8]
    triangles = np.concatenate([o.mesh.triangles for o in beside])
    every = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)
    rng = np.random.default_rng(0)
    points = rng.uniform([1, 5.1], [17, 6.9], (40, 2))
    found = clearance.at(points)
    heights = np.linspace(0.1, 1.4, 24)
    column = np.concatenate([np.column_stack([points, np.full(len(points), h)]) for h in heights])
    _, true, _ = trimesh.proximity.closest_point(every, column)
    true = true.reshape(len(heights), -1).min(axis=0)
    assert np.all(found <= true + 0.01)
    assert np.median(true - found) < 0.12
