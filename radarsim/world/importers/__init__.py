"""Import of scenes from other formats, one module per format.

A format module reads its file as `Part`s. The rest is common: metres, z up, floor at z = 0, clean triangles, one
material per part, and a scene file with its meshes in a folder beside it.
"""

import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import trimesh
import yaml

from radarize.io.errors import InputError, explained
from radarize.io.replacing import replacing
from radarsim.world.clearance import lowest_level
from radarsim.world.importers import carmen, floorplan, meshes, mitsuba, rosmap
from radarsim.world.importers.cleaning import clean, decimate, edges_of_many
from radarsim.world.importers.flatten import flatten
from radarsim.world.importers.naming import MaterialMap
from radarsim.world.importers.part import Part, unreported
from radarsim.world.importers.shells import turned_to_rooms
from radarsim.world.importers.upright import up_axis

UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
#: Largest extent of a building, m; a larger or smaller one probably has other units.
_LIKELY = (1.5, 300.0)
_STOREY = 2.7  # m
_LARGEST = 2000.0  # m; ray tests compute in single precision
#: Range of a floor's height above a mesh's lowest corner, as a fraction of its height and in m; and the fraction of the
#: mesh's plan that a higher surface, a ceiling, covers, within the tolerance in m.
_LOW, _LEAST_ROOM, _COVERS, _THICK = 0.5, 1.0, 0.5, 0.3
#: Distance from the origin beyond which a scene is moved to it, m.
_FAR = 500.0


@dataclass(frozen=True)
class Row:
    """Result for a part: its name, material, reason for that material, triangles, area (m^2)."""

    part: str
    material: str
    chosen_by: str
    triangles: int
    area: float


@dataclass
class Imported:
    """Result of an import: the scene file, the result for each part, and remarks for the user."""

    path: Path
    rows: list[Row]
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Options:
    """Options of an import.

    Attributes:
        materials: YAML file of patterns, see `MaterialMap`.
        default: material of parts without a known name; default: plasterboard, and concrete for whole rooms.
        units: of a mesh or XML scene, one of `UNITS`; default: m, or, for a mesh, the unit that gives a plausible size.
        up: ``y`` or ``z``; default: estimated from glTF and OBJ meshes (`upright`), z for others.
        floor: move the floor of a mesh or XML scene to z = 0.
        budget: largest number of triangles; larger meshes are decimated.
        height: of the walls of a map or log, m.
        thickness: smallest thickness of its walls, m.
        resolution: size of a log's cells, m.

    Raises:
        InputError: an option is out of range.
    """

    materials: Path | None = None
    default: str | None = None
    units: str | None = None
    up: str | None = None
    floor: bool = True
    budget: int = 300_000
    height: float = 2.7
    thickness: float = 0.1
    resolution: float = 0.05

    def __post_init__(self):
        for name, low, high in (
            ("height", 1.0, 20.0), ("thickness", 0.02, 1.0), ("resolution", 0.01, 0.5), ("budget", 100, 5_000_000),
        ):  # fmt: skip
            if not low <= (value := getattr(self, name)) <= high:
                raise InputError(f"--{name} is {value:g}, expected {low:g} to {high:g}")
        if self.units not in (None, *UNITS):
            raise InputError(f"--units is {self.units!r}, expected one of: {', '.join(UNITS)}")
        if self.up not in (None, "y", "z"):
            raise InputError(f"--up is {self.up!r}, expected y or z")


def import_scene(
    source: Path,
    output: Path,
    options: Options = Options(),  # noqa: B008
    progress: Callable[..., object] = unreported,
) -> Imported:
    """Write a scene file from a mesh, a Mitsuba scene, a ROS map or a lidar log.

    Args:
        source: ``.glb .gltf .obj .ply .stl``, a Mitsuba or Sionna ``.xml``, a ROS map's ``.yaml`` or picture, a CARMEN
            ``.log`` or ``.log.gz``, or ``.scans.npz`` with its ``.truth.tum``.
        output: scene file (.yaml), or a folder for one with the source's name. Its meshes go to `NAME.meshes` beside.
        options: options of the import.
        progress: called with a stage's name, steps done, total steps.

    Raises:
        InputError: no usable content in the source, or options that do not fit it.
    """
    source, output = Path(source), Path(output)
    if not source.is_file():
        raise InputError(f"{source}: no such file, expected a mesh, a Mitsuba scene, a ROS map or a lidar log")
    chosen = MaterialMap.read(options.materials, options.default)
    path = output if output.suffix.lower() in (".yaml", ".yml") else output / f"{_stem(source)}.yaml"
    if path.resolve() == source.resolve():
        raise InputError(f"{path}: is the source itself, expected another output file")

    remarks: list[str] = []
    kind = _kind(source)
    if kind in ("map", "log"):
        grid = rosmap.grid(source) if kind == "map" else carmen.grid(source, options.resolution, progress)
        parts = floorplan.parts(grid, options.height, options.thickness, str(source), progress)
    else:
        parts = mitsuba.parts(source) if kind == "mitsuba" else meshes.parts(source)
        up = options.up or _up(parts, source, remarks)
        units = options.units or ("m" if kind == "mitsuba" else _guess(parts, remarks))
        parts = _fit(parts, source, replace(options, up=up, units=units), remarks, progress)
    rows = []
    for part in parts:
        part.material, why = chosen.choose(part)
        name = part.material if isinstance(part.material, str) else "custom"
        rows.append(Row(part.name, name, why, len(part.mesh.faces), float(part.mesh.area)))
    if unsure := sum(row.chosen_by == "default" for row in rows):
        which = options.default or " or ".join(sorted({row.material for row in rows if row.chosen_by == "default"}))
        remarks.append(f"{unsure} of {len(rows)} parts got the default material {which}; --materials can name theirs")
    with explained(f"{path}: cannot be written", OSError):
        _write(path, parts, source)
    return Imported(path, rows, remarks)


