"""Small objects: on surfaces, without intersections, with the specified density, reproducible."""

from itertools import product

import numpy as np
import open3d
import pytest
import trimesh

from radarize.radar.presets import PRESETS
from radarsim.motion.planner import plan_motion
from radarsim.propagation.bodies import recognise
from radarsim.propagation.reflectors import Reflectors
from radarsim.world import shapes
from radarsim.world.generators.buildings import Building, Office
from radarsim.world.generators.small_objects import OBJECTS, RUNS, placed, shaped, small_objects
from radarsim.world.generators.spots import Spots
from radarsim.world.importers import Options, import_scene
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from tests.world.importers.test_imported_plans import draw_map

#: A floor of each style, and the plain office.
PLANS = {kind: Building(kind=kind, seed=3) for kind in "ABCD"} | {"office": Office(seed=7)}


@pytest.fixture(scope="module")
def drawn() -> dict[str, list[SceneObject]]:
    return {name: plan.build() for name, plan in PLANS.items()}


@pytest.fixture(scope="module")
def found(drawn) -> dict[str, dict[str, Spots]]:
    return {name: placed(objects, 1.0) for name, objects in drawn.items()}


def hall(size: float = 24.0) -> list[SceneObject]:
    """A bare hall with a wide table."""
    room = shapes.box((0, 0, 1.5), (size, size, 3))
    room.invert()
    parts = {"room": room, "table": shapes.box((0, 0, 0.74), (size / 2, size / 2, 0.03))}
    return [SceneObject(name, mesh, MATERIALS["wood"]) for name, mesh in parts.items()]


def everything(found: dict[str, Spots]) -> Spots:
    return Spots.joined(list(found.values()))


def corners(spots: Spots) -> np.ndarray:
    return spots.points(np.array(list(product((-1, 1), (-1, 1), (0, 1))), float))


def bytes_of(objects: list[SceneObject]) -> bytes:
    return b"".join(o.name.encode() + o.mesh.triangles.tobytes() for o in objects)


