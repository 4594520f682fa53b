"""Scene of triangles with materials, and its ray tests.

Ray tests use the Mitsuba geometry of a Sionna RT scene (Embree on a CPU, one shape per object) in float32:
within a kilometre of the origin, which is checked, the error of positions is 0.06 mm, well under the margin of
`occluded`.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
import trimesh
from jaxtyping import Bool, Float, Float32, Int
from numba import njit
from numpy.typing import ArrayLike

from radarize.io.errors import InputError
from radarsim.machine import llvm
from radarsim.world import shapes
from radarsim.world.description import built, find, read, split_level
from radarsim.world.materials import EPS0, Material
from radarsim.world.objects import SceneObject
from radarsim.world.surface_settings import IDEAL, SurfaceSettings

FREQUENCY = 77e9  # initial frequency of Sionna RT's own solvers
_REACH = 1000.0
#: Number of four-byte entries of a processor's widest SIMD instruction.
_PACKET = 16


class Scene:
    """Objects, their triangles in one list, and ray tests.

    Args:
        name: name for titles and recordings.
        objects: objects with unique names.
        movers: moving objects (`movers`); ray tests use the static objects only.
        surface_settings: clutter and roughness.
        interferers: other radars that transmit (`interferers`).

    Attributes:
        triangles: (T, 3, 3) corners of all triangles, in the order of the objects, m.
        normals: (T, 3) unit normals.
        triangle_object: (T,) index into `objects`.

    Raises:
        InputError: no object, a repeated name, or a mesh without triangles or too far away.
    """

    def __init__(
        self,
        name: str,
        objects: list[SceneObject],
        movers: Sequence = (),
        surface_settings: SurfaceSettings = IDEAL,
        interferers: Sequence = (),
    ):
        self.name, self.objects, self.movers, self.interferers = name, list(objects), list(movers), list(interferers)
        self.surface_settings = surface_settings
        if not self.objects:
            raise InputError(f"scene {name}: has no objects, expected at least one")
        seen: set[str] = set()
        for item in self.objects:
            if item.name in seen:
                raise InputError(f"scene {name}: two objects are named {item.name!r}, expected unique names")
            seen.add(item.name)
            if not len(item.mesh.faces):
                raise InputError(f"scene {name}: object {item.name!r} has no triangles")
            if not np.all(np.abs(item.mesh.vertices) < _REACH):
                raise InputError(
                    f"scene {name}: object {item.name!r} reaches {np.abs(item.mesh.vertices).max():g} m from the "
                    f"origin, expected finite coordinates within {_REACH:g} m"
                )
        self.triangles = np.concatenate([np.asarray(o.mesh.vertices)[o.mesh.faces] for o in self.objects])
        self.triangle_object = np.repeat(np.arange(len(self.objects)), [len(o.mesh.faces) for o in self.objects])
        cross = np.cross(self.triangles[:, 1] - self.triangles[:, 0], self.triangles[:, 2] - self.triangles[:, 0])
        self.normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)

    def __reduce__(self):
        """Pickle without the geometry for ray tests, which every process builds for itself."""
        return Scene, (self.name, self.objects, self.movers, self.surface_settings, self.interferers)

    @classmethod
    def load(cls, path: str | Path, changes: Mapping[str, object] | None = None) -> "Scene":
        """Read a scene file.

        Args:
            path: a YAML file; a bare name such as ``office`` is searched as a file here, then in ``scenes/`` here,
                then among the project's scenes. ``NAME@2`` is level 2 of a scene that has levels.
            changes: values that replace the file's (``{"clutter": 1.2}``).

        Raises:
            InputError: missing file, malformed YAML, unknown key, material or level, missing mesh; with file and field.
        """
        return cls(*read(find(path), split_level(path)[1], changes))

    @classmethod
    def of(cls, description: dict, name: str) -> "Scene":
        """Build a scene from a description without a file: ``Scene.of({"building": {"kind": "A", "seed": 3}}, "a3")``.

        Args:
            description: as in a scene file; mesh files are relative to the working directory.
            name: of the scene.

        Raises:
            InputError: unknown key, value, material or mesh file; with the field.
        """
        return cls(name, *built(description, f"scene {name}", Path())[1:])

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest corner, m."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def sionna(self):
        """The scene as a `sionna.rt.Scene` with radio materials; its `mi_scene` performs the ray tests.

        Raises:
            InputError: no usable LLVM.
        """
        return self._geometry[0]

    @cached_property
    def _geometry(self):
        """The Sionna scene, and the first triangle of the shape with each Mitsuba registry number."""
        llvm.require()
        import drjit as dr
        import mitsuba as mi
        import sionna.rt as rt

        scene = rt.Scene()
        scene.frequency = FREQUENCY
        radio = {o.material.name: _radio_material(o.material) for o in self.objects}
        items = []
        for number, item in enumerate(self.objects):
            label = f"{number} {item.name}".replace(".", "_")  # Mitsuba keeps dots for paths
            shape = mi.Mesh(label, len(item.mesh.vertices), len(item.mesh.faces))
            data = mi.traverse(shape)
            data["vertex_positions"] = _lent(np.ravel(item.mesh.vertices), np.float32)
            data["faces"] = _lent(np.ravel(item.mesh.faces), np.uint32)
            data.update()
            items.append(rt.SceneObject(mi_mesh=shape, name=label, radio_material=radio[item.material.name]))
        scene.edit(add=items)
        numbers = [dr.reinterpret_array(mi.UInt32, mi.ShapePtr(o.mi_mesh)).numpy()[0] for o in items]
        counts = [len(o.mesh.faces) for o in self.objects]
        first = np.zeros(max(numbers) + 1, np.int64)
        first[numbers] = np.cumsum([0, *counts[:-1]])
        return scene, first

    def occluded(
        self, origins: Float[np.ndarray, "*#n 3"], targets: Float[np.ndarray, "*#n 3"], margin: float = 1e-3
    ) -> Bool[np.ndarray, "*#n"]:
        """Whether anything lies on the segment from origin to target, both ends shortened by `margin` (m)."""
        geometry = self.sionna.mi_scene  # before Dr.Jit is loaded: this selects the LLVM
        origins, targets = np.broadcast_arrays(np.asarray(origins, float), np.asarray(targets, float))
        if not len(origins):
            return np.zeros(0, bool)
        ray, length = _rays(origins, targets - origins, margin)
        ray.maxt = length
        return geometry.ray_test(ray).numpy().astype(bool)

    def hit(
        self, origins: Float[np.ndarray, "*#n 3"], directions: Float[np.ndarray, "*#n 3"], coherent: bool = False
    ) -> tuple[Float[np.ndarray, "*#n"], Int[np.ndarray, "*#n"]]:
        """Distance along each ray to the first triangle (inf: none) and that triangle's index (-1: none).

        `coherent`: neighbours in the list are neighbours in space, as a picture's rays are; twice as fast.
        """
        scene, first = self._geometry  # before Dr.Jit is loaded: this selects the LLVM
        import drjit as dr
        import mitsuba as mi

        origins, directions = np.broadcast_arrays(np.asarray(origins, float), np.asarray(directions, float))
        if not len(origins):
            return np.zeros(0), np.zeros(0, int)
        ray, _ = _rays(origins, directions, 0.0)
        found = scene.mi_scene.ray_intersect_preliminary(ray, coherent)
        shape = dr.reinterpret_array(mi.UInt32, found.shape)
        dr.eval(found.t, shape, found.prim_index)
        distance = found.t.numpy().astype(float)
        number = shape.numpy()
        missed = (number == 0) | ~np.isfinite(distance)
        triangle = first[np.where(missed, 0, number)] + found.prim_index.numpy()
        return np.where(missed, np.inf, distance), np.where(missed, -1, triangle)

    @cached_property
    def floors_and_ceilings(self) -> Bool[np.ndarray, "triangle"]:
        """Mask of the triangles that are floor or ceiling."""
        edges = np.cumsum([0, *(len(item.mesh.faces) for item in self.objects)])
        parts = zip(self.objects, edges, edges[1:], strict=False)
        middle = self.triangles.mean(axis=1)
        return np.concatenate([o.floors_and_ceilings(middle[a:b], self.normals[a:b]) for o, a, b in parts])

    def cut(self, height: float) -> tuple[Float[np.ndarray, "n 2 2"], Int[np.ndarray, "n"]]:
        """Intersection with the plane z = `height`: ends of segments, m, and the triangle of each."""
        mesh = shapes.loose(self.triangles)
        # A cut through an edge or a horizontal face is ill defined, so it is shifted by a nanometre.
        lines, faces = trimesh.intersections.mesh_plane(mesh, [0, 0, 1], [0, 0, height + 1e-9], return_faces=True)
        lines = np.round(np.asarray(lines, float)[..., :2].reshape(-1, 2, 2), 6)
        some = np.any(lines[:, 0] != lines[:, 1], axis=1)
        return lines[some], np.asarray(faces, int)[some]

    def floor_plan(self, height: float) -> Float[np.ndarray, "n 4"]:
        """Intersection with the plane z = `height` as segments x0 y0 x1 y1 in m; collinear pieces are joined."""
        lines, _ = self.cut(height)
        if not len(lines):
            return np.zeros((0, 4))
        merged = shapely.simplify(shapely.line_merge(shapely.union_all(shapely.linestrings(lines))), 1e-6)
        pieces = []
        for line in shapely.get_parts(merged):
            points = shapely.get_coordinates(line)
            pieces.append(np.hstack([points[:-1], points[1:]]))
        return np.concatenate(pieces)


def _rays(origins: Float[np.ndarray, "n 3"], ways: Float[np.ndarray, "n 3"], margin: float) -> tuple:
    """Mitsuba's rays along vectors, and their lengths, both ends shortened by `margin`, m.

    Dr.Jit is given each row by itself: a kernel that takes a vector from an array of two dimensions contains the number
    of rays, so that every new number costs a compilation of 30 ms.
    """
    import mitsuba as mi

    *rows, length = map(mi.Float, _lent_rays(origins, ways, margin))
    return mi.Ray3f(mi.Point3f(*rows[:3]), mi.Vector3f(*rows[3:])), length


def _lent_rays(
    origins: Float[np.ndarray, "n 3"], ways: Float[np.ndarray, "n 3"], margin: float
) -> Float32[np.ndarray, "7 n"]:
    """Origins, unit directions and lengths of the same, in memory that Dr.Jit can read, see `_room`."""
    rays = _room((7, -(-len(ways) // _PACKET) * _PACKET), np.float32)[:, : len(ways)]
    _aim(np.ascontiguousarray(origins), np.ascontiguousarray(ways), margin, rays)
    return rays


@njit(cache=True)
def _aim(origins, ways, margin, rays):
    for i in range(len(ways)):
        x, y, z = ways[i]
        length = np.sqrt(x * x + y * y + z * z)
        some = max(length, 1e-12)
        for d in range(3):
            rays[3 + d, i] = ways[i, d] / some
            rays[d, i] = origins[i, d] + margin * (ways[i, d] / some)
        rays[6, i] = max(length - 2 * margin, 0.0)


def _lent(values: np.ndarray, dtype: type) -> np.ndarray:
    """Array in memory that Dr.Jit can read, see `_room`."""
    found = _room(values.shape, dtype)
    found[...] = values
    return found


def _room(shape: tuple[int, ...], dtype: type) -> np.ndarray:
    """Array of four-byte entries that Dr.Jit can read in place, which it does in whole packets.

    Padding at the end keeps it from reading beyond the memory that the process may read. The start is aligned to a
    packet, as rows are whose length is whole packets: Dr.Jit compiles each kernel anew for every combination of aligned
    and unaligned inputs.
    """
    size = int(np.prod(shape))
    room: np.ndarray = np.empty(size + 2 * _PACKET, dtype)
    first = -room.ctypes.data // room.itemsize % _PACKET
    room[first + size :] = 0
    return room[first : first + size].reshape(shape)


def _radio_material(material: Material) -> object:
    """Sionna's equivalent of a material: the same permittivity, roughness as a Lambertian part of the reflection."""
    import drjit as dr
    import mitsuba as mi
    import sionna.rt as rt

    def law(frequency: ArrayLike) -> tuple:
        hertz = float(np.ravel(np.array(frequency))[0])
        if material.conductor:
            return mi.Float(1.0), mi.Float(1e7)
        eps = material.permittivity_at(hertz)
        return mi.Float(eps.real), mi.Float(-eps.imag * 2 * dr.pi * hertz * EPS0)

    gamma = abs(complex(material.fresnel(np.array(1.0), FREQUENCY)[0]))
    return rt.RadioMaterial(
        name=material.name.replace(".", "_"),
        thickness=material.thickness or 0.5,
        # sigma0 = 4 S^2 |Gamma|^2 at normal incidence for Sionna's Lambertian pattern
        scattering_coefficient=float(np.clip(np.sqrt(material.sigma0) / (2 * gamma), 0.0, 1.0)),
        scattering_pattern="lambertian",
        frequency_update_callback=law,
        color=material.color,
    )