def _stem(source: Path) -> str:
    name = source.name
    for ending in (".gz", ".log", ".npz", ".scans", "-corrected", source.suffix):
        name = name.removesuffix(ending)
    return name or source.stem


def _kind(source: Path) -> str:
    suffix, name = source.suffix.lower(), source.name.lower()
    if suffix in meshes.SUFFIXES:
        return "mesh"
    if suffix == ".xml":
        return "mitsuba"
    if suffix in (".pgm", ".png") or (suffix in (".yaml", ".yml") and rosmap.is_map(source)):
        return "map"
    if name.endswith((".log", ".log.gz", ".scans.npz")):
        return "log"
    raise InputError(
        f"{source}: unknown format, expected a mesh ({' '.join(meshes.SUFFIXES)}), a Mitsuba .xml, a ROS map's .yaml "
        "with an image, or a lidar log (.log .log.gz .scans.npz)"
    )


def _fit(
    parts: list[Part], source: Path, options: Options, remarks: list[str], progress: Callable[..., object]
) -> list[Part]:
    """Clean, scale, turn and place the parts of a mesh."""
    units, up = options.units or "m", options.up
    if up == "y":
        for part in parts:
            part.mesh.vertices = np.asarray(part.mesh.vertices)[:, [0, 2, 1]] * [1, -1, 1]
    extent = _extent(parts) * UNITS[units]
    if extent.max() > _LARGEST:
        raise InputError(f"{source}: is {extent.max():.3g} m long in {units}, expected at most {_LARGEST:g} m")
    if not _LIKELY[0] <= extent.max() <= _LIKELY[1]:
        remarks.append(f"it is {extent.max():.3g} m long, unusual for a building; --units sets its units")
    if extent[2] > max(2.0, 2 * extent[:2].max()):
        remarks.append(f"it is higher than long with {up} up; --up {'z' if up == 'y' else 'y'} may be meant")
    found = []
    for number, part in enumerate(parts, 1):
        part.mesh.vertices = np.asarray(part.mesh.vertices) * UNITS[units]
        found.append(clean(part, str(source)))
        progress("cleaning", number, len(parts))
    before = sum(len(part.mesh.faces) for part in parts)
    parts = [part for part in found if part is not None]
    if not parts:
        raise InputError(f"{source}: holds no triangle with an area")
    if left := before - sum(len(part.mesh.faces) for part in parts):
        remarks.append(f"{left} degenerate or repeated triangles removed")
    if many := sum(edges_of_many(part.mesh) for part in parts):
        remarks.append(f"{many} edges have more than two triangles; each is traced as a sheet")
    parts = [_flat(part, source, number, len(parts), remarks, progress) for number, part in enumerate(parts, 1)]
    parts, rooms = turned_to_rooms(parts)
    if rooms:
        remarks.append(f"{', '.join(rooms)}: closed around all else, treated as a room with its faces turned inwards")
    _place(parts, options.floor, remarks)
    total = sum(len(part.mesh.faces) for part in parts)
    if total > options.budget:
        parts, moved = decimate(parts, options.budget, str(source), progress)
        left = sum(len(part.mesh.faces) for part in parts)
        remarks.append(f"decimated from {total} to {left} triangles; 99 % of the surface moved less than {moved:.4f} m")
    return parts


def _flat(
    part: Part, source: Path, number: int, count: int, remarks: list[str], progress: Callable[..., object]
) -> Part:
    """Flatten the planes of a scanned part."""
    found = flatten(part.mesh)
    progress("finding planes", number, count)
    if found is None:
        return part
    remarks.append(
        f"{part.name}: {found.planes} planes ({found.share:.0%} of its area) made flat, {found.noise * 1e3:.1f} mm RMS "
        "of noise removed"
    )
    return clean(replace(part, mesh=found.mesh), str(source)) or part


def _corners(parts: list[Part]) -> np.ndarray:
    return np.concatenate([np.asarray(part.mesh.vertices) for part in parts])


def _extent(parts: list[Part]) -> np.ndarray:
    corners = _corners(parts)
    return np.ptp(corners[np.isfinite(corners).all(axis=1)], axis=0) if np.isfinite(corners).any() else np.zeros(3)