@pytest.mark.parametrize("name", PLANS)
def test_backs_lie_on_surfaces(drawn, found, name):
    """All backs lie on the nearest triangle and have its orientation."""
    mesh = np.concatenate([o.mesh.triangles for o in drawn[name]])
    normals = np.concatenate([o.mesh.face_normals for o in drawn[name]])
    world = open3d.t.geometry.RaycastingScene()
    world.add_triangles(
        mesh.reshape(-1, 3).astype(np.float32), np.arange(mesh.size // 3, dtype=np.uint32).reshape(-1, 3)
    )
    spots = everything(found[name])
    assert len(spots) > 100
    share = np.random.default_rng(0).uniform(-0.99, 0.99, (60, 3)) * [1, 1, 0]
    back = spots.points(share)
    near = world.compute_closest_points(back.astype(np.float32))
    away = np.linalg.norm(near["points"].numpy() - back, axis=2)
    facing = np.einsum("spd,sd->sp", normals[near["primitive_ids"].numpy()], spots.normal)
    assert away.max() < 10.5e-3  # desks stand 1 cm apart, shelves 2 cm, and objects lie on both
    assert np.mean(facing > 0.99) > 0.97  # where two surfaces meet, the nearest one may be the other


@pytest.mark.parametrize("name", PLANS)
def test_they_stand_in_nothing_and_not_in_one_another(drawn, found, name):
    """No triangle of the drawing intersects a box, and no ray from inside it hits the inner side of a body."""
    spots = everything(found[name])
    triangles = np.concatenate([o.mesh.triangles for o in drawn[name]])
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    box = corners(spots)
    for k, (least, most) in enumerate(zip(box.min(axis=1), box.max(axis=1), strict=True)):
        near = triangles[np.all((low < most) & (high > least), axis=1)]
        half = spots.size[k] / 2
        inside = (near - spots.place[k]) @ spots.axes[k].T / half - [0, 0, 1]
        flat, faces = inside.reshape(-1, 3), np.arange(inside.size // 3).reshape(-1, 3)
        edge = 1 - 2.5e-3 / half  # tolerance of a surface: 2 mm
        for axis, sign in product(range(3), (-1, 1)):
            if len(faces):
                normal = -sign * np.eye(3)[axis]
                flat, faces, _ = trimesh.intersections.slice_faces_plane(flat, faces, normal, -edge[axis] * normal)
        assert not len(faces), (k, spots.place[k])
    assert spots.apart().all()

    scene = Scene(name, drawn[name])
    middle = spots.points(np.array([[0.03, 0.05, 0.5]]))[:, 0]
    way = np.random.default_rng(1).standard_normal((9, 1, 3))
    away, triangle = scene.hit((middle + 0 * way).reshape(-1, 3), (way + 0 * middle).reshape(-1, 3))
    body = np.array([not o.two_sided for o in scene.objects])[scene.triangle_object[triangle]]
    inner = body & np.isfinite(away)
    inner &= np.einsum("nd,nd->n", scene.normals[triangle], (way + 0 * middle).reshape(-1, 3)) > 0
    assert inner.reshape(9, -1).mean(axis=0).max() < 0.6


@pytest.mark.parametrize("kind", "ABCD")
def test_none_in_openings(found, kind):
    box = corners(everything(found[kind]))
    low, high = box.min(axis=1), box.max(axis=1)
    for opening in PLANS[kind].plan().openings:
        x0, y0, z0, x1, y1, z1 = opening.span
        meets = np.all((low < np.array([x1, y1, z1]) - 1e-3) & (high > np.array([x0, y0, z0]) + 1e-3), axis=1)
        assert not meets.any(), (opening, box[meets])


@pytest.mark.parametrize("name", PLANS)
def test_sizes_and_ways(found, name):
    """At least 2 cm across, except cables, and nothing that people could run into protrudes from a wall."""
    for kind, spots in found[name].items():
        size = np.sort(spots.size, axis=1)
        assert (size[:, 2] >= 0.02).all()
        assert kind == "cable" or (size[:, 1] >= 0.02).all()
        on_walls = np.abs(spots.normal[:, 2]) < 0.5
        reached = corners(spots)[..., 2].min(axis=1) < 2.0
        assert (spots.size[on_walls & reached, 2] <= 0.05).all()


def test_as_many_as_asked_for():
    """In a bare hall numbers are Poisson-distributed about density times area or length, and follow the level."""
    objects = hall()
    area, walls = 24.0**2, 4 * 24.0
    for level in (0.5, 1.0, 4.0):
        some = placed(objects, level)
        for kind in ("sprinkler", "smoke detector", "socket"):
            wanted = level * OBJECTS[kind].often * (walls if OBJECTS[kind].surface == "wall" else area)
            assert abs(len(some[kind]) - wanted) < 4 * np.sqrt(wanted) + 0.03 * wanted, kind
    few, usual = (
        sum(
            len(s) for kind, s in placed(objects, level).items() if OBJECTS.get(kind) and OBJECTS[kind].surface == "top"
        )
        for level in (0.1, 1.0)
    )
    wanted = sum(t.often for t in OBJECTS.values() if t.surface == "top") * area / 4
    assert abs(few - 0.1 * wanted) < 4 * np.sqrt(0.1 * wanted) + 0.08 * 0.1 * wanted  # few are in one another's way
    assert 0.5 * wanted < usual < wanted


def test_without_clutter_it_is_the_drawing(drawn):
    bare = {"building": {"kind": "B", "seed": 3}, "clutter": 0, "unevenness": 0}
    assert bytes_of(Scene.of(bare, "b").objects) == bytes_of(drawn["B"])


def test_same_surfaces_same_small_objects(drawn):
    lived = Scene.of({"building": {"kind": "office", "seed": 7}, "unevenness": 0}, "office")
    own = small_objects(drawn["office"], 1.0)
    assert own
    assert bytes_of(lived.objects) == bytes_of(drawn["office"] + own)
    crate = SceneObject("crate", shapes.box((16.5, 6.0, 0.2), (0.4, 0.4, 0.4)), MATERIALS["wood"])
    assert bytes_of(small_objects([*drawn["office"], crate], 1.0)) != bytes_of(own)


@pytest.mark.parametrize("name", PLANS)
def test_every_style_has_all_sorts(found, name):
    number = {kind: len(spots) for kind, spots in found[name].items()}
    assert min(number[kind] for kind in ("sprinkler", "picture", "socket", "skirting", "paper", "cup")) > 0
    lit = number["luminaire"]
    assert lit <= 5  # there are lamps already


@pytest.mark.parametrize("yaw", [0.0, 0.5])
def test_imported_plans(tmp_path, yaw):
    """Walls of a map, at any angle: objects on them, lamps if it has none, and free doors."""
    path = import_scene(draw_map(tmp_path, yaw), tmp_path / "out", Options(height=2.5)).path
    plain = Scene.load(path)
    path.write_text(path.read_text() + "clutter: 1\n")
    lived = Scene.load(path)
    number = {kind: len(spots) for kind, spots in placed(plain.objects, 1.0).items()}
    assert min(number[kind] for kind in ("luminaire", "socket", "picture", "skirting")) > 0
    assert bytes_of(lived.objects[: len(plain.objects)]) == bytes_of(plain.objects)
    assert np.allclose(lived.bounds, plain.bounds)
    plan_motion(lived, "cart", 10.0, np.random.default_rng(0))


def test_what_is_merged_reflects_as_each_would(found):
    """Flat parts and round bodies of merged objects are those of the single objects; none is a sheet, a slab or a
    floor."""
    alone, sorts = [], set()
    for kind, spots in found["office"].items():
        about = RUNS[kind] if kind in RUNS else OBJECTS[kind]
        for k in range(min(len(spots), 4)):
            mesh = shaped(about, spots.size[k])
            mesh.vertices = mesh.vertices @ spots.axes[k] + spots.place[k]
            alone.append(SceneObject(f"{kind} {k}", mesh, MATERIALS[about.material], solid=True))
            sorts.add(about.material)
    merged = [
        SceneObject(what, shapes.joined(*(o.mesh for o in alone if o.material.name == what)), MATERIALS[what], True)
        for what in sorts
    ]
    one, two = (Reflectors.of(Scene("s", objects), PRESETS["radarize"]) for objects in (alone, merged))
    for name in ("flat", "inner", "round"):
        tables = [getattr(r, name) for r in (one, two)]
        assert len(tables[0].center) == len(tables[1].center)
        rows = [np.lexsort(t.center.round(6).T) for t in tables]
        assert np.allclose(tables[0].center[rows[0]], tables[1].center[rows[1]], atol=1e-6)
        assert np.allclose(tables[0].layer[rows[0]], tables[1].layer[rows[1]])
    assert not len(one.inner.center)
    assert not one.flat.horizontal.any()


@pytest.mark.parametrize("kind", [k for k, about in OBJECTS.items() if about.shape in ("stick", "rod")])
def test_round_things_are_round_bodies(kind):
    """Round small objects have the closed-form echo of cylinders (`tests.propagation.test_curved`)."""
    about = OBJECTS[kind]
    (body,), _ = recognise(shaped(about, np.array(about.most)))
    assert body.radius == pytest.approx(min(about.most[:2] if about.shape == "stick" else about.most[1:]) / 2)
