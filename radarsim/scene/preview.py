"""Pictures of a scene: a plan coloured by material and a view from above with the ceiling taken off."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarsim.scene.scene import Scene, SceneObject

_SUN = np.array([-0.35, -0.55, 0.85]) / np.linalg.norm([-0.35, -0.55, 0.85])
_PLAN_HEIGHTS = (0.1, 0.3, 0.6, 0.735, 1.1, 1.6)


def preview(scene: Scene, folder: str | Path) -> list[Path]:
    """Write ``NAME.plan.png`` and ``NAME.view.png`` into `folder` and return their paths."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{scene.name}.plan.png", folder / f"{scene.name}.view.png"]
    _plan(scene).savefig(paths[0], dpi=110, bbox_inches="tight")
    from PIL import Image

    Image.fromarray((255 * view(scene)).astype(np.uint8)).save(paths[1])
    return paths


def _plan(scene: Scene):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    low, high = scene.bounds
    size = np.maximum(high - low, 1.0)
    figure = Figure(figsize=(12, np.clip(12 * size[1] / size[0], 3, 14) + 0.6))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    # Floors and what stands on them from below upwards; ceilings and lamps are left out.
    up = (scene.normals[:, 2] > 0.5) & (scene.triangles[:, :, 2].max(axis=1) < low[2] + 1.7)
    order = np.flatnonzero(up)[np.argsort(scene.triangles[up][:, :, 2].mean(axis=1), kind="stable")]
    colors = np.array([o.material.color for o in scene.objects])[scene.triangle_object[order]]
    axes.add_collection(
        PolyCollection(
            scene.triangles[order][:, :, :2], facecolors=0.5 + 0.5 * colors, edgecolors="face", linewidths=0.3
        )
    )
    seen = {o.material.name: o.material.color for o in scene.objects}
    for name, color in seen.items():
        part = [o for o in scene.objects if o.material.name == name]
        lines = [Scene(name, part).floor_plan(h) for h in _PLAN_HEIGHTS if h < high[2]]
        dark = 0.75 * np.array(color)
        width = 1.6 if name in ("plasterboard", "concrete", "brick") else 0.9
        axes.add_collection(LineCollection(np.concatenate(lines).reshape(-1, 2, 2), colors=[dark], linewidths=width))
    handles = [Line2D([], [], color=color, lw=6, label=name) for name, color in sorted(seen.items())]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=7, frameon=False)
    axes.set(xlim=(low[0] - 0.4, high[0] + 0.4), ylim=(low[1] - 0.4, high[1] + 0.4), aspect="equal")
    axes.set(xlabel="x / m", ylabel="y / m", title=f"{scene.name}: plan, {size[0]:.1f} x {size[1]:.1f} m")
    return figure


def view(scene: Scene, width: int = 1280, samples: int = 12) -> Float[np.ndarray, "h w 3"]:
    """A perspective picture, RGB in 0...1: sunlight with shadows and skylight, by the scene's own ray tests."""
    shown = _without_ceiling(scene)
    low, high = shown.bounds
    center, reach = (low + high) / 2, np.linalg.norm(high - low)
    ahead = np.array([0.28, 0.62, -0.78]) / np.linalg.norm([0.28, 0.62, -0.78])
    eye = center - 1.1 * reach * ahead
    right = np.cross(ahead, [0, 0, 1])
    right /= np.linalg.norm(right)
    top = np.cross(right, ahead)
    # The picture's edges are those of the world, as tangents of the angles from the line of sight, and a little more.
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    seen = np.stack([(corners - eye) @ right, (corners - eye) @ top], axis=1) / ((corners - eye) @ ahead)[:, None]
    edges = np.stack([seen.min(axis=0), seen.max(axis=0)])
    edges += 0.04 * np.ptp(edges, axis=0) * [[-1], [1]]
    height = int(width * np.ptp(edges[:, 1]) / np.ptp(edges[:, 0]))
    colors = np.array([o.material.color for o in shown.objects])
    rng = np.random.default_rng(0)
    picture = np.zeros((height * width, 3))
    for _ in range(samples):
        u = np.interp((np.arange(width) + rng.random(width)) / width, [0, 1], edges[:, 0])
        v = np.interp((np.arange(height) + rng.random(height)) / height, [0, 1], edges[::-1, 1])
        u, v = np.meshgrid(u, v)
        rays = (ahead + u[..., None] * right + v[..., None] * top).reshape(-1, 3)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        picture += _shade(shown, colors, eye, rays, rng)
    # sRGB's transfer function, nearly
    return np.clip((picture / samples).reshape(height, width, 3), 0, 1) ** (1 / 2.2)


def _without_ceiling(scene: Scene) -> Scene:
    """The scene without what hangs above head height and without horizontal faces up there."""
    top = scene.bounds[1, 2]
    kept: list[SceneObject] = []
    for item in scene.objects:
        lowest = item.mesh.vertices[:, 2].min()
        if top > 2.2 and lowest > max(0.75 * top, top - 0.8):
            continue
        kept.append(item)
    return Scene(scene.name, kept or scene.objects)


def _shade(scene: Scene, colors, eye, rays, rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    color = np.full((len(rays), 3), 1.0)
    through = np.ones((len(rays), 1))
    origin = np.broadcast_to(eye, rays.shape)
    distance, triangle = scene.hit(origin, rays)
    # Glass tints what lies behind it, once.
    glass = np.array([o.material.name == "glass" for o in scene.objects])
    pane = (triangle >= 0) & glass[scene.triangle_object[triangle]]
    if pane.any():
        behind = origin[pane] + (distance[pane, None] + 1e-3) * rays[pane]
        further, triangle[pane] = scene.hit(behind, rays[pane])
        distance[pane] += further + 1e-3
        through[pane] = 0.75
    hit = triangle >= 0
    point = origin[hit] + distance[hit, None] * rays[hit]
    normal = scene.normals[triangle[hit]]
    normal = np.where(np.sum(normal * rays[hit], axis=1, keepdims=True) > 0, -normal, normal)
    start = point + 2e-3 * normal
    sun = np.maximum(normal @ _SUN, 0) * ~scene.occluded(start, start + 40 * _SUN)
    scatter = rng.standard_normal(normal.shape)
    scatter = normal + scatter / np.linalg.norm(scatter, axis=1, keepdims=True)
    scatter /= np.maximum(np.linalg.norm(scatter, axis=1, keepdims=True), 1e-9)
    # Light comes from the open top, and some bounces inside the rooms.
    sky = np.where(scene.occluded(start, start + 3.0 * scatter), 0.35, 1.0)
    light = 0.55 * sun + 0.55 * sky
    base = colors[scene.triangle_object[triangle[hit]]] ** 2.2
    color[hit] = base * light[:, None]
    return color * through
