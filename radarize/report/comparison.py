"""Methods beside each other on the same recordings: trajectories, distributions of errors, maps.

Methods and recordings are names, and `colors` has one for each method.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from radarize.report.drawings import canvas
from radarize.report.page import COLORS, INK, Page
from radarize.report.plots import from_above, line, panels, plain, walls

#: Poses of a trajectory that are drawn, and errors of a distribution.
_POSES, _ERRORS = 240, 200
Path = Float[np.ndarray, "pose 2"]


def draw_trajectories(page: Page, paths: Mapping[str, Mapping[str, Path]], colors: Mapping[str, str]) -> None:
    """Trajectories from above, of one recording at a time.

    Args:
        page: to draw on.
        paths: by recording and method, in the truth's frame; ``truth`` among the methods is dotted.
        colors: of methods.
    """
    page.section(
        "Trajectories",
        "From above, each laid upon the truth. The menu chooses a recording; click a name to hide or show a method.",
    )
    figure, owners = from_above(), []
    for recording, methods in paths.items():
        for method, path in methods.items():
            color, dash = (COLORS["good"], "dot") if method == "truth" else (colors[method], "solid")
            shown = {"visible": recording == next(iter(paths)), "showlegend": True}
            line(figure, path[_spread(path, _POSES)], method, color, dash=dash, **shown)
            owners.append(recording)
    buttons = [
        {"label": plain(name), "method": "restyle", "args": [{"visible": [owner == name for owner in owners]}]}
        for name in paths
    ]
    figure.update_layout(updatemenus=[{"buttons": buttons, "x": 1.02, "xanchor": "left", "y": 1, "yanchor": "top"}])
    page.plot(figure, height=640)


def draw_errors(
    page: Page,
    errors: Mapping[str, Float[np.ndarray, "pose"]],
    means: Mapping[str, Mapping[str, float]],
    colors: Mapping[str, str],
) -> None:
    """Share of poses within an error, and errors of recordings.

    Args:
        page: to draw on.
        errors: of position by method, as many of each recording, m.
        means: mean errors of position by method and recording, m.
        colors: of methods.
    """
    page.section(
        "Errors",
        "Share of all poses, every recording alike, whose position is off by no more than that, after alignment; and "
        "the mean error of each recording (dots).",
    )
    shares = panels("share of poses", x="position error, m")
    boxes = panels("mean position error, m", x="")
    for method, values in errors.items():
        some = _spread(values, _ERRORS)
        line(shares, (np.sort(values)[some], (some + 1) / len(values)), method, colors[method])
        recordings = {"text": [plain(name) for name in means[method]], "boxpoints": "all"}
        boxes.add_box(y=[*means[method].values()], name=plain(method), marker={"color": colors[method]}, **recordings)
    shares.update_xaxes(rangemode="tozero")
    shares.update_yaxes(range=[0, 1])
    page.plot(shares)
    boxes.update_yaxes(rangemode="tozero")
    boxes.update_layout(showlegend=False)
    page.plot(boxes)


class Floor(NamedTuple):
    """What is known of a recording's floor, in the truth's frame.

    Attributes:
        plan: wall segments (x0 y0 x1 y1), m; None if unknown.
        path: true one, m.
        cells: occupied ones of the map by method, m.
    """

    plan: Float[np.ndarray, "segment 4"] | None
    path: Path
    cells: Mapping[str, Float[np.ndarray, "cell 2"]]


def draw_maps(page: Page, floors: Mapping[str, Floor], colors: Mapping[str, str]) -> None:
    """Maps beside the floor plan, a picture for each recording."""
    page.section(
        "Maps", "Floor plan where the simulated recording knows it, and SLAM's maps, all in the truth's frame."
    )
    for recording, floor in floors.items():
        titles = ["floor plan", *floor.cells]
        columns = min(len(titles), 4)
        figure, axes = canvas(columns, -(-len(titles) // columns), height=3.0)
        low, high = floor.path.min(axis=0) - 5, floor.path.max(axis=0) + 5
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, title in zip(axes.flat, titles, strict=False):
            axis.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            axis.set_title(title, parse_math=False)
            if floor.plan is not None:
                axis.plot(*walls(floor.plan).T, color=INK, lw=0.8 if axis is axes.flat[0] else 0.4, alpha=0.9)
            if title in floor.cells:
                axis.plot(*floor.cells[title].T, ",", color=colors[title])
        axes.flat[0].plot(*floor.path.T, color=COLORS["good"], lw=1)
        page.picture(figure, recording)


def _spread(values: np.ndarray, most: int) -> np.ndarray:
    """Indices of some values from the first to the last."""
    return np.linspace(0, len(values) - 1, min(most, len(values))).astype(int)