def _up(parts: list[Part], source: Path, remarks: list[str]) -> str:
    """Up axis of a mesh, with a remark if the format allows either."""
    suffix = source.suffix.lower()
    if suffix not in (".glb", ".gltf", ".obj"):
        return "z"
    up, why = up_axis(parts, "z" if suffix == ".obj" else "y")
    remarks.append(f"{up} is taken as up ({why}); --up overrides this")
    return up


def _guess(parts: list[Part], remarks: list[str]) -> str:
    """Unit of a mesh: metres, unless that is too large and another unit gives a plausible building."""
    extent = _extent(parts)
    likely = [unit for unit in ("cm", "mm") if 2.5 <= extent.max() * UNITS[unit] <= 100]
    if extent.max() <= _LIKELY[1] or not likely:
        return "m"
    # The height of a storey distinguishes cm from mm.
    unit = min(likely, key=lambda unit: abs(np.log(max(extent[2], 1e-9) * UNITS[unit] / _STOREY)))
    size = extent.max() * UNITS[unit]
    remarks.append(f"it is {extent.max():.4g} long, taken as {unit} ({size:.3g} m); --units overrides this")
    return unit


def _place(parts: list[Part], floor: bool, remarks: list[str]) -> None:
    """Move the floor to z = 0 and a distant scene to the origin, in place; add a floor to a room without one."""
    corners = _corners(parts)
    low, high = corners.min(axis=0), corners.max(axis=0)
    shift = np.zeros(3)
    if max(np.abs(low[:2]).max(), np.abs(high[:2]).max()) > _FAR:
        shift[:2] = -(low[:2] + high[:2]) / 2
    if floor:
        level, area = _lowest(parts)
        lacks = level - low[2] > max(_LOW * (high[2] - low[2]), _LEAST_ROOM)
        shift[2] = -low[2] if lacks else -level
        if lacks and area > _COVERS * np.prod((high - low)[:2]):
            remarks.append(
                f"it has a ceiling {level - low[2]:.2f} m above its lowest corner, and no floor: a floor is added"
            )
            parts.append(_floor(low, high))
        elif lacks:
            remarks.append("it has no floor: its lowest corner is taken for the ground, of which there are no echoes")
    if np.any(np.abs(shift) > 1e-6):
        remarks.append("moved by {:.3f} {:.3f} {:.3f} m".format(*shift))
        for part in parts:
            part.mesh.vertices = np.asarray(part.mesh.vertices) + shift


def _lowest(parts: list[Part]) -> tuple[float, float]:
    """Height (m) and area (m^2) of the lowest large horizontal surface; of the lowest corner if there is none."""
    flat = [np.abs(part.mesh.face_normals[:, 2]) > 0.9 for part in parts]
    levels = np.concatenate([part.mesh.triangles_center[some, 2] for part, some in zip(parts, flat, strict=True)])
    areas = np.concatenate([part.mesh.area_faces[some] for part, some in zip(parts, flat, strict=True)])
    if not len(levels):
        return float(_corners(parts)[:, 2].min()), 0.0
    level = round(lowest_level(levels, areas), 6)
    return level, float(areas[np.abs(levels - level) < _THICK].sum())


def _floor(low: np.ndarray, high: np.ndarray) -> Part:
    """A floor below a box."""
    (x, y, z), (right, far, _) = low, high
    corners = [(x, y, z), (right, y, z), (right, far, z), (x, far, z)]
    return Part("floor", trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False), "concrete")


def _write(path: Path, parts: list[Part], source: Path) -> None:
    """Write the scene file and its folder of meshes, each renamed when whole."""
    folder = path.with_name(f"{path.stem}.meshes")
    if folder.exists() and any(item.suffix != ".ply" for item in folder.iterdir()):
        raise InputError(f"{folder}: holds other files than meshes of an import, expected another output name")
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = folder.with_name(folder.name + ".part")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir()
    objects = []
    files: set[str] = set()
    names: set[str] = set()
    try:
        for part in parts:
            name = _unlike(part.name, names)
            file = _unlike(re.sub(r"[^A-Za-z0-9._-]+", "_", part.name)[:60].strip("._") or "part", files)
            mesh = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces, process=False)
            (fresh / f"{file}.ply").write_bytes(trimesh.exchange.ply.export_ply(mesh, vertex_normal=False))
            item = {"name": name, "shape": "mesh", "file": f"{folder.name}/{file}.ply", "material": part.material}
            objects.append(item | ({"solid": True} if part.solid else {}))
        text = f"# imported from {source.name}\n" + yaml.safe_dump(
            {"name": path.stem, "objects": objects}, sort_keys=False, width=120, default_flow_style=None
        )
        shutil.rmtree(folder, ignore_errors=True)
        os.replace(fresh, folder)
        with replacing(path) as half:
            half.write_text(text, encoding="utf-8")
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _unlike(name: str, taken: set[str]) -> str:
    """Return a name, numbered if it is taken already, ignoring case."""
    number, unique = 1, name
    while unique.lower() in taken:
        number += 1
        unique = f"{name}-{number}"
    taken.add(unique.lower())
    return unique
