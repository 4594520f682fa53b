"""Interactive 3-D page of a scene: the building cut open, a tour, and a frame's propagation paths by path type."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float, UInt8

from radarize.evaluation.report.page import COLORS, INK, Page
from radarize.radar.presets import PRESETS
from radarsim.motion.walk import Walk
from radarsim.propagation.path_types import PathType
from radarsim.propagation.paths import Paths
from radarsim.scenario import Scenario
from radarsim.world.preview.rendering import cut_open
from radarsim.world.scene import Scene

#: Number of rays drawn per path type, the strongest first.
RAYS = 80
#: Colours by path type, as in the viewer.
_COLOURS = ("#39d0d8", "#8b949e", "#9a6fd0", "#e4572e", "#2e9e6b")
_STEP = 0.1  # s between points of the tour
_GLASS = 0.25


def web_preview(scene: Scene, output: Path, walk: Walk | None = None, time: float = 0.0, seed: int = 0) -> Path:
    """Write a 3-D page of a scene that opens without a network.

    Args:
        scene: the world.
        output: page to write (``.html``).
        walk: the tour that is drawn; default: a handheld one of 40 s.
        time: start of the frame whose echoes are drawn, s from the start of the tour.
        seed: seed of the tour and of the scene's random choices.

    Raises:
        InputError: no room to move, or the page cannot be written.
    """
    motion = (walk or Walk()).through(scene, seed)
    scenario = Scenario(scene, motion, PRESETS["radarize"], seed=seed)
    frame = scenario.frames(np.array([time]))
    (paths,), (types,), (place,) = frame.paths, frame.types, motion.position(frame.middles)
    page = Page(scene.name, f"echoes {time:g} s into a tour of {motion.duration:g} s")
    figure = go.Figure([*_building(scene), _tour(motion.position(np.arange(0, motion.duration, _STEP)), place)])
    figure.add_traces(_rays(paths, types, place))
    hidden = {"visible": False}
    figure.update_layout(scene={"aspectmode": "data", "xaxis": hidden, "yaxis": hidden, "zaxis": hidden})
    page.plot(figure, height=720)
    page.text(
        f"The {RAYS} strongest echoes of each path type. Rays over mirrors are drawn unfolded: straight to the "
        "apparent place of the target for the transmitter, and from its apparent place for the receiver. "
        "A click on a path type hides it."
    )
    counts = np.bincount(types, minlength=len(PathType))
    powers = np.bincount(types, np.abs(paths.amplitude) ** 2, minlength=len(PathType))
    rows = [(_words(each), counts[each], f"{10 * np.log10(powers[each]):.1f}") for each in PathType if counts[each]]
    page.table(("path type", "echoes", "received over transmitted power, dB"), rows, numbers=(1, 2))
    return page.write(output)


def _words(path_type: PathType) -> str:
    return path_type.name.lower().replace("_", " ")


def _building(scene: Scene) -> list[go.Mesh3d]:
    meshes = []
    for item in cut_open(scene):
        (x, y, z), (i, j, k), name = item.mesh.vertices.T, item.mesh.faces.T, item.name
        red, green, blue = (round(255 * float(c)) for c in item.material.color)
        meshes.append(
            go.Mesh3d(
                x=x.round(3), y=y.round(3), z=z.round(3), i=i, j=j, k=k, color=f"rgb({red},{green},{blue})", name=name,
                opacity=_GLASS if name == "glass" else 1.0, flatshading=True, hoverinfo="name",
            )
        )  # fmt: skip
    return meshes


def _tour(points: Float[np.ndarray, "step 3"], place: Float[np.ndarray, "3"]) -> go.Scatter3d:
    x, y, z = np.vstack([points, np.full(3, np.nan), place]).T.round(3)
    style = {"color": COLORS["slam"], "size": np.append(np.zeros(len(points) + 1), 8.0)}
    return go.Scatter3d(x=x, y=y, z=z, mode="lines+markers", name="tour", line={"color": INK, "width": 4}, marker=style)


def _rays(paths: Paths, types: UInt8[np.ndarray, "path"], place: Float[np.ndarray, "3"]) -> list[go.Scatter3d]:
    # A mirror of flat parts seems to hold the receiver's image: half-way to it the ray meets the mirror.
    ends = paths.apparent(place)
    found = []
    for path_type in PathType:
        members = np.flatnonzero(types == path_type)
        members = members[np.argsort(-np.abs(paths.amplitude[members]), kind="stable")][:RAYS]
        if not len(members):
            continue
        here, gap = np.broadcast_to(place, (len(members), 3)), np.full((len(members), 3), np.nan)
        there, back = ends[members].transpose(1, 0, 2)
        x, y, z = np.stack([here, there, gap, back, here, gap], axis=1).reshape(-1, 3).T.round(3)
        line = {"color": _COLOURS[path_type], "width": 2}
        found.append(go.Scatter3d(x=x, y=y, z=z, mode="lines", name=_words(path_type), line=line, hoverinfo="name"))
    return found
