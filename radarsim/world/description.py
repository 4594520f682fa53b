"""A scene file is YAML: primitive objects, meshes, generated buildings, and objects that move.

    name: corner
    objects:
      - {name: wall, shape: rectangle, size: [4, 3], position: [3, 0, 1.5], facing: [-1, 0, 0], material: concrete}
      - {name: crate, shape: box, size: [1, 1, 1], position: [2, 1, 0.5], rotation: [0, 0, 30], material: wood}
      - {name: pipe, shape: cylinder, radius: 0.05, height: 2, position: [2, -1, 1], material: metal}
      - {name: scan, shape: mesh, file: hall.ply, material: {custom: {permittivity: 4, conductivity: 0.2}}}
    building: {kind: office, seed: 7}
    moving:
      - {kind: person, name: visitor, path: [[1, 0], [4, 0]], speed: 1.1}

Lengths are in m, angles in degrees; mesh files are relative to the scene file. An open mesh is a sheet with two sides;
with ``solid: true`` it is the outside of a body. `radarsim scene import` writes such files from meshes, maps and logs.

A scene can have levels, from mild to severe. The file without them is level 0; each level changes the one before it. An
entry with the name of an existing entry (``*`` and ``?`` are wildcards) changes its fields; any other entry is added.

    levels:
      - objects: [{name: wall, material: glass}]                                         # level 1
      - objects: [{name: "*", material: metal}, {name: pillar, shape: cylinder, ...}]    # level 2

Level 2 of ``scenes/corner.yaml`` is the scene ``corner@2``.

``clutter`` and ``unevenness`` are the clutter and roughness settings: 1, the default of buildings, is a room in use; 0,
the default of scenes without a building, is bare, flat and at right angles. Clutter adds small objects to the scene.
``materials`` has factors on permittivity and conductivity: ``{wood: {permittivity: 1.1}}``. ``interferers`` are other
radars that transmit in the scene. Levels can change and add interferers, too.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, Union

import numpy as np
import trimesh
from pydantic import BaseModel, ConfigDict, Field, create_model, field_validator

from radarize.io.errors import InputError
from radarize.io.files import within
from radarize.io.schema import Described
from radarize.io.yamlfile import read_yaml
from radarsim.world import plugins, shapes
from radarsim.world.fields import Length, Name, Strict, Vector
from radarsim.world.generators.buildings import Building, Office
from radarsim.world.generators.small_objects import small_objects
from radarsim.world.interferers import Interferer
from radarsim.world.materials import DIELECTRICS, MATERIALS, Material, MaterialName, constant, decibel, material
from radarsim.world.movers import Mover
from radarsim.world.objects import SceneObject
from radarsim.world.squareness import out_of_square
from radarsim.world.surface_settings import IDEAL, IN_USE, SurfaceSettings
from radarsim.world.validation import naming

Share = Annotated[float, Field(ge=0, le=10)]
Factor = Annotated[float, Field(gt=0, le=10)]


class Parts(NamedTuple):
    """Contents of a scene; without a name: ""."""

    name: str
    objects: list[SceneObject]
    movers: list[Mover]
    surface_settings: SurfaceSettings
    interferers: list[Interferer]


class Custom(Strict):
    """A material of constant permittivity, or a conductor.

    Attributes:
        permittivity: relative permittivity.
        conductivity: conductivity, S/m.
        conductor: a perfect conductor; permittivity and conductivity are not used.
        roughness: RMS height of the surface, m.
        sigma0_db: four times the fraction of incident power that is scattered diffusely, dB.
        directive: fraction of the diffuse power in a lobe around the specular direction.
        backscatter: fraction of the diffuse power in a lobe back to the source.
        thickness: thickness of a slab, through which part of the wave is transmitted, m; null: opaque.
        clear: transparent to light, for the depth camera.
    """

    permittivity: Annotated[float, Field(ge=1)] = 1.0
    conductivity: Annotated[float, Field(ge=0)] = 0.0
    conductor: bool = False
    roughness: Annotated[float, Field(ge=0)] = 0.0
    sigma0_db: float = -60.0
    directive: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    backscatter: Annotated[float, Field(ge=0, le=0.5)] = 0.0
    thickness: Length | None = None
    clear: bool = False

    def material(self, name: str) -> Material:
        law = None if self.conductor else constant(self.permittivity, self.conductivity)
        sigma0 = decibel(self.sigma0_db)
        return Material(
            name, law, self.roughness, sigma0, self.thickness, source="scene file",
            directive=self.directive, backscatter=self.backscatter, clear=self.clear,
        )  # fmt: skip


class CustomMaterial(Strict):
    """A material that the scene file defines.

    Attributes:
        custom: its properties.
    """

    custom: Custom


class Shape(Strict, ABC):
    """An object of a scene file. A subclass with a `shape` of its own and `mesh(folder)` can be named there.

    Attributes:
        name: unique name of the object.
        shape: kind of object.
        material: name of a material, or {custom: {...}}.
        position: x, y, z of the centre, m.
        solid: an open mesh is part of a body's surface and is seen from its outside only; false: it is a sheet.
    """

    name: Name
    material: MaterialName | CustomMaterial
    position: Vector = (0.0, 0.0, 0.0)
    solid: bool = False

    @abstractmethod
    def mesh(self, folder: Path) -> trimesh.Trimesh:
        """Mesh in world coordinates; file names in it are relative to a folder."""

    def object(self, folder: Path) -> SceneObject:
        """Object with this mesh and its material."""
        if isinstance(self.material, CustomMaterial):
            made_of = self.material.custom.material(f"custom {self.name}")
        else:
            with naming(f"object {self.name!r}"):
                made_of = material(self.material)
        return SceneObject(self.name, self.mesh(folder), made_of, self.solid)


class TurnedShape(Shape):
    """An object that can be rotated.

    Attributes:
        rotation: roll, pitch, yaw, degrees.
    """

    rotation: Vector = (0.0, 0.0, 0.0)

    def _placed(self, shape: trimesh.Trimesh) -> trimesh.Trimesh:
        return shapes.placed(shape, self.position, np.deg2rad(self.rotation))


class Box(TurnedShape):
    """A box.

    Attributes:
        size: extent along x, y, z before rotation, m.
    """

    shape: Literal["box"]
    size: tuple[Length, Length, Length]

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return self._placed(shapes.box((0, 0, 0), self.size))


class Rectangle(Shape):
    """A rectangle. Its height is vertical; where it lies flat, its height is along y and its width along x.

    Attributes:
        size: width and height, m.
        facing: direction of the normal, x, y, z.
    """

    shape: Literal["rectangle"]
    size: tuple[Length, Length]
    facing: Vector

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        if not np.any(self.facing):
            raise InputError(f"object {self.name!r}: facing is [0, 0, 0], expected the direction of the normal")
        return shapes.rectangle(self.position, self.size, self.facing)


class Cylinder(TurnedShape):
    """A cylinder along z before rotation.

    Attributes:
        radius: radius, m.
        height: height, m.
        sides: number of facets of its mesh.
    """

    shape: Literal["cylinder"]
    radius: Length
    height: Length
    sides: Annotated[int, Field(ge=3, le=720)] = 24

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return self._placed(shapes.cylinder((0, 0, 0), self.radius, self.height, self.sides))


class Sphere(Shape):
    """A sphere.

    Attributes:
        radius: radius, m.
        subdivisions: subdivisions of the icosahedron of its mesh; each multiplies the triangles by four.
    """

    shape: Literal["sphere"]
    radius: Length
    subdivisions: Annotated[int, Field(ge=0, le=6)] = 3

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        return shapes.sphere(self.position, self.radius, self.subdivisions)


class Mesh(TurnedShape):
    """A mesh from a file.

    Attributes:
        file: mesh file (.ply, .obj, .stl), relative to the scene file.
        scale: factor on its coordinates.
    """

    shape: Literal["mesh"]
    file: str
    scale: Length = 1.0

    def mesh(self, folder: Path) -> trimesh.Trimesh:
        path = within(folder / self.file, f"object {self.name!r}", folder)
        if not path.is_file():
            raise InputError(f"object {self.name!r}: file {path} does not exist, expected a mesh (.ply, .obj, .stl)")
        try:
            loaded = trimesh.load(path, force="mesh", process=False)
            if not isinstance(loaded, trimesh.Trimesh):
                raise ValueError(f"it holds a {type(loaded).__name__}")
            vertices, faces = np.asarray(loaded.vertices, float), np.asarray(loaded.faces)
        except Exception as error:  # trimesh's readers raise whatever their parsers do
            raise InputError(f"object {self.name!r}: file {path} is not a readable mesh ({error})") from error
        if not len(faces):
            raise InputError(f"object {self.name!r}: file {path} holds no triangles")
        return self._placed(shapes.mesh(self.scale * vertices, faces))


class Change(Described):
    """Fields of the entry of that name that change, or a new entry.

    Attributes:
        name: name of an entry; * and ? are wildcards.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    name: Name


