"""Scene files: YAML with primitive objects and procedural buildings.

    name: corner
    objects:
      - {name: wall, shape: rectangle, size: [4, 3], position: [3, 0, 1.5], facing: [-1, 0, 0], material: concrete}
      - {name: crate, shape: box, size: [1, 1, 1], position: [2, 1, 0.5], rotation: [0, 0, 30], material: wood}
      - {name: pipe, shape: cylinder, radius: 0.05, height: 2, position: [2, -1, 1], material: metal}
      - {name: scan, shape: mesh, file: hall.ply, material: {custom: {permittivity: 4, conductivity: 0.2}}}
    building: {kind: office, seed: 7}
    moving:
      - {kind: person, name: visitor, path: [[1, 0], [4, 0]], speed: 1.1}

Lengths in m, angles in degrees (this is what people type), mesh files relative to the scene file. An open mesh that is
the outside of a body says ``solid: true``; otherwise it is a sheet with two sides. `importers` writes such files.
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import trimesh
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from radarize.errors import InputError
from radarize.yamlfile import read_yaml
from radarsim.scene import shapes
from radarsim.scene.buildings import Building
from radarsim.scene.materials import Material, constant, decibel, material
from radarsim.scene.movers import Mover
from radarsim.scene.office import Office
from radarsim.scene.scene import SceneObject

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Vector = tuple[Number, Number, Number]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Custom(_Strict):
    """A material of constant permittivity, or a conductor."""

    permittivity: Annotated[float, Field(ge=1)] = 1.0
    conductivity: Annotated[float, Field(ge=0)] = 0.0  # S/m
    conductor: bool = False
    roughness: Annotated[float, Field(ge=0)] = 0.0  # RMS height, m
    sigma0_db: float = -60.0  # four times the share of power scattered diffusely, dB
    directive: Annotated[float, Field(ge=0, le=0.5)] = 0.0  # shares of it in lobes, see Material
    backscatter: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    thickness: Length | None = None

    def material(self, name: str) -> Material:
        law = None if self.conductor else constant(self.permittivity, self.conductivity)
        sigma0 = decibel(self.sigma0_db)
        lobes = {"directive": self.directive, "backscatter": self.backscatter}
        return Material(name, law, self.roughness, sigma0, self.thickness, source="scene file", **lobes)


class CustomMaterial(_Strict):
    custom: Custom


class _Item(_Strict):
    name: Annotated[str, Field(min_length=1)]
    material: str | CustomMaterial
    position: Vector = (0.0, 0.0, 0.0)
    solid: bool = False  # part of the surface of a body, though open: seen from its outside only


class _Turned(_Item):
    rotation: Vector = (0.0, 0.0, 0.0)  # roll, pitch, yaw in degrees

    def _placed(self, shape: trimesh.Trimesh) -> trimesh.Trimesh:
        return shapes.placed(shape, self.position, np.deg2rad(self.rotation))


class Box(_Turned):
    shape: Literal["box"]
    size: tuple[Length, Length, Length]

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return self._placed(shapes.box((0, 0, 0), self.size))


class Rectangle(_Item):
    shape: Literal["rectangle"]
    size: tuple[Length, Length]  # width, height
    facing: Vector

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        if not np.any(self.facing):
            raise InputError(f"object {self.name!r}: facing is [0, 0, 0], expected the direction of the normal")
        return shapes.rectangle(self.position, self.size, self.facing)


class Cylinder(_Turned):
    shape: Literal["cylinder"]
    radius: Length
    height: Length
    sides: Annotated[int, Field(ge=3, le=720)] = 24

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return self._placed(shapes.cylinder((0, 0, 0), self.radius, self.height, self.sides))


class Sphere(_Item):
    shape: Literal["sphere"]
    radius: Length
    subdivisions: Annotated[int, Field(ge=0, le=6)] = 3

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return shapes.sphere(self.position, self.radius, self.subdivisions)


class Mesh(_Turned):
    shape: Literal["mesh"]
    file: str
    scale: Length = 1.0

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        path = folder / self.file
        if not path.is_file():
            raise InputError(f"object {self.name!r}: file {path} does not exist, expected a mesh (.ply, .obj, .stl)")
        try:
            loaded = trimesh.load(path, force="mesh", process=False)
            vertices, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces)
        except Exception as error:  # trimesh's readers raise whatever their parsers do
            raise InputError(f"object {self.name!r}: file {path} is not a readable mesh ({error})") from error
        if not len(faces):
            raise InputError(f"object {self.name!r}: file {path} holds no triangles")
        return self._placed(shapes.mesh(self.scale * vertices, faces))


class Description(_Strict):
    """A scene file. Needs objects, a building, or both."""

    name: str = ""
    objects: list[Annotated[Box | Rectangle | Cylinder | Sphere | Mesh, Field(discriminator="shape")]] = []
    building: Annotated[Office | Building, Field(discriminator="kind")] | None = None
    moving: list[Mover] = []


def find(path: str | Path) -> Path:
    """The scene file meant by a path or a bare name.

    Raises:
        InputError: there is none, with the names that would work.
    """
    given = Path(path)
    if given.suffix in (".yaml", ".yml") or given.is_file():
        if given.is_file():
            return given
        raise InputError(f"scene file {given} does not exist")
    folders = [Path("scenes"), shipped()]
    for folder in folders:
        if (candidate := folder / f"{given}.yaml").is_file():
            return candidate
    known = sorted(
        {
            str(f.relative_to(d).with_suffix(""))
            for d in folders
            for f in d.glob("**/*.yaml")
            if f.parent.name != "datasets"
        }
    )
    raise InputError(f"no scene {str(path)!r}, expected a .yaml file or one of: {', '.join(known) or 'none found'}")


def shipped() -> Path:
    """Folder of the scenes that come with the project: in the repository, or beside the installed package."""
    here = Path(__file__).resolve()
    packaged = here.parents[1] / "scenes"
    return packaged if packaged.is_dir() else here.parents[2] / "scenes"


def read(path: Path) -> tuple[str, list[SceneObject], list[Mover]]:
    """Name, objects and movers of a scene file.

    Raises:
        InputError: unreadable, malformed YAML, unknown key, value, material or mesh file.
    """
    name, objects, moving = built(read_yaml(path), str(path), path.parent)
    return name or path.stem, objects, moving


def built(data: object, source: str, folder: Path) -> tuple[str, list[SceneObject], list[Mover]]:
    """Name ("" where it has none), objects and movers of a description as read from YAML.

    Args:
        data: the description.
        source: what to call it in errors.
        folder: mesh files are relative to it.

    Raises:
        InputError: unknown key, value, material or mesh file.
    """
    if not isinstance(data, dict):
        raise InputError(f"{source}: holds {type(data).__name__}, expected keys such as objects and building")
    try:
        description = Description.model_validate(data)
        objects = [SceneObject(o.name, o.mesh(folder), _material(o), o.solid) for o in description.objects]
        if description.building:
            objects += description.building.build()
    except ValidationError as error:
        raise InputError(f"{source}: {_first(error, data)}") from error
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    if not objects:
        raise InputError(f"{source}: has neither objects nor a building, expected at least one")
    return description.name, objects, description.moving


def _material(item: _Item) -> Material:
    if isinstance(item.material, CustomMaterial):
        return item.material.custom.material(f"custom {item.name}")
    try:
        return material(item.material)
    except InputError as error:
        raise InputError(f"object {item.name!r}: {error}") from error


def _first(error: ValidationError, data: dict) -> str:
    """The first complaint as one sentence with the field's place in the file."""
    problem = error.errors()[0]
    # Tags of unions are in pydantic's path but not in the file.
    tags = {"box", "rectangle", "cylinder", "sphere", "mesh", "str", "CustomMaterial", "person", "door", "fan"}
    tags |= {"office", "A", "B", "C", "D"}
    place = [part for part in problem["loc"] if part not in tags]
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    if len(place) > 1 and place[0] in ("objects", "moving"):
        item = data[place[0]][place[1]]
        field += f" (object {item['name']!r})" if isinstance(item, dict) and "name" in item else ""
    if problem["type"] == "extra_forbidden":
        return f"{field}: unknown key"
    if problem["type"] == "union_tag_invalid":
        tag, expected = problem["ctx"]["tag"], problem["ctx"]["expected_tags"].replace("'", "")
        return f"{field}.{problem['ctx']['discriminator'].strip(chr(39))} is {tag!r}, expected one of: {expected}"
    value = "" if isinstance(problem["input"], dict) else f" is {problem['input']!r}"
    return f"{field or 'file'}{value}: {problem['msg'][0].lower()}{problem['msg'][1:]}"
