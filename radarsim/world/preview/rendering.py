"""A perspective picture of a scene by Mitsuba's path tracer: the building cut open below its ceilings, in daylight."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np
import trimesh
from jaxtyping import Float

from radarsim.world import shapes
from radarsim.world.clearance import between
from radarsim.world.materials import Material
from radarsim.world.preview.section import Section
from radarsim.world.scene import Scene

#: Where the building is cut, m below its top: under lamps and ceilings, above doors.
BELOW_TOP = 0.45
_AHEAD = np.array([0.30, 0.60, -0.80])
_SUN = np.array([0.55, 0.35, -0.85])
CAP = (0.16, 0.16, 0.17)  # of walls cut through


def render(scene: Scene, width: int = 1100, samples: int = 40) -> Float[np.ndarray, "h w 3"]:
    """The scene from above, sRGB in 0...1.

    Args:
        scene: the world.
        width: pixels.
        samples: paths per pixel.

    Raises:
        InputError: no usable LLVM.
    """
    meshes = cut_open(scene)
    corners = np.concatenate([m.vertices for m, _ in meshes])
    eye, target, tangent, height = _camera(corners, width)
    with _rgb() as mi:
        plan: dict[str, object] = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 5, "hide_emitters": True},
            "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [0.62, 0.66, 0.72]}},
            "sun": {
                "type": "directional",
                "direction": _SUN.tolist(),
                "irradiance": {"type": "rgb", "value": [1.5, 1.42, 1.3]},
            },
            "sensor": {
                "type": "perspective",
                "fov": float(np.rad2deg(2 * np.arctan(tangent))),
                "fov_axis": "x",
                "to_world": mi.ScalarTransform4f().look_at(eye.tolist(), target.tolist(), [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgba"},
                "sampler": {"type": "independent", "sample_count": samples},
            },
        }
        for number, (mesh, made) in enumerate(meshes):
            plan[f"part{number}"] = _shape(mi, f"part{number}", mesh, _finish(made) if made else _diffuse(CAP))
        image = np.array(mi.render(mi.load_dict(plan), seed=0))
    alpha = np.clip(image[..., 3:], 0, 1)
    linear = np.clip(1.05 * image[..., :3] + (1 - alpha), 0, 1)  # on white
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


@contextmanager
def _rgb() -> Iterator:
    """Mitsuba in colour; the radar's ray tests use another variant, which comes back afterwards."""
    from radarsim.machine import llvm

    llvm.require()
    import mitsuba as mi
    import sionna.rt  # noqa: F401  chooses its variant when it is loaded

    before = mi.variant()
    mi.set_variant("llvm_ad_rgb")
    try:
        yield mi
    finally:
        if before:
            mi.set_variant(before)


def cut_open(scene: Scene) -> list[tuple[trimesh.Trimesh, Material | None]]:
    """Triangles below the cut by material, and caps on the walls, which are of none."""
    low, high = scene.bounds[:, 2]
    level = high - BELOW_TOP if high - low > 2.2 else high + 0.01
    by_material: dict[str, list[np.ndarray]] = {}
    made = {}
    for item in scene.objects:
        below = between(item.mesh.triangles, low - 1.0, level)
        if len(below):
            by_material.setdefault(item.material.name, []).append(below)
            made[item.material.name] = item.material
    parts: list[tuple[trimesh.Trimesh, Material | None]] = [
        (_mesh(np.concatenate(t)), made[name]) for name, t in by_material.items()
    ]
    caps = [
        shapes.polygon(area.buffer(0), (0, 0, level)) for area, _ in Section.of(scene, level - 2e-3).areas(scene)
        if area.area > 1e-3
    ]  # fmt: skip
    if caps:
        parts.append((shapes.joined(*caps), None))
    return parts


def _mesh(triangles: Float[np.ndarray, "t 3 3"]) -> trimesh.Trimesh:
    return trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)


def _diffuse(color: tuple[float, float, float]) -> dict:
    linear = [float(c) ** 2.2 for c in color]
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": linear}}}


def _finish(material: Material) -> dict:
    """How a material looks: panes let light through, metal shines a little, all else is dull."""
    if material.name == "glass":
        return {"type": "mask", "opacity": 0.35, "bsdf": _diffuse(material.color)}
    if material.conductor:
        linear = [float(c) ** 2.2 for c in np.minimum(1.25 * np.array(material.color), 1)]
        shine = {"type": "roughplastic", "diffuse_reflectance": {"type": "rgb", "value": linear}, "alpha": 0.25}
        return {"type": "twosided", "bsdf": shine}
    return _diffuse(material.color)


def _shape(mi: ModuleType, name: str, mesh: trimesh.Trimesh, finish: dict) -> object:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(finish)
    shape = mi.Mesh(name, len(mesh.vertices), len(mesh.faces), props=properties)
    data = mi.traverse(shape)
    data["vertex_positions"] = np.ravel(mesh.vertices).astype(np.float32)
    data["faces"] = np.ravel(mesh.faces).astype(np.uint32)
    data.update()
    return shape


def _camera(
    corners: Float[np.ndarray, "n 3"], width: int
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"], float, int]:
    """Eye, target, tangent of half the angle of view across and picture height that just show all corners."""
    ahead = _AHEAD / np.linalg.norm(_AHEAD)
    low, high = corners.min(axis=0), corners.max(axis=0)
    target, reach = (low + high) / 2, np.linalg.norm(high - low)
    for _ in range(4):
        eye = target - 1.15 * reach * ahead
        right = np.cross(ahead, [0, 0, 1])
        right /= np.linalg.norm(right)
        top = np.cross(right, ahead)
        seen = np.stack([(corners - eye) @ right, (corners - eye) @ top], axis=1) / ((corners - eye) @ ahead)[:, None]
        middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
        target = target + 1.15 * reach * (middle[0] * right + middle[1] * top)
    half = 1.04 * np.abs(seen).max(axis=0)
    return eye, target, float(half[0]), max(int(width * half[1] / half[0]), 1)