class Factors(Strict):
    """Factors on the properties of a material.

    Attributes:
        permittivity: factor on the relative permittivity.
        conductivity: factor on the conductivity.
    """

    permittivity: Factor = 1.0
    conductivity: Factor = 1.0


class Level(Strict):
    """Changes of one level of severity against the level before it.

    Attributes:
        objects: objects that change or are added.
        moving: movers that change or are added.
        interferers: radars that change or are added.
    """

    objects: list[Change] = []
    moving: list[Change] = []
    interferers: list[Change] = []


class Description(Strict):
    """A scene file. It has objects, a building, or both.

    Attributes:
        name: name of the scene; default: that of the file.
        objects: objects at rest.
        building: a generated floor of a building.
        moving: people, doors and fans.
        levels: changes per level of severity; level 2 of corner.yaml is the scene corner@2.
        clutter: density of small objects and fittings, 1 as in rooms in use, 0 none. Default: 1 in buildings, else 0.
        unevenness: deviation of surfaces from planes and right angles, 1 as in real buildings, 0 none. Default: 1 in
            buildings, else 0.
        furniture: number of pieces of furniture in a building, as a fraction of the usual number.
        materials: factors on the properties of materials, by name.
        interferers: other radars that transmit in the scene.
    """

    name: str = ""
    objects: list[Shape] = []
    building: Annotated[Office | Building, Field(discriminator="kind")] | None = None
    moving: list[Mover] = []
    levels: list[Level] = []
    clutter: Share | None = None
    unevenness: Share | None = None
    furniture: Annotated[float, Field(ge=0, le=2)] = 1.0
    materials: dict[str, Factors] = {}
    interferers: list[Interferer] = []

    @field_validator("materials")
    @classmethod
    def _known(cls, factors: dict[str, Factors]) -> dict[str, Factors]:
        if unknown := factors.keys() - set(DIELECTRICS):
            raise ValueError(f"names {min(unknown)!r}, expected some of: {', '.join(DIELECTRICS)}")
        return factors

    @property
    def surface_settings(self) -> SurfaceSettings:
        """Clutter and roughness: as given, or the default of a building, or zero."""
        given = {name: getattr(self, name) for name in ("clutter", "unevenness") if getattr(self, name) is not None}
        return replace(IN_USE if self.building else IDEAL, **given)


