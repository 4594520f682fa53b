"""Floors of all four styles: accessible, closed, reproducible, with the style's materials."""

import re

import numpy as np
import pytest
import shapely
from scipy import ndimage

from radarize.io.errors import InputError
from radarsim.motion.platforms import PLATFORMS
from radarsim.world.clearance import RESOLUTION, Clearance
from radarsim.world.generators.buildings import Building
from radarsim.world.scene import Scene

SEEDS = np.random.default_rng(4).integers(0, 10_000, 4).tolist()
FLOORS = [Building(kind="ABCD"[k], seed=seed, floor=k // 2) for k, seed in enumerate(SEEDS)]
#: Names of what is no furniture.
FIXED = ("wall", "facade", "reveals", "column", "pipe", "window", "door", "way", "lamp", "riser", "stairs", "floor")
FURNITURE = re.compile(
    "(desk|chair|cabinet|shelf|bin|whiteboard|table|bench|printer|fridge|counter|cubicle|basin|sofa|plant|vending|lockers"
    r"|noticeboard|extinguisher|lectern) \d+ "
)


@pytest.fixture(scope="module")
def floors() -> list[Scene]:
    return [Scene(f"{b.kind} {b.seed}", b.build()) for b in FLOORS]


@pytest.mark.parametrize("number", range(len(FLOORS)))
def test_floor_is_walkable_and_closed(floors, number):
    building, scene = FLOORS[number], floors[number]
    plan = building.plan()
    size = scene.bounds[1] - scene.bounds[0]
    assert 21 <= size[0] <= 52 and 17 <= size[1] <= 32
    assert len(scene.triangles) < 50_000

    handheld = PLATFORMS["handheld"]
    clearance = Clearance.of(scene, *handheld.body)
    labels, _ = ndimage.label(clearance.distance >= handheld.radius)
    walk = labels == 1 + np.bincount(labels.ravel())[1:].argmax()

    # A closed way around something: the ground that the walk encloses, walls and all, has a hull of 30 m around.
    enclosed = ndimage.binary_fill_holes(walk) & ~walk
    around = shapely.MultiPoint(np.argwhere(enclosed)[::7] * RESOLUTION).convex_hull
    assert around.length >= 30
    assert all(30 <= ring <= 100 for ring in plan.skeleton.rings)

    # Every corridor is part of it along its whole middle, some are long, and many rooms can be entered.
    def walked(x, y):
        i, j = np.round((np.array([x, y]) - clearance.origin) / RESOLUTION).astype(int)
        return walk[i - 6 : i + 7, j - 6 : j + 7].any()

    lengths = []
    for room in plan.corridors:
        along = 0 if room.size[0] > room.size[1] else 1
        lengths.append(room.size[along])
        margin = min(room.size) / 2 + 0.7
        for at in np.arange((room.x0, room.y0)[along] + margin, (room.x1, room.y1)[along] - margin, 0.5):
            low, high = ((room.y0, room.y1), (room.x0, room.x1))[along]
            across = np.arange(low + 0.4, high - 0.39, 0.1)
            assert any(walked(*((at, c) if along == 0 else (c, at))) for c in across), (room.name, at)
    assert max(lengths) >= 20 and 1.8 <= min(min(r.size) for r in plan.corridors) <= 2.6
    rooms = [r for r in plan.rooms if r.kind not in ("corridor", "stairs")]
    cells = np.argwhere(walk) * RESOLUTION + clearance.origin
    entered = [r for r in rooms if _inside(r, cells, 0.5)]
    assert len(entered) >= 0.4 * len(rooms)

    # Nobody looks out through a gap: whatever the direction, something is hit within the building.
    rng = np.random.default_rng(number)
    eyes = cells[rng.integers(len(cells), size=300)]
    angles = rng.uniform(0, 2 * np.pi, (300, 3))
    for height in (0.2, 1.2, 1.7):
        outward = [np.stack([np.cos(angles), np.sin(angles), rng.uniform(-0.1, 0.1, angles.shape)], -1)]
        origins = np.repeat(np.column_stack([eyes, np.full(300, height)]), 3, axis=0)
        distance, _ = scene.hit(origins, outward[0].reshape(-1, 3))
        assert np.isfinite(distance).all()


def _inside(room, cells, margin):
    low, high = np.array([room.x0, room.y0]) + margin, np.array([room.x1, room.y1]) - margin
    return bool(np.any(np.all((cells > low) & (cells < high), axis=1)))


def test_rooms_look_like_rooms():
    for building in FLOORS:
        plan = building.plan()
        for room in plan.rooms:
            if room.kind != "corridor":
                assert 2.5 <= min(room.size) and max(room.size) <= 14.5, (building, room)
        floor = [r.floor for r in plan.rooms]
        assert sum(a.area for a in floor) == pytest.approx(shapely.union_all(floor).area, abs=1e-6)
        # A door to every room, and at least two rooms that are joined by one.
        doored = {r.name for o in plan.openings if o.passage for r in (o.room, o.other)}
        assert all(r.name in doored for r in plan.rooms if r.kind != "corridor")
        between = [o for o in plan.openings if o.kind == "way" and "corridor" not in (o.room.kind, o.other.kind)]
        assert len(between) >= 2
        assert any(o.kind == "window" for o in plan.openings)


def test_nothing_stands_in_a_doorway(floors):
    for building, scene in zip(FLOORS, floors, strict=True):
        plan = building.plan()
        open_ones = [o for o in plan.openings if o.passage and (not o.leaf or o.angle > 1.4)]
        ways = []
        for o in open_ones:
            x0, y0, _, x1, y1, _ = o.span
            low, high = o.passage
            across = 0.35
            ways.append((low + 0.08, y0 - across, high - 0.08, y1 + across) if o.side in "ns"
                        else (x0 - across, low + 0.08, x1 + across, high - 0.08))  # fmt: skip
        ways = shapely.box(*np.array(ways).T)
        tall = scene.triangles[:, :, 2]
        body = (tall.max(axis=1) > 0.1) & (tall.min(axis=1) < 1.8) & (np.ptp(tall, axis=1) > 1e-6)
        tree = shapely.STRtree(ways)
        segments = shapely.linestrings(scene.triangles[body][:, :, :2])
        way, part = tree.query(segments, predicate="intersects")[::-1]
        names = {scene.objects[i].name for i in scene.triangle_object[np.flatnonzero(body)[part]]}
        names = {n for n in names if not n.endswith(("leaf", "handles"))}
        assert not names, (building, sorted(names)[:5])


def test_pieces_do_not_overlap(floors):
    for building, scene in zip(FLOORS, floors, strict=True):
        bodies = {}
        for item in scene.objects:
            head = item.name.rsplit(" ", 1)[0]
            low, high = item.mesh.bounds
            if item.is_floor_or_ceiling or any(word in item.name for word in FIXED):
                continue
            hull = shapely.MultiPoint(item.mesh.vertices[:, :2]).convex_hull
            bodies.setdefault(head, []).append(hull)
        flat = shapely.buffer(np.array([shapely.union_all(parts).convex_hull for parts in bodies.values()]), -0.02)
        tree = shapely.STRtree(flat)
        a, b = tree.query(flat, predicate="intersects")
        pairs = [(list(bodies)[i], list(bodies)[j]) for i, j in zip(a, b, strict=True) if i < j]
        # Chairs are pushed under tables a little.
        pairs = [p for p in pairs if not any("chair" in name for name in p)]
        assert not pairs, (building, pairs[:5])


def test_same_seed_same_bytes(floors):
    def bytes_of(objects):
        return b"".join(o.mesh.triangles.tobytes() for o in objects)

    assert bytes_of(FLOORS[1].build()) == bytes_of(floors[1].objects)
    assert bytes_of(FLOORS[1].model_copy(update={"floor": 1}).build()) != bytes_of(floors[1].objects)


@pytest.mark.parametrize("kind", "ABCD")
def test_floors_share_the_building(kind):
    first, second = (Building(kind=kind, seed=11, floor=f).plan() for f in (0, 3))
    assert first.skeleton == second.skeleton
    assert first.skeleton.outline.equals(second.skeleton.outline)
    stairs = [[(r.x0, r.y0, r.x1, r.y1) for r in p.rooms if r.kind in ("stairs", "toilet")] for p in (first, second)]
    assert stairs[0] == stairs[1] and stairs[0]
    assert [r.floor.bounds for r in first.rooms] != [r.floor.bounds for r in second.rooms]
    outlines = [Scene("x", Building(kind=kind, seed=11, floor=f, furnished=False).build()).bounds for f in (0, 3)]
    np.testing.assert_array_equal(*outlines)


def test_styles_differ_in_material(floors):
    share = {}
    for building, scene in zip(FLOORS, floors, strict=True):
        area = {}
        for item in scene.objects:
            if not item.is_floor_or_ceiling and "facade" not in item.name:
                area[item.material.name] = area.get(item.material.name, 0.0) + item.mesh.area
        total = sum(area.values())
        for name, value in area.items():
            share.setdefault((building.kind, name), []).append(value / total)
    mean = {key: np.mean(values) for key, values in share.items()}
    assert mean["A", "glass"] > 3 * mean["B", "glass"]
    assert mean["B", "wood"] > 3 * max(mean["A", "wood"], mean["C", "wood"])
    assert mean["C", "brick"] > 0.15 and ("B", "brick") not in mean
    assert min(mean["C", "metal"], mean["A", "metal"]) > 2 * mean["B", "metal"]
    assert mean["B", "metal"] < mean["D", "metal"] < mean["C", "metal"]


def test_facade_is_of_one_material():
    """All outward faces on the outline, below windows and above as well."""
    building = Building(kind="D", seed=4, furnished=False)
    edge = building.skeleton().outline.exterior
    for item in building.build():
        if item.name.split()[0] in ("outer", "wall", "corridor", "reveals", "facade"):
            outside = shapely.distance(shapely.points(item.mesh.triangles_center[:, :2]), edge) < 1e-3
            assert outside.all() if "facade" in item.name else not outside.any(), item.name


def test_description_of_a_building():
    scene = Scene.of({"building": {"kind": "C", "seed": 2, "floor": 1}}, "c2")
    assert scene.name == "c2" and len(scene.objects) > 100
    with pytest.raises(InputError, match="scene odd: building.*kind"):
        Scene.of({"building": {"kind": "E", "seed": 2}}, "odd")
    with pytest.raises(InputError, match=r"scene odd: building\.floor is -1"):
        Scene.of({"building": {"kind": "A", "floor": -1}}, "odd")


@pytest.mark.parametrize("kind", "ABCD")
def test_density_of_furniture(kind):
    """More or fewer pieces between the same walls and doors; as many as usual at 1, and more where there is room."""

    def pieces(density: float) -> int:
        return len({o.name.rsplit(" ", 1)[0] for o in floor.build(density) if FURNITURE.search(o.name)})

    floor = Building(kind=kind, seed=12)
    none, few, usual, many = (pieces(density) for density in (0.0, 0.6, 1.0, 1.4))
    assert none == 0 and 0.4 < few / usual < 0.85 and 1.0 < many / usual < 1.4
    bare, full = (
        [o for o in floor.build(d) if re.search(r"wall|facade|floor|ceiling|door|window", o.name)] for d in (0, 1.4)
    )
    assert [o.name for o in bare] == [o.name for o in full]
    assert all(np.array_equal(a.mesh.vertices, b.mesh.vertices) for a, b in zip(bare, full, strict=True))
    assert pieces(1.0) == len({o.name.rsplit(" ", 1)[0] for o in floor.build() if FURNITURE.search(o.name)})
