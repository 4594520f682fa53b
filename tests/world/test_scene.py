"""Ray tests against other programs' and against geometry calculated manually."""

import numpy as np
import pytest
import trimesh

from radarize.io.errors import InputError
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene, _lent
from tests.world.beams import level_beams

WOOD, METAL = MATERIALS["wood"], MATERIALS["metal"]


@pytest.fixture(scope="module")
def clutter() -> Scene:
    rng = np.random.default_rng(3)
    objects = []
    for i in range(25):
        shape = shapes.placed(
            shapes.box((0, 0, 0), rng.uniform(0.1, 0.8, 3)), rng.uniform(0, 5, 3), rng.uniform(0, 3, 3)
        )
        objects.append(SceneObject(f"box.{i}", shape, WOOD if i % 2 else METAL))
    objects.append(SceneObject("sheet", shapes.rectangle((2.5, 2.5, 1), (3, 2), (1, 1, 0)), METAL))
    return Scene("clutter", objects)


def brute_force(scene: Scene, origins, directions):
    """Nearest hit by Moeller and Trumbore's test of every triangle, in float64."""
    a, b, c = (scene.triangles[:, k] for k in range(3))
    edge1, edge2 = b - a, c - a
    best, index = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for i, (o, d) in enumerate(zip(origins, directions, strict=True)):
        p = np.cross(d, edge2)
        det = np.sum(edge1 * p, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = o - a
            u = np.sum(s * p, axis=1) / det
            q = np.cross(s, edge1)
            v = q @ d / det
            t = np.sum(edge2 * q, axis=1) / det
        ok = (np.abs(det) > 1e-12) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
        if ok.any():
            hit = np.flatnonzero(ok)[t[ok].argmin()]
            best[i], index[i] = t[hit], scene.triangle_object[hit]
    return best, index


def test_rays_and_occlusion_match_brute_force(clutter):
    rng = np.random.default_rng(1)
    origins, targets = rng.uniform(-1, 6, (2, 400, 3))
    lengths = np.linalg.norm(targets - origins, axis=1)
    directions = (targets - origins) / lengths[:, None]
    expected, index = brute_force(clutter, origins, directions)
    distance, triangle = clutter.hit(origins, directions * 3)  # length of a direction does not matter
    assert np.array_equal(np.isfinite(distance), np.isfinite(expected))
    hit = np.isfinite(expected)
    assert hit.sum() > 100
    assert np.abs(distance[hit] - expected[hit]).max() < 1e-5
    assert np.array_equal(np.where(triangle < 0, -1, clutter.triangle_object[triangle]), index)
    clear_of_ends = (np.abs(expected - lengths) > 2e-3) & (expected > 2e-3)
    assert np.array_equal(clutter.occluded(origins, targets)[clear_of_ends], (expected < lengths)[clear_of_ends])


def test_margin_ignores_the_surfaces_at_both_ends(clutter):
    sheet = Scene("sheet", [SceneObject("sheet", shapes.rectangle((0, 0, 0), (2, 2), (1, 0, 0)), METAL)])
    on_it, ahead, behind = np.array([[0.0, 0.1, 0.1]]), np.array([[2.0, 0, 0]]), np.array([[-2.0, 0, 0]])
    assert not sheet.occluded(ahead, on_it)[0] and not sheet.occluded(on_it, behind)[0]
    assert sheet.occluded(ahead, behind)[0] and sheet.occluded(behind, ahead)[0]  # two-sided
    assert not sheet.occluded(np.zeros((0, 3)), np.zeros((0, 3))).size


def test_any_number_of_rays_takes_the_same_compiled_kernel(clutter):
    rng = np.random.default_rng(2)
    clutter.occluded(np.zeros(3), np.ones((1, 3)))  # Dr.Jit is there
    import drjit as dr

    for test in (clutter.occluded, clutter.hit):
        kernels = set()
        for number in (2, 3, 16, 17, 100, 4001):
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                test(*rng.uniform(-1, 6, (2, number, 3)))
            kernels.add(tuple(kernel["hash"] for kernel in dr.kernel_history()))
        assert len(kernels) == 1 and len(kernels.pop()) == 1


def test_rays_match_open3d(office):
    o3d = pytest.importorskip("open3d")
    world = o3d.t.geometry.RaycastingScene()
    for item in office.objects:
        world.add_triangles(
            o3d.core.Tensor(item.mesh.vertices.astype(np.float32)), o3d.core.Tensor(item.mesh.faces.astype(np.uint32))
        )
    origins, directions = level_beams(np.array([9.0, 6.0, 1.13]), np.arange(-180, 180, 2.0))
    rays = o3d.core.Tensor(np.hstack([origins, directions]).astype(np.float32))
    expected = world.cast_rays(rays)["t_hit"].numpy()
    agree = np.isclose(office.hit(origins, directions)[0], expected, rtol=0, atol=1e-4)
    assert agree.mean() > 0.995  # rays through the very edge of something may fall on either side


def test_floor_plan_of_a_box_is_its_outline():
    scene = Scene("box", [SceneObject("box", shapes.box((1, 2, 0.5), (2, 1, 1)), WOOD)])
    plan = scene.floor_plan(0.3)
    lengths = np.hypot(plan[:, 2] - plan[:, 0], plan[:, 3] - plan[:, 1])
    assert sorted(lengths.round(6)) == [1, 1, 2, 2]
    assert plan[:, [0, 2]].min() == 0 and plan[:, [1, 3]].max() == 2.5
    assert scene.floor_plan(1.5).shape == (0, 4)
    assert len(scene.floor_plan(1.0)) == 0  # at the top face: nothing above it


def test_floor_plan_agrees_with_the_scan(office):
    """Every beam's end lies on a segment of the plan."""
    height, position = 1.21, np.array([5.0, 6.0, 1.21])  # extinguishers end at 1.2 m
    origins, directions = level_beams(position, np.arange(-180, 180, 3.0))
    ends = (origins + office.hit(origins, directions)[0][:, None] * directions)[:, :2]
    plan = office.floor_plan(height)
    a, along = plan[:, :2], plan[:, 2:] - plan[:, :2]
    t = np.einsum("nsk,sk->ns", ends[:, None] - a, along) / np.sum(along**2, axis=1)
    nearest = a + np.clip(t, 0, 1)[..., None] * along
    assert np.linalg.norm(nearest - ends[:, None], axis=2).min(axis=1).max() < 1e-4


def test_sionna_scene_has_our_materials():
    scene = Scene("mixed", [SceneObject("a.b", shapes.box((0, 0, 0), (1, 1, 1)), MATERIALS["brick"]),
                            SceneObject("c", shapes.box((3, 0, 0), (1, 1, 1)), METAL)])  # fmt: skip
    radio = scene.sionna.radio_materials
    assert float(radio["brick"].relative_permittivity.numpy()[0]) == pytest.approx(4.065, abs=1e-3)
    assert float(radio["metal"].conductivity.numpy()[0]) > 1e6
    assert len(scene.sionna.objects) == 2


def test_two_sidedness_and_floors():
    sheet = SceneObject("sheet", shapes.rectangle((0, 0, 0), (1, 1), (0, 0, 1)), METAL)
    block = SceneObject("block", shapes.box((0, 0, 0), (1, 1, 1)), METAL)
    lidless = SceneObject("lidless", shapes.box((0, 0, 0), (1, 1, 1), without=("-z",)), METAL, solid=True)
    assert sheet.two_sided and not block.two_sided and not lidless.two_sided
    assert sheet.is_floor_or_ceiling and not block.is_floor_or_ceiling


def lying(*objects: SceneObject) -> np.ndarray:
    """Heights of the triangles that are floor or ceiling."""
    scene = Scene("place", list(objects))
    return np.unique(scene.triangles[scene.floors_and_ceilings].mean(axis=1)[:, 2].round(6))


def test_floor_and_ceiling_of_a_room_in_one_mesh():
    """In a scan, faces at the bottom that face up are floor, and those at the top that face down are ceiling."""
    room, table = shapes.box((0, 0, 1.3), (5, 4, 2.6)), shapes.box((0, 0, 0.7), (1, 1, 0.04))
    room.invert()
    cabinet = shapes.box((2, 0, 1.05), (0.5, 0.5, 2.1))
    whole = shapes.joined(room, table, cabinet)
    assert lying(SceneObject("room", whole, METAL)) == pytest.approx([0, 2.6])
    tilted = whole.copy().apply_transform(trimesh.transformations.rotation_matrix(np.radians(1), (1, 0, 0)))
    assert len(lying(SceneObject("tilted", tilted, METAL)))
    scan = whole.submesh([np.arange(len(whole.faces) - 2)], append=True)  # with a hole
    assert lying(SceneObject("scan", scan, METAL)) == pytest.approx([0, 2.6])
    assert not len(lying(SceneObject("cabinet", cabinet, METAL), SceneObject("table", table, METAL)))
    assert not len(lying(SceneObject("body", scan, METAL, solid=True)))


@pytest.mark.parametrize("name", ["office", "buildings/a", "floor"])
def test_drawn_places_have_whole_floors(name):
    scene = Scene.load(name)
    whole = np.array([item.is_floor_or_ceiling for item in scene.objects])[scene.triangle_object]
    assert whole.any() and (scene.floors_and_ceilings == whole).all()


@pytest.mark.parametrize("shape", [shapes.box((1, 2, 3), (1, 2, 3)), shapes.cylinder((1, 0, 0), 0.5, 2, 8),
                                   shapes.sphere((0, 1, 0), 0.5, 2)])  # fmt: skip
def test_normals_point_outward(shape):
    assert shape.is_watertight and shape.volume > 0


@pytest.mark.parametrize("facing", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (1, 2, 3)])
def test_rectangle_faces_where_it_says(facing):
    sheet = shapes.rectangle((1, 2, 3), (2, 1), facing)
    assert sheet.face_normals == pytest.approx(np.tile(np.array(facing) / np.linalg.norm(facing), (2, 1)))
    assert sheet.area == pytest.approx(2.0) and len(sheet.facets) == 1
    assert sheet.vertices.mean(axis=0) == pytest.approx([1, 2, 3])