def description_model() -> type[Description]:
    """Description with all shapes and movers, those of plug-ins included."""
    plugins.load()
    return _model_of(_kinds(Shape, "shape"), _kinds(Mover, "kind"))


@lru_cache
def _model_of(shapes: tuple[type, ...], movers: tuple[type, ...]) -> type[Description]:
    objects, moving = (
        list[Annotated[Union[classes], Field(discriminator=tag)]]  # type: ignore[valid-type]  # noqa: UP007
        for classes, tag in ((shapes, "shape"), (movers, "kind"))
    )
    return create_model("Description", __base__=Description, objects=(objects, []), moving=(moving, []))


def _kinds(base: type[BaseModel], tag: str) -> tuple[type, ...]:
    """All subclasses that a scene file can use, in the order of their definition."""
    found = []
    for each in base.__subclasses__():
        found += ([each] if tag in each.__annotations__ else []) + list(_kinds(each, tag))
    return tuple(found)


def split_level(name: str | Path) -> tuple[str, int]:
    """Split a scene's file or name from its level (``corner@2``), 0 if there is none."""
    plain, _, level = str(name).rpartition("@")
    return (plain, int(level)) if plain and re.fullmatch(r"\d+", level) else (str(name), 0)


def find(path: str | Path) -> Path:
    """Find the scene file of a path or a bare name, whatever its level.

    Raises:
        InputError: there is none; the message lists valid names.
    """
    path = split_level(path)[0]
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
            if f.relative_to(d).parts[0] != "datasets"
        }
    )
    raise InputError(f"no scene {str(path)!r}, expected a .yaml file or one of: {', '.join(known) or 'none found'}")


