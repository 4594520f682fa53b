"""Import of mesh files: glTF, OBJ, PLY and STL, each read as parts of one material.

Parts are a glTF file's nodes, an OBJ file's objects, groups and materials, and the objects or categories that a PLY
file gives its faces (``object_id``, ``category``, ``label``; Replica's `mesh_semantic.ply` has its class names in
`info_semantic.json` beside it). STL files and plain PLY files are one part.
"""

import os
from pathlib import Path

import numpy as np
import trimesh
from trimesh.resolvers import FilePathResolver

from radarize.io.errors import InputError, explained
from radarize.io.files import OUTSIDE, read_text, within
from radarize.io.jsonfile import parse_json
from radarsim.world.importers import gltf
from radarsim.world.importers.part import Part

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
#: Properties with which PLY files assign faces to objects or categories.
_CATEGORIES = ("category", "category_id", "class", "class_id", "label", "semantic", "object_id", "objectId")


def parts(path: Path) -> list[Part]:
    """Parts of a mesh file, in the file's units and axes, in the order of their names.

    Raises:
        InputError: unreadable, without triangles, or with a file missing beside it.
    """
    if path.suffix.lower() == ".obj":
        _require_materials(path)
    if path.suffix.lower() in (".glb", ".gltf"):
        gltf.check(path)
    anywhere = FilePathResolver(str(path), allow_anywhere=bool(os.environ.get(OUTSIDE)))
    try:
        scene = trimesh.load_scene(
            path,
            resolver=anywhere,
            process=False,
            maintain_order=True,
            split_objects=True,
            split_groups=True,
            group_material=True,
        )
    except Exception as error:  # trimesh's readers raise whatever their parsers do
        raise InputError(f"{path}: is not a readable {path.suffix[1:]} file ({_reason(error)})") from error
    with explained(f"{path}: is not a readable {path.suffix[1:]} file"):  # such as one of 2-D points
        found = _parts(scene, path)
    if not found:
        raise InputError(f"{path}: holds no triangles")
    return sorted(found, key=lambda part: part.name)


def _parts(scene: trimesh.Scene, path: Path) -> list[Part]:
    found = []
    for node in scene.graph.nodes_geometry:
        transform, key = scene.graph[node]
        mesh = scene.geometry[key]
        if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
            continue
        material = getattr(getattr(mesh.visual, "material", None), "name", None)
        vertices = trimesh.transform_points(mesh.vertices, transform)
        # A mirrored node turns its faces inside out.
        faces = mesh.faces[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else mesh.faces
        name = str(node) if len(scene.geometry) > 1 or path.suffix.lower() in (".glb", ".gltf") else path.stem
        labels = tuple(dict.fromkeys(str(label) for label in (material, key, node) if label and label != name))
        placed = trimesh.Trimesh(vertices, faces, process=False)
        found += _by_category(path, mesh, placed) or [Part(name, placed, labels=labels)]
    return found


def _reason(error: Exception) -> str:
    if isinstance(error, (FileNotFoundError, KeyError)) and error.args:
        return f"{getattr(error, 'filename', None) or error.args[-1]} is missing"
    return " ".join(str(error).split())[:120] or type(error).__name__


def _require_materials(path: Path) -> None:
    """Check that the .mtl file with an OBJ file's material names exists: without it all parts would be the same."""
    with path.open("rb") as file:
        words = [line.split(maxsplit=1) for line in file if line.startswith((b"mtllib", b"usemtl"))]
    if not any(word[0] == b"usemtl" for word in words):
        return
    for word in words:
        if word[0] == b"mtllib" and len(word) > 1:
            name = word[1].decode(errors="replace").strip()
            if not within(path.parent / name, path, path.parent).is_file():
                raise InputError(f"{path}: names the material file {name!r}, which does not lie beside it")


def _by_category(path: Path, mesh: trimesh.Trimesh, placed: trimesh.Trimesh) -> list[Part]:
    """Parts of a PLY file whose faces have a category; none if they do not."""
    data = mesh.metadata.get("_ply_raw", {}).get("face", {}).get("data")
    names = data.dtype.names if isinstance(data, np.ndarray) else data
    key = next((key for key in _CATEGORIES if names is not None and key in names), None)
    if key is None:
        return []
    of = np.ravel(data[key]).astype(np.int64)
    if len(placed.faces) == 2 * len(of):  # quads, split: all first halves, then all second ones
        of = np.concatenate([of, of])
    if len(of) != len(placed.faces):
        raise InputError(f"{path}: has {len(of)} values of {key} for {len(placed.faces)} triangles, expected one each")
    classes = _replica_classes(path.with_name("info_semantic.json")) if key in ("object_id", "objectId") else {}
    names = np.array([classes.get(int(value), f"{key} {value}") for value in np.unique(of)])
    which = names[np.searchsorted(np.unique(of), of)]
    return [
        Part(str(name), trimesh.Trimesh(placed.vertices, placed.faces[which == name], process=False))
        for name in np.unique(names)
    ]


def _replica_classes(path: Path) -> dict[int, str]:
    """Class names by object number, from Replica's file; empty without it."""
    if not path.is_file():
        return {}
    with explained(f"{path}: is no list of Replica's objects, expected id and class_name"):
        return {
            int(item["id"]): str(item["class_name"]) for item in parse_json(read_text(path, "JSON"), "it")["objects"]
        }
