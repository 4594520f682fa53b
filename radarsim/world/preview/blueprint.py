"""Floor plan of a scene as a drawing: cut at breast height, walls filled, furniture light below."""

from typing import TYPE_CHECKING

import numpy as np
import shapely

from radarsim.world.preview.section import Section
from radarsim.world.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Height of the cut, m: above sills, through windows and doors. Objects below are seen from above.
CUT = 1.25
#: Fraction of the scene's height from which an object is part of the building.
_WALL = 0.9
_OUTLINES = (0.1, 0.3, 0.6, 0.735, 1.1)  # m, where furniture is outlined


def blueprint(scene: Scene) -> "Figure":
    """The plan as a matplotlib figure, with a scale and the materials' colours."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    low, high = scene.bounds
    size = np.maximum(high - low, 1.0)
    figure = Figure(figsize=(12, np.clip(12 * size[1] / size[0], 3, 14) + 0.8))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    colors = np.array([o.material.color for o in scene.objects])
    height = min(low[2] + CUT, (low[2] + high[2]) / 2)

    # Floors, and on them the objects below the cut, from the lowest upwards.
    up = (scene.normals[:, 2] > 0.5) & (scene.triangles[:, :, 2].max(axis=1) < height)
    order = np.flatnonzero(up)[np.argsort(scene.triangles[up][:, :, 2].mean(axis=1), kind="stable")]
    on_floor = scene.triangles[order][:, :, 2].max(axis=1) < low[2] + 0.02
    pale = np.where(on_floor[:, None], 0.22, 0.55)
    faces = 1 - pale + pale * colors[scene.triangle_object[order]]
    axes.add_collection(
        PolyCollection(list(scene.triangles[order][:, :, :2]), facecolors=faces, edgecolors="face", linewidths=0.3)
    )
    top = np.array([o.mesh.bounds[1, 2] for o in scene.objects])
    wall = top > low[2] + _WALL * size[2]
    for level in _OUTLINES:
        if low[2] + level < height:
            cut = Section.of(scene, low[2] + level)
            light = cut.lines[~wall[cut.owner]]
            axes.add_collection(LineCollection(light, colors="0.55", linewidths=0.5))

    cut = Section.of(scene, height)
    for area, owner in cut.areas(scene):
        # The cut is black, as usual; the faces of walls have the colours of their materials. The reveals of an opening
        # are lower than the wall that they bound.
        face = "0.2" if wall[owner] or area.area > 1.0 else colors[owner]
        for ring in _filled(area):
            axes.fill(*ring.T, facecolor=face, edgecolor="none", zorder=3)
    shade = np.where(wall[cut.owner, None], 0.85, 0.7) * colors[cut.owner]
    axes.add_collection(
        LineCollection(list(cut.lines), colors=shade, linewidths=np.where(wall[cut.owner], 1.3, 0.7), zorder=4)
    )

    seen = {o.material.name: o.material.color for o in scene.objects}
    handles = [Patch(facecolor=color, edgecolor="0.5", label=name) for name, color in sorted(seen.items())]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.55, 0.0), ncols=7, frameon=False, fontsize=9)
    length = 5.0 if size[0] > 12 else 1.0
    x, y = low[0], low[1] - 0.045 * size[1]
    for k in range(5):
        axes.barh(y, length / 5, 0.012 * size[1], x + k * length / 5, color="0.15" if k % 2 == 0 else "w", ec="0.15")
    axes.text(x + length + 0.2, y, f"{length:.0f} m", va="center", fontsize=9)
    axes.set(xlim=(low[0] - 0.4, high[0] + 0.4), ylim=(y - 0.02 * size[1], high[1] + 0.4), aspect="equal")
    axes.set_title(f"{scene.name}: {size[0]:.1f} x {size[1]:.1f} m", fontsize=11)
    axes.set_axis_off()
    return figure


def _filled(area: shapely.Polygon) -> list[np.ndarray]:
    """Convex pieces of an area with holes, which a filled outline would paint over."""
    if not area.interiors:
        return [np.array(area.exterior.coords)]
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    return [np.array(piece.buffer(0.004, join_style="mitre").exterior.coords) for piece in pieces]
