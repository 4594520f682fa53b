"""Meshes in four formats: parts, materials, units, axes, cleaning, flat walls, and one sentence for each mistake."""

import json
import re

import numpy as np
import pytest
import trimesh
import yaml

from radarize.io.console import run
from radarize.io.errors import InputError
from radarsim.cli import app
from radarsim.world import shapes
from radarsim.world.importers import Options, import_scene
from radarsim.world.importers.naming import meaning
from radarsim.world.planes import regions
from radarsim.world.scene import Scene


def walls() -> dict[str, trimesh.Trimesh]:
    """A room of 6 x 4 x 2.7 m without its ceiling, and a cabinet in it."""
    room = shapes.box((3, 2, 1.35), (6, 4, 2.7), without=("+z", "-z"))
    floor = shapes.rectangle((3, 2, 0), (6, 4), (0, 0, 1))
    return {"outer wall": room, "floor": floor, "Cabinet.001": shapes.box((1, 3, 0.5), (0.8, 0.4, 1.0))}


def y_up(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """z up to y up: (x, y, z) becomes (x, z, -y)."""
    return trimesh.Trimesh(mesh.vertices[:, [0, 2, 1]] * [1, 1, -1], mesh.faces, process=False)


def rows(done) -> dict[str, tuple[str, float]]:
    return {row.part: (row.material, round(row.area, 3)) for row in done.rows}


def test_gltf_stands_up_and_names_its_materials(tmp_path):
    scene = trimesh.Scene()
    for name, mesh in walls().items():
        mesh = y_up(mesh)
        label = "itu_brick" if name == "outer wall" else "Material.003"
        material = trimesh.visual.material.PBRMaterial(name=label)
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)), material=material)
        # Stored away from where its node puts it.
        mesh.apply_translation([0, 0, 5])
        back = trimesh.transformations.translation_matrix([0, 0, -5])
        scene.add_geometry(mesh, node_name=name, transform=back)
    scene.export(tmp_path / "room.glb")
    (tmp_path / "map.yaml").write_text("'cab*': metal\n")
    done = import_scene(tmp_path / "room.glb", tmp_path / "out", Options(materials=tmp_path / "map.yaml"))
    assert rows(done) == {
        "outer wall": ("brick", 54.0), "floor": ("floorboard", 24.0), "Cabinet.001": ("metal", 3.04),
    }  # fmt: skip
    assert {row.part: row.chosen_by for row in done.rows}["Cabinet.001"] == "pattern cab*"
    loaded = Scene.load(done.path)
    assert loaded.bounds == pytest.approx(np.array([[0, 0, 0], [6, 4, 2.7]]), abs=1e-5)
    cabinet = next(item for item in loaded.objects if item.name == "Cabinet.001")
    assert cabinet.mesh.bounds == pytest.approx(np.array([[0.6, 2.8, 0], [1.4, 3.2, 1]]), abs=1e-5)
    assert cabinet.mesh.is_watertight and cabinet.mesh.volume > 0  # not inside out
    text = yaml.safe_load(done.path.read_text())
    assert all((done.path.parent / item["file"]).is_file() for item in text["objects"])


def test_obj_groups_and_materials(tmp_path):
    (tmp_path / "room.mtl").write_text("newmtl glazing\nKd 0 0 1\nnewmtl grey\nKd 1 1 1\n")
    (tmp_path / "room.obj").write_text(
        "mtllib room.mtl\nv 0 0 0\nv 4 0 0\nv 4 0 3\nv 0 0 3\nv 4 5 0\nv 4 5 3\nv 0 5 0\nv 0 5 3\n"
        "o shell\ng north\nusemtl glazing\nf 1 2 3 4\ng east\nusemtl grey\nf 2 5 6 3\no slab\nusemtl grey\nf 1 2 5 7\n"
    )
    (tmp_path / "map.yaml").write_text("'*slab*': marble\ngrey: {custom: {permittivity: 4, conductivity: 0.1}}\n")
    done = import_scene(tmp_path / "room.obj", tmp_path / "room.yaml", Options(materials=tmp_path / "map.yaml"))
    found = {material: area for _, (material, area) in rows(done).items()}
    assert found == {"glass": 12.0, "custom": 15.0, "marble": 20.0}
    loaded = Scene.load(done.path)
    custom = next(item.material for item in loaded.objects if "east" in item.name)
    assert custom.permittivity_at(77e9).real == pytest.approx(4)


