"""Import of Mitsuba and Sionna RT scenes (.xml): shapes, their transforms, and the names of their BSDFs.

The file is parsed as text, without running the scene's plugins. Documents with entities, which could expand without
limit or read other files, are refused. https://mitsuba.readthedocs.io/en/stable/src/key_topics/scene_format.html
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import trimesh
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.files import read_bytes, within
from radarsim.world import shapes
from radarsim.world.importers import meshes
from radarsim.world.importers.naming import Choice, meaning
from radarsim.world.importers.part import Part
from radarsim.world.materials import MATERIALS

_FILES = ("ply", "obj")


def parts(path: Path) -> list[Part]:
    """Shapes of a scene in world coordinates.

    Raises:
        InputError: invalid XML, entities, a shape that cannot be read (with its name), a missing mesh.
    """
    root = _parse(path)
    defaults = {item.get("name", ""): item.get("value", "") for item in root.iter("default")}
    for item in root.iter():
        for key, value in item.attrib.items():
            for name in sorted(defaults, key=len, reverse=True):
                value = value.replace(f"${name}", defaults[name])
            item.set(key, value)
    bsdfs = {item.get("id"): item for item in root.iter("bsdf") if item.get("id")}
    found, names = [], set()
    for number, shape in enumerate(root.findall("shape"), 1):
        name = shape.get("id") or shape.get("name") or f"shape {number}"
        name = name.removeprefix("mesh-")
        name = name if name not in names else f"{name} {number}"
        names.add(name)
        try:
            mesh = _mesh(shape, path.parent)
        except (InputError, ValueError) as error:
            raise InputError(f"{path}: shape {name!r}: {error}") from error
        material, labels = _material(shape, bsdfs)
        found.append(Part(name, mesh, material, labels=labels))
    if not found:
        raise InputError(f"{path}: holds no shape, expected a Mitsuba scene")
    return found


def _parse(path: Path) -> ElementTree.Element:
    class Refusing(ElementTree.TreeBuilder):
        def doctype(self, *_):
            raise InputError(f"{path}: declares a document type, which could hold entities; expected plain XML")

    try:
        root = ElementTree.fromstring(read_bytes(path, "a Mitsuba scene"), ElementTree.XMLParser(target=Refusing()))
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: is not readable XML ({error})") from error
    if root.tag != "scene":
        raise InputError(f"{path}: its root is <{root.tag}>, expected <scene> of a Mitsuba scene")
    return root


def _values(item: ElementTree.Element) -> dict[str, str]:
    """Parameters of an element by name."""
    return {child.get("name", ""): child.get("value", "") for child in item}


def _mesh(shape: ElementTree.Element, folder: Path) -> trimesh.Trimesh:
    kind, values = shape.get("type"), _values(shape)
    if kind in _FILES:
        file = within(folder / values.get("filename", ""), "filename", folder)
        if not file.is_file():
            raise InputError(f"file {file} does not exist")
        mesh = shapes.joined(*(part.mesh for part in meshes.parts(file)))
    elif kind == "rectangle":
        mesh = shapes.rectangle((0, 0, 0), (2, 2), (0, 0, 1))
    elif kind == "cube":
        mesh = shapes.box((0, 0, 0), (2, 2, 2))
    elif kind == "disk":
        angle = 2 * np.pi * np.arange(48) / 48
        ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        mesh = trimesh.Trimesh(ring, [[0, i, i + 1] for i in range(1, 47)], process=False)
    elif kind == "sphere":
        point = next((_vector(item) for item in shape.findall("point")), np.zeros(3))
        mesh = shapes.sphere(tuple(point), float(values.get("radius", 1)))
    elif kind == "cylinder":
        ends = {item.get("name"): _vector(item) for item in shape.findall("point")}
        segment = [ends.get("p0", np.zeros(3)), ends.get("p1", np.array([0.0, 0.0, 1.0]))]
        mesh = trimesh.creation.cylinder(float(values.get("radius", 1)), segment=segment, cap=False)
    else:
        raise InputError(f"is of type {kind!r}, expected ply, obj, rectangle, cube, disk, sphere or cylinder")
    matrix = _transform(shape.find("transform"))
    # A mirroring transform turns faces inside out, as `flip_normals` does.
    flipped = (np.linalg.det(matrix[:3, :3]) < 0) != (values.get("flip_normals") == "true")
    faces = mesh.faces[:, ::-1] if flipped else mesh.faces
    return trimesh.Trimesh(trimesh.transform_points(mesh.vertices, matrix), faces, process=False)


def _vector(item: ElementTree.Element, default: float = 0.0) -> Float[np.ndarray, "3"]:
    """Parse a vector given as x, y, z or as one value for all three, or as three of them."""
    if (text := item.get("value")) is not None:
        numbers = np.array(text.replace(",", " ").split(), float)
        if len(numbers) not in (1, 3):
            raise InputError(f"<{item.tag}> has {len(numbers)} numbers, expected one or three")
        return np.broadcast_to(numbers, 3)
    return np.array([float(item.get(axis, default)) for axis in "xyz"])


def _transform(item: ElementTree.Element | None) -> Float[np.ndarray, "4 4"]:
    """Multiply the steps of a transform, in their order."""
    matrix = np.eye(4)
    for step in item if item is not None else ():
        if step.tag == "translate":
            one = trimesh.transformations.translation_matrix(_vector(step))
        elif step.tag == "scale":
            one = np.diag([*_vector(step, 1.0), 1.0])
        elif step.tag == "rotate":
            angle = np.deg2rad(float(step.get("angle", "0")))
            one = trimesh.transformations.rotation_matrix(angle, _vector(step))
        elif step.tag == "matrix":
            numbers = np.array(step.get("value", "").replace(",", " ").split(), float)
            if len(numbers) not in (9, 16):
                raise InputError(f"its matrix has {len(numbers)} numbers, expected 16")
            one = np.eye(4)
            size = int(np.sqrt(len(numbers)))
            one[:size, :size] = numbers.reshape(size, size)
        else:
            raise InputError(f"its transform has a <{step.tag}>, expected translate, scale, rotate or matrix")
        matrix = one @ matrix
    return matrix


def _material(shape: ElementTree.Element, bsdfs: dict) -> tuple[Choice | None, tuple[str, ...]]:
    """Material of a shape, and the names of its BSDFs."""
    refs = [bsdfs[ref.get("id")] for ref in shape.findall("ref") if ref.get("id") in bsdfs]
    labels = [label for ref in shape.findall("ref") if (label := ref.get("id"))]
    for bsdf in [*refs, *shape.findall("bsdf")]:
        for item in bsdf.iter("bsdf"):
            values = _values(item)
            labels += [label for label in (item.get("id"), item.get("name")) if label]
            kind = values.get("type", "").replace("_", " ")
            if item.get("type") == "itu-radio-material" and kind:
                known = {"very dry ground": "asphalt", "medium dry ground": "asphalt", "wet ground": "asphalt"}
                name = known.get(kind, kind)
                if name in MATERIALS:
                    return name, (*dict.fromkeys(labels), kind)
                labels.append(kind)
            if item.get("type") == "radio-material" and "relative_permittivity" in values:
                custom = {"permittivity": float(values["relative_permittivity"])}
                custom["conductivity"] = float(values.get("conductivity", 0))
                return {"custom": custom}, tuple(dict.fromkeys(labels))
    named = next((guess for label in labels if (guess := meaning(label))), None)
    return named, tuple(dict.fromkeys(labels))