def test_refuses_what_rays_cannot_use():
    box = shapes.box((0, 0, 0), (1, 1, 1))
    with pytest.raises(InputError, match="two objects are named 'a'"):
        Scene("x", [SceneObject("a", box, WOOD), SceneObject("a", box, WOOD)])
    with pytest.raises(InputError, match="no objects"):
        Scene("x", [])
    with pytest.raises(InputError, match="within 1000 m"):
        Scene("x", [SceneObject("a", shapes.box((5e5, 0, 0), (1, 1, 1)), WOOD)])


def test_rays_are_read_in_packets_past_their_end(clutter):
    """Arrays passed to Dr.Jit have padding, because it reads them in place and in packets."""
    assert clutter.occluded(np.zeros(3), np.ones((1, 3))).shape == (1,)  # Dr.Jit is there
    values = np.arange(10.0).reshape(2, 5)
    found = _lent(values.T, np.float32)
    assert np.array_equal(found, values.T) and found.flags.c_contiguous
    ends = [array.ctypes.data + array.nbytes for array in (found.base, found)]
    assert ends[0] - ends[1] >= 64 and found.ctypes.data % 64 == 0
    import mitsuba as mi

    number = mi.Float(flat := _lent(np.zeros(3), np.float32))
    flat[1] = 7
    assert number.numpy()[1] == 7