@pytest.mark.parametrize("quads", [False, True])
def test_ply_with_object_numbers(tmp_path, quads):
    """Replica's semantic mesh: an object number per face, class names in a file beside it."""
    corners = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0), (4, 0, 3), (0, 0, 3)]
    faces = [(4, 0, 1, 2, 3), (4, 0, 1, 4, 5)] if quads else [(3, 0, 1, 2), (3, 0, 2, 3), (3, 0, 1, 4), (3, 0, 4, 5)]
    numbers = [7, 9] if quads else [7, 7, 9, 9]
    file = tmp_path / "mesh_semantic.ply"
    with file.open("wb") as out:
        out.write(
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\n"
            "property int object_id\nend_header\n".encode()
        )
        out.write(np.array(corners, "<f4").tobytes())
        for face, number in zip(faces, numbers, strict=True):
            out.write(bytes([face[0]]) + np.array([*face[1:], number], "<i4").tobytes())
    assert set(rows(import_scene(file, tmp_path / "a"))) == {"object_id 7", "object_id 9"}
    classes = {"objects": [{"id": 7, "class_name": "rug"}, {"id": 9, "class_name": "window"}]}
    (tmp_path / "info_semantic.json").write_text(json.dumps(classes))
    done = import_scene(file, tmp_path / "b")
    assert rows(done) == {"rug": ("carpet", 12.0), "window": ("glass", 12.0)}


def test_stl_in_millimetres(tmp_path):
    """STL separates triangles and has no units."""
    mesh = shapes.joined(*walls().values())
    mesh.apply_translation([0, 0, 1.0])
    mesh.apply_scale(1000)
    mesh.export(tmp_path / "room.stl")
    done = import_scene(tmp_path / "room.stl", tmp_path, Options(default="concrete"))
    assert rows(done) == {"room": ("concrete", 81.04)}
    assert any("taken as mm (6 m)" in remark for remark in done.remarks)
    loaded = Scene.load(done.path)
    assert loaded.bounds == pytest.approx(np.array([[0, 0, 0], [6, 4, 2.7]]), abs=1e-4)
    assert len(regions(loaded.objects[0].mesh)) == 11  # four walls, the floor, six sides
    kept = import_scene(tmp_path / "room.stl", tmp_path / "kept", Options(units="mm", floor=False))
    assert Scene.load(kept.path).bounds[0, 2] == pytest.approx(1.0)


@pytest.mark.parametrize(("unit", "metres"), [("m", 1), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048)])
def test_units(tmp_path, unit, metres):
    mesh = shapes.box((0, 0, 0), (5 / metres, 4 / metres, 3 / metres))
    mesh.export(tmp_path / "box.ply")
    done = import_scene(tmp_path / "box.ply", tmp_path, Options(units=unit))
    assert np.ptp(Scene.load(done.path).bounds, axis=0) == pytest.approx([5, 4, 3], rel=1e-5)


def test_cleaning(tmp_path):
    """Repeated and degenerate triangles are removed, corners merged, and an edge of three triangles is reported."""
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0], [2, 2, 2], [4, 0, 1e-7]], float)
    faces = [[0, 1, 2], [0, 2, 3], [2, 1, 0], [0, 5, 2], [0, 1, 5], [0, 2, 4], [1, 1, 2]]
    trimesh.Trimesh(corners, faces, process=False).export(tmp_path / "a.ply")
    done = import_scene(tmp_path / "a.ply", tmp_path / "out", Options(default="wood"))
    (row,) = done.rows
    assert row.triangles == 3 and row.area == pytest.approx(16 + np.sqrt(8) * 2)
    text = " ".join(done.remarks)
    assert "4 degenerate or repeated triangles removed" in text and "1 edges have more than two triangles" in text


