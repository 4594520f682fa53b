"""ROS maps and lidar logs: straight walls where they were, rooms to walk in, and echoes where the walls are."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from PIL import Image
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from radarsim.motion.planner import plan_motion
from radarsim.motion.trajectory import Motion
from radarsim.propagation.reflectors import Reflectors
from radarsim.scenario import Scenario
from radarsim.world.importers import Options, import_scene
from radarsim.world.importers.carmen import scans_of
from radarsim.world.scene import Scene
from tests.world.beams import level_beams

RADISH = Path(__file__).parents[3] / ".." / "shared" / "recordings" / "radish"
#: Two rooms with a doorway between them: faces at x = 0, 5, 5.2, 9 and y = 0, 4; a door from y = 1 to 2.
ROOMS = shapely.union_all([shapely.box(0, 0, 5, 4), shapely.box(5.2, 0, 9, 4), shapely.box(4.9, 1, 5.3, 2)])


def draw_map(folder: Path, yaw: float = 0.0, resolution: float = 0.05, **keys) -> Path:
    """`ROOMS` as a ROS map: walls 0.2 m thick, unknown around them."""
    x = np.arange(-1, 10, resolution) + resolution / 2
    y = np.arange(-1, 5, resolution) + resolution / 2
    grid = np.meshgrid(x, y)
    value = np.full(grid[0].shape, 205, np.uint8)
    value[shapely.contains_xy(ROOMS.buffer(0.2, join_style="mitre"), *grid)] = 0
    value[shapely.contains_xy(ROOMS, *grid)] = 254
    if keys.get("negate"):
        value = 255 - value
    Image.fromarray(value[::-1]).save(folder / "plan.pgm")
    c, s = np.cos(yaw), np.sin(yaw)
    settings = {"image": "plan.pgm", "resolution": resolution, "origin": [float(-c + s), float(-s - c), yaw],
                "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196} | keys  # fmt: skip
    (folder / "plan.yaml").write_text("\n".join(f"{key}: {value}" for key, value in settings.items()))
    return folder / "plan.yaml"


def turned(points, yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


@pytest.mark.parametrize("yaw", [0.0, 0.5])
@pytest.mark.parametrize("keys", [{}, {"negate": 1}])
def test_a_ros_map_becomes_its_rooms(tmp_path, yaw, keys):
    scene = Scene.load(import_scene(draw_map(tmp_path, yaw, **keys), tmp_path / "out", Options(height=2.5)).path)
    assert scene.bounds[:, 2] == pytest.approx([0, 2.5])
    eye = np.append(turned([2.5, 3.0], yaw), 1.2)
    distance, _ = scene.hit(*level_beams(eye, np.rad2deg(yaw) + [-90.0, 90, 0, 180]))
    assert distance == pytest.approx([3, 1, 2.5, 2.5], abs=0.03)
    # Through the doorway into the other room, to its far wall.
    eye = np.append(turned([2.5, 1.5], yaw), 1.2)
    assert scene.hit(*level_beams(eye, np.rad2deg([yaw])))[0] == pytest.approx([6.5], abs=0.03)
    # Nothing but the eight faces, the door's reveals, and the outer sides.
    walls = next(item for item in scene.objects if item.name == "walls")
    assert len(walls.mesh.faces) // 2 <= 24
    plan = scene.floor_plan(1.2)
    angles = np.arctan2(plan[:, 3] - plan[:, 1], plan[:, 2] - plan[:, 0]) - yaw
    assert np.abs(np.sin(2 * angles)).max() < 1e-3


def test_pictures_work_as_well_as_their_yaml(tmp_path):
    draw_map(tmp_path)
    one = import_scene(tmp_path / "plan.pgm", tmp_path / "a").path
    two = import_scene(tmp_path / "plan.yaml", tmp_path / "b").path
    assert one.read_text().splitlines()[1:] == two.read_text().splitlines()[1:]


def peaks(scene: Scene, motion: Motion) -> list[tuple[float, float, float]]:
    """Range (m), azimuth (deg) and power (dB) of the strongest cell beyond 1 m of the maps at 0 and 10 s."""
    config = PRESETS["radarize"]
    radar = Scenario(Scene(scene.name, scene.objects), motion, config)  # as drawn: flat, and empty
    maps, found = Heatmaps(config), []
    for power in maps.range_azimuth(radar.frames(np.array([0.0, 10.0])).samples).numpy():
        power[maps.ranges < 1.0] = 0
        r, a = np.unravel_index(power.argmax(), power.shape)
        found.append((float(maps.ranges[r]), float(np.rad2deg(maps.azimuths[a])), float(10 * np.log10(power[r, a]))))
    return found


def test_echoes_of_imported_walls_are_those_of_native_ones(tmp_path):
    """From a map, and from a noisy scan: peak in the same cell, power within 1.5 dB of a wall from a scene file."""
    room = "{name: walls, shape: box, size: [5, 4, 2.7], position: [2.5, 2, 1.35], material: plasterboard}"
    (tmp_path / "native.yaml").write_text(f"objects: [{room}]")
    native = Scene.load(tmp_path / "native.yaml")
    for item in native.objects:  # seen from inside
        item.mesh.invert()
    plan = Scene.load(import_scene(draw_map(tmp_path), tmp_path / "out").path)
    vertices, faces = trimesh.remesh.subdivide_to_size(*(lambda m: (m.vertices, m.faces))(native.objects[0].mesh), 0.15)
    scan = trimesh.Trimesh(vertices, faces, process=False)
    scan.merge_vertices()
    scan.vertices = scan.vertices + np.random.default_rng(1).normal(0, 0.003, scan.vertices.shape)
    scan.export(tmp_path / "scan.ply")
    scanned = Scene.load(import_scene(tmp_path / "scan.ply", tmp_path / "out", Options(default="plasterboard")).path)
    places, yaws = ((3.2, 2.7, 1.2), (3.0, 2.5, 1.2)), (np.pi, -np.pi / 2 + 0.3)
    times = np.array([-1.0, 1.0, 9.0, 11.0])
    motion = Motion(
        10.0,
        CubicSpline(times, np.repeat(places, 2, axis=0)),
        RotationSpline(times, Rotation.from_euler("z", np.repeat(yaws, 2)[:, None])),
    )
    native, plan, scanned = (peaks(scene, motion) for scene in (native, plan, scanned))
    for expected, *others in zip(native, plan, scanned, strict=True):
        for found in others:
            assert found[0] == pytest.approx(expected[0], abs=0.06)
            assert found[1] == pytest.approx(expected[1], abs=2.1)
            assert found[2] == pytest.approx(expected[2], abs=1.5)


def carmen_log(count: int = 181) -> str:
    """Scans of `ROOMS` from five places, as a CARMEN log."""
    lines = ["# comment", "PARAM robot_length 0.5"]
    outline = ROOMS.boundary
    for number, (x, y, theta) in enumerate([(1, 1, 0), (2, 3, 1), (4, 1.5, 0), (7, 2, 2), (7, 1.5, -2.5), (2, 2, 3)]):
        ranges = []
        for bearing in np.deg2rad(np.linspace(-90, 90, count)):
            far = np.array([x, y]) + 40 * np.array([np.cos(theta + bearing), np.sin(theta + bearing)])
            cut = shapely.intersection(shapely.LineString([(x, y), far]), outline)
            ranges.append(shapely.distance(shapely.Point(x, y), cut))
        numbers = " ".join(f"{r:.3f}" for r in ranges)
        lines.append(f"FLASER {count} {numbers} {x} {y} {theta} {x} {y} {theta} {number} host {number}")
    return "\n".join(lines)


def test_a_carmen_log_becomes_its_rooms(tmp_path):
    (tmp_path / "two.log.gz").write_bytes(gzip.compress(carmen_log(361).encode()))
    done = import_scene(tmp_path / "two.log.gz", tmp_path, Options(resolution=0.04))
    scene = Scene.load(done.path)
    assert done.path.name == "two.yaml"
    distance, _ = scene.hit(*level_beams(np.array([2.0, 2.0, 1.2]), np.array([90.0, 180, -90])))
    assert distance == pytest.approx([2, 2, 2], abs=0.06)
    motion = plan_motion(scene, "cart", 5.0, np.random.default_rng(0))
    inside = ROOMS.buffer(-0.2)
    assert shapely.contains_xy(inside, *motion.position(np.linspace(0, 5, 50))[:, :2].T).all()


def test_robot_laser_messages(tmp_path):
    ranges = [1.0, 2.0, 81.9]
    line = f"ROBOTLASER1 0 -0.5 1.0 0.5 80.0 0.01 0 3 {' '.join(map(str, ranges))} 0 1 2 0.5 1 2 0.5 0 0 0 0 0 0 h 0"
    (tmp_path / "r.log").write_text(line)
    (scan,) = scans_of(tmp_path / "r.log")
    assert scan.pose == (1, 2, 0.5) and scan.bearings == pytest.approx([-0.5, 0, 0.5])
    assert scan.ranges[:2] == pytest.approx([1, 2]) and scan.ranges[2] >= 30  # no echo


@pytest.mark.skipif(not RADISH.is_dir(), reason="needs ../shared/recordings/radish")
def test_the_intel_lab(tmp_path):
    """Part of a real building: its lidar points lie on few straight walls, and its rooms are accessible."""
    log = gzip.decompress((RADISH / "intel-corrected.log.gz").read_bytes()).decode()
    lines = [line for line in log.splitlines() if line.startswith("FLASER")][:260]
    (tmp_path / "intel.log").write_text("\n".join(lines))
    scene = Scene.load(import_scene(tmp_path / "intel.log", tmp_path).path)
    walls = next(item for item in scene.objects if item.name == "walls")
    plan = scene.floor_plan(0.5)
    lengths = np.linalg.norm(plan[:, 2:] - plan[:, :2], axis=1)
    assert lengths[lengths > 1].sum() > 0.5 * lengths.sum() and len(walls.mesh.faces) < 2500
    outline = shapely.union_all(shapely.linestrings(plan.reshape(-1, 2, 2)))
    shapely.prepare(outline)
    apart = []
    for scan in scans_of(tmp_path / "intel.log")[::10]:
        seen = scan.ranges < 6
        heading = scan.pose[2] + scan.bearings[seen]
        points = np.array(scan.pose[:2]) + scan.ranges[seen, None] * np.stack([np.cos(heading), np.sin(heading)], 1)
        apart.append(shapely.distance(outline, shapely.points(points)))
    apart = np.concatenate(apart)
    assert np.median(apart) < 0.04 and np.mean(apart < 0.15) > 0.85
    flat = Reflectors.of(scene, PRESETS["radarize"]).flat
    assert np.sum(4 * flat.half.prod(axis=1) >= 0.25) < 900
    for platform in ("handheld", "robot"):
        plan_motion(scene, platform, 8.0, np.random.default_rng(1))


@pytest.mark.skipif(not RADISH.is_dir(), reason="needs ../shared/recordings/radish")
def test_scans_with_their_truth(tmp_path):
    """The same scans as numpy arrays with the true poses beside them."""
    log = scans_of(RADISH / "orebro-corrected.log.gz")
    arrays = scans_of(RADISH / "orebro.scans.npz")
    assert len(log) == len(arrays)
    for one, two in zip(log[::20], arrays[::20], strict=True):
        assert two.pose == pytest.approx(one.pose, abs=1e-5)
        near = one.ranges < 30
        assert two.ranges[near] == pytest.approx(one.ranges[near], abs=1e-5)
        assert two.bearings == pytest.approx(one.bearings)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.log", "ODOM 0 0 0\n", "holds no FLASER or ROBOTLASER1 line"),
        ("a.log", "FLASER 3 1 2 3 0 0\n", "line 1 is no complete FLASER"),
        ("a.log", "# x\nFLASER 3 1 2 nan 0 0 0 0 0 0\n", "line 2 is no complete FLASER"),
        ("a.log", "ROBOTLASER1 0 0 1 0.1 80 0 0 5 1 2\n", "line 1 is no complete ROBOTLASER1"),
        ("a.log", "FLASER 2 99 99 0 0 0 0 0 0\n", "holds no range between"),
        ("a.log", "FLASER 2 1 1 0 0 0\nFLASER 2 1 1 9e6 9e6 0\n", "too much for cells"),
        ("a.log", "FLASER 2 5 5 0 0 0\n", "has no square metre of free ground"),
        ("a.log.gz", "\x1f", "holds no FLASER"),
        ("a.scans.npz", "PK", "is no readable .npz"),
        ("plan.pgm", "P5", "has no plan.yaml beside it"),
        ("plan.yaml", "image: gone.pgm\nresolution: 0.05\norigin: [0, 0, 0]", "gone.pgm: no such file"),
        ("plan.yaml", "image: plan.yaml\nresolution: 0.05\norigin: [0, 0, 0]", "is no readable PPM/PNG/BMP picture"),
        ("plan.yaml", "image: a.pgm\nresolution: -1\norigin: [0, 0, 0]", "resolution is -1"),
        ("plan.yaml", "image: a.pgm\nresolution: 0.05\norigin: [0, .nan, 0]", "origin.1 is nan"),
        ("plan.yaml", "image: a.pgm\nresolution: 0.05", "origin"),
        ("plan.yaml", "objects: []", "unknown format"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        import_scene(tmp_path / name, tmp_path / "out")
    assert "\n" not in str(caught.value)


def test_options_out_of_range(tmp_path):
    for option in ({"height": 0.1}, {"thickness": 3.0}, {"resolution": 0.0}):
        with pytest.raises(InputError, match=f"--{next(iter(option))} is "):
            import_scene(draw_map(tmp_path), tmp_path / "out", Options(**option))