def shipped() -> Path:
    """Folder of the project's scenes: in the repository, or beside the installed package."""
    here = Path(__file__).resolve()
    packaged = here.parents[1] / "scenes"
    return packaged if packaged.is_dir() else here.parents[2] / "scenes"


def meshes(path: Path) -> list[Path]:
    """Mesh files in a scene file, at any of its levels.

    Raises:
        InputError: unreadable, malformed YAML, unknown key or value.
    """
    data, found = read_yaml(path), set()
    for level in range(len(described(data, str(path)).levels) + 1):
        found |= {item.file for item in described(data, str(path), level).objects if isinstance(item, Mesh)}
    return [path.parent / name for name in sorted(found)]


def read(path: Path, level: int = 0, changes: Mapping[str, object] | None = None) -> Parts:
    """Read name, objects, movers, surface settings and interferers of a scene file at one of its levels.

    Args:
        path: of the file.
        level: level of severity, if the scene has levels.
        changes: values in place of the file's.

    Raises:
        InputError: unreadable, malformed YAML, unknown key, value, material, mesh file or level.
    """
    data = read_yaml(path)
    parts = built(data | dict(changes or {}) if isinstance(data, dict) else data, str(path), path.parent, level)
    name = parts.name or path.stem
    return parts._replace(name=f"{name}@{level}" if level else name)


def built(data: object, source: str, folder: Path, level: int = 0) -> Parts:
    """Build name (or ""), objects, movers, surface settings and interferers from a description as read from YAML.

    Args:
        data: the description.
        source: name of the description in error messages.
        folder: folder of mesh files.
        level: level of severity, if the scene has levels.

    Raises:
        InputError: unknown key, value, material, mesh file or level.
    """
    description = described(data, source, level)
    settings = description.surface_settings
    with naming(source):
        objects = [item.object(folder) for item in description.objects]
        if description.building:
            objects += description.building.build(description.furniture)
        objects += small_objects(objects, settings.clutter)
    if description.materials:
        made_of = {name: MATERIALS[name].scaled(**dict(by)) for name, by in description.materials.items()}
        objects = [replace(each, material=made_of.get(each.material.name, each.material)) for each in objects]
    if not objects:
        raise InputError(f"{source}: has neither objects nor a building, expected at least one")
    if description.building:
        objects = out_of_square(objects, settings.unevenness, description.building.seed)
    return Parts(description.name, objects, description.moving, settings, description.interferers)


def described(data: object, source: str, level: int = 0) -> Description:
    """Check a description as read from YAML, at one of its levels.

    Raises:
        InputError: unknown key, value or level.
    """
    if not isinstance(data, dict):
        raise InputError(f"{source}: holds {type(data).__name__}, expected keys such as objects and building")
    model = description_model()
    with naming(source, data):
        plain = model.model_validate(data)
        if not 0 <= level <= len(plain.levels):
            raise InputError(f"level is {level}, expected 0 to {len(plain.levels)}")
    for changes in plain.levels[:level]:
        data = apply_level(data, changes)
    with naming(source, data):
        return model.model_validate(data)


def apply_level(data: dict, changes: Level) -> dict:
    """Apply the changes of a level to a description."""
    parts = {}
    for part in ("objects", "moving", "interferers"):
        parts[part] = entries = [dict(entry) for entry in data.get(part, [])]
        for change in (item.model_dump() for item in getattr(changes, part)):
            known = [entry for entry in entries if fnmatchcase(entry["name"], change["name"])]
            for entry in known:
                entry.update(change | {"name": entry["name"]})
            if not known:
                entries.append(change)
    return data | parts