def scan(noise: float, rng: np.random.Generator) -> trimesh.Trimesh:
    """A room and a table as a scanner gives them: small triangles, noisy corners."""
    pieces = []
    for box, flip in ((trimesh.creation.box((4, 3, 2.4)), True), (trimesh.creation.box((1.2, 0.8, 0.7)), False)):
        vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, 0.12)
        piece = trimesh.Trimesh(vertices, faces[:, ::-1] if flip else faces, process=False)
        piece.merge_vertices()
        piece.apply_translation((0, 0, 1.2) if flip else (1, 0.5, 0.35))
        pieces.append(piece)
    mesh = shapes.joined(*pieces)
    mesh.vertices = mesh.vertices + rng.normal(0, noise, mesh.vertices.shape)
    return mesh


def test_a_noisy_scan_gets_flat_walls(tmp_path):
    """With 5 mm of noise there is no plane; after import each wall is one, at its position, and decimation keeps it."""
    rough = scan(0.005, np.random.default_rng(0))
    assert max(rough.area_faces[faces].sum() for faces in regions(rough)) < 0.3
    rough.export(tmp_path / "scan.ply")
    done = import_scene(tmp_path / "scan.ply", tmp_path, Options(budget=4000, default="concrete"))
    mesh = Scene.load(done.path).objects[0].mesh
    assert len(mesh.faces) <= 4000 < len(rough.faces)
    large = [faces for faces in regions(mesh) if mesh.area_faces[faces].sum() > 5]
    areas = sorted(mesh.area_faces[faces].sum() for faces in large)
    assert areas == pytest.approx([7.2, 7.2, 9.6, 9.6, 12, 12], rel=0.04)
    for faces in large:
        normal = np.average(mesh.face_normals[faces], axis=0, weights=mesh.area_faces[faces])
        axis = np.abs(normal).argmax()
        assert np.abs(normal[axis]) > np.cos(np.deg2rad(0.2))
        level = np.average(mesh.triangles_center[faces][:, axis], weights=mesh.area_faces[faces])
        true = {0: 2.0, 1: 1.5, 2: 0.0 if normal[2] > 0 else 2.4}[int(axis)]
        assert abs(abs(level) - true) < 0.003
    remarks = " ".join(done.remarks)
    assert re.search("[45]\\.. mm RMS of noise", remarks) and "moved less than 0.00" in remarks


def test_a_budget_that_cannot_be_met(tmp_path):
    trimesh.creation.icosphere(4, radius=3).export(tmp_path / "ball.ply")
    with pytest.raises(InputError, match="would move 1 % of its surface by more than .* raise --budget"):
        import_scene(tmp_path / "ball.ply", tmp_path, Options(budget=100))


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("mat-itu_glass", "glass"), ("itu_ceiling_board", "ceiling board"), ("Wall_01", "plasterboard"),
        ("wall cabinet", "wood"), ("KitchenWindow", "glass"), ("Material.003", None), ("brick_red", "brick"),
    ],
)  # fmt: skip
def test_what_names_mean(name, expected):
    assert meaning(name) == expected


def test_import_again_gives_the_same_bytes_and_spares_other_files(tmp_path):
    shapes.joined(*walls().values()).export(tmp_path / "room.obj")
    done = import_scene(tmp_path / "room.obj", tmp_path / "out")
    first = {file.name: file.read_bytes() for file in done.path.parent.rglob("*") if file.is_file()}
    import_scene(tmp_path / "room.obj", tmp_path / "out")
    assert first == {file.name: file.read_bytes() for file in done.path.parent.rglob("*") if file.is_file()}
    (tmp_path / "out" / "room.meshes" / "mine.txt").write_text("keep")
    with pytest.raises(InputError, match="room.meshes: holds other files"):
        import_scene(tmp_path / "room.obj", tmp_path / "out")


