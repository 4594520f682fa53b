"""A page with a scene in 3-D: the building cut open, a tour through it, and the echoes of a frame as rays by cause."""

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

#: Rays of each cause that are drawn, the strongest.
RAYS = 80
#: By cause, as in the viewer.
_CAUSES = ("#39d0d8", "#8b949e", "#9a6fd0", "#e4572e", "#2e9e6b")
_STEP = 0.1  # s between points of the tour
_GLASS = 0.25


def web_preview(scene: Scene, output: Path, walk: Walk | None = None, time: float = 0.0, seed: int = 0) -> Path:
    """Write a page that opens without a network.

    Args:
        scene: the world.
        output: page to write (``.html``).
        walk: the tour that is drawn; default: 40 s by hand.
        time: of the frame whose echoes are drawn, s from the tour's beginning.
        seed: of the tour and of all that the scene leaves open.

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
        f"Of each cause the {RAYS} strongest echoes. Rays over mirrors are drawn unfolded: straight to where the thing "
        "seems to be for the transmitter, and from where it seems to be for the receiver. A click on a cause hides it."
    )
    counts = np.bincount(types, minlength=len(PathType))
    powers = np.bincount(types, np.abs(paths.amplitude) ** 2, minlength=len(PathType))
    rows = [
        (_words(cause), counts[cause], f"{10 * np.log10(powers[cause]):.1f}") for cause in PathType if counts[cause]
    ]
    page.table(("cause", "echoes", "received over transmitted power, dB"), rows, numbers=(1, 2))
    return page.write(output)


def _words(cause: PathType) -> str:
    return cause.name.lower().replace("_", " ")


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
    for cause in PathType:
        members = np.flatnonzero(types == cause)
        members = members[np.argsort(-np.abs(paths.amplitude[members]), kind="stable")][:RAYS]
        if not len(members):
            continue
        here, gap = np.broadcast_to(place, (len(members), 3)), np.full((len(members), 3), np.nan)
        there, back = ends[members].transpose(1, 0, 2)
        x, y, z = np.stack([here, there, gap, back, here, gap], axis=1).reshape(-1, 3).T.round(3)
        line = {"color": _CAUSES[cause], "width": 2}
        found.append(go.Scatter3d(x=x, y=y, z=z, mode="lines", name=_words(cause), line=line, hoverinfo="name"))
    return found
