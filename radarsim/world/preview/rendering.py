"""Perspective rendering of a scene by Sionna RT's path tracer: the building cut open below its ceilings."""

import numpy as np
from jaxtyping import Float

from radarsim.world import shapes
from radarsim.world.clearance import between
from radarsim.world.materials import Material
from radarsim.world.objects import SceneObject
from radarsim.world.preview.section import Section
from radarsim.world.scene import Scene

#: Cut below the building's top, m: under lamps and ceilings, above doors.
BELOW_TOP = 0.45
_AHEAD = np.array([0.30, 0.60, -0.80])
#: Colour of walls cut through.
CAP = Material("cut", None, 0.0, 0.0, color=(0.16, 0.16, 0.17))


def render(scene: Scene, width: int = 1100, samples: int = 40) -> Float[np.ndarray, "h w 3"]:
    """Render the scene from above, sRGB in 0...1.

    Args:
        scene: the world.
        width: pixels.
        samples: paths per pixel.

    Raises:
        InputError: no usable LLVM.
    """
    opened = Scene(scene.name, cut_open(scene))
    eye, target, tangent, height = _camera(opened.triangles.reshape(-1, 3), width)
    world = opened.sionna  # before Sionna RT is loaded: this selects the LLVM
    import sionna.rt as rt

    image = np.array(
        world.render(
            camera=rt.Camera(position=eye.tolist(), look_at=target.tolist()), resolution=(width, height),
            fov=float(np.rad2deg(2 * np.arctan(tangent))), num_samples=samples, show_devices=False, return_bitmap=True,
        )
    )  # fmt: skip
    alpha = np.clip(image[..., 3:], 0, 1)
    linear = np.clip(image[..., :3] + (1 - alpha), 0, 1)  # on white
    return np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def cut_open(scene: Scene) -> list[SceneObject]:
    """Objects below the cut, by material, and caps on the walls."""
    low, high = scene.bounds[:, 2]
    level = high - BELOW_TOP if high - low > 2.2 else high + 0.01
    triangles: dict[Material, list[np.ndarray]] = {}
    for item in scene.objects:
        if len(below := between(item.mesh.triangles, low - 1.0, level)):
            triangles.setdefault(item.material, []).append(below)
    found = [SceneObject(what.name, shapes.loose(np.concatenate(some)), what) for what, some in triangles.items()]
    areas = [area for area, _ in Section.of(scene, level - 2e-3).areas(scene) if area.area > 1e-3]
    caps = [shapes.polygon(area.buffer(0), (0, 0, level)) for area in areas]
    return [*found, SceneObject(CAP.name, shapes.joined(*caps), CAP)] if caps else found


def _camera(
    corners: Float[np.ndarray, "n 3"], width: int
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"], float, int]:
    """Eye, target, tangent of half the field of view across and picture height that just contain all corners."""
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