NAN = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
NAN += "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n"
GLTF = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"uri": "no.bin", "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]}  # fmt: skip
TRIANGLE = "v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "text", "options", "message"),
    [
        ("gone.glb", None, {}, "gone.glb: no such file"),
        ("nan.ply", NAN, {}, "part 'nan' has 1 corners that are no finite numbers"),
        ("range.ply", NAN.replace("nan", "0").replace("3 0 1 2", "3 0 1 9"), {}, "range.ply"),
        ("bad.ply", "ply\nnonsense", {}, "bad.ply"),
        ("empty.stl", "", {}, "empty.stl: holds no triangles"),
        ("points.obj", "v 0 0 0\nv 1 0 0\n", {}, "points.obj: holds no triangles"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", {}, "holds no triangle with an area"),
        ("lost.obj", "mtllib lost.mtl\nusemtl red\n" + TRIANGLE, {}, "names the material file 'lost.mtl'"),
        ("lost.gltf", json.dumps(GLTF), {}, "lost.gltf: is not a readable gltf file .*no.bin"),
        ("cut.glb", "glTF\x02", {}, "cut.glb: is not a readable glTF file"),
        ("text.docx", "x", {}, "text.docx: unknown format, expected a mesh"),
        ("far.obj", TRIANGLE.replace("4 0 0", "9e30 0 0"), {}, "far.obj: is 9e.30 m long in m, expected at most"),
        ("a.obj", TRIANGLE, {"units": "yd"}, "--units is 'yd', expected one of: m, cm"),
        ("a.obj", TRIANGLE, {"up": "x"}, "--up is 'x', expected y or z"),
        ("a.obj", TRIANGLE, {"default": "cheese"}, "unknown material 'cheese'"),
        ("a.obj", TRIANGLE, {"budget": 3}, "--budget is 3, expected"),
        ("a.obj", TRIANGLE, {"materials": "'*': cheese"}, "map.yaml: .*: unknown material 'cheese'"),
        ("a.obj", TRIANGLE, {"materials": "'*': {custom: {permittivity: 0}}"}, "map.yaml: .*custom.permittivity"),
        ("a.obj", TRIANGLE, {"materials": "[1]"}, "map.yaml: holds list"),
        ("a.obj", TRIANGLE, {"materials": "'*': ["}, "map.yaml: malformed YAML"),
    ],
)
def test_mistakes_get_one_sentence(tmp_path, name, text, options, message):
    if text is not None:
        (tmp_path / name).write_text(text)
    if "materials" in options:
        (tmp_path / "map.yaml").write_text(options["materials"])
        options = {"materials": tmp_path / "map.yaml"}
    with pytest.raises(InputError, match=message) as caught:
        import_scene(tmp_path / name, tmp_path / "out", Options(**options))
    assert "\n" not in str(caught.value) and not (tmp_path / "out").exists()


def test_the_command_prints_what_became_of_each_part(tmp_path, capsys):
    shapes.joined(*walls().values()).export(tmp_path / "room.obj")
    with pytest.raises(SystemExit) as exit_:
        run(app, "radarsim", ["scene", "import", str(tmp_path / "room.obj"), "-o", str(tmp_path / "room.yaml")])
    out = capsys.readouterr().out
    assert not exit_.value.code and "default" in out and "81.04" in out and "plasterboard" in out
    with pytest.raises(SystemExit) as exit_:
        run(app, "radarsim", ["scene", "import", str(tmp_path / "room.obj"), "-o", "x", "--units", "mile"])
    assert exit_.value.code == 2 and "--units is 'mile'" in capsys.readouterr().err
