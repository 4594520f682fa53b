"""Runs of several methods beside each other: trajectories, distributions of errors, maps.

Runs are folders by recording and method; `colors` has one for each method.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from evo.core.trajectory import PoseTrajectory3D

from radarize.evaluation.evaluate import trajectories
from radarize.evaluation.report.drawings import canvas
from radarize.evaluation.report.page import COLORS, INK, Page
from radarize.evaluation.report.plots import from_above, line, panels, plain, walls
from radarize.io.alignment import fitted, moved, trajectory
from radarize.pipeline.runfolder import RunFolder

#: Poses of a trajectory that are drawn, and errors of a distribution.
_POSES, _ERRORS = 240, 200
Runs = Mapping[str, Mapping[str, RunFolder]]


def _truth(run: RunFolder) -> PoseTrajectory3D:
    assert run.reference is not None  # what is compared has been judged by it
    return trajectory(*run.reference)


def draw_trajectories(page: Page, runs: Runs, colors: Mapping[str, str], which: str) -> None:
    """Trajectories (``odometry`` or ``slam``) from above, laid upon the truth, of one recording at a time."""
    page.section(
        "Trajectories",
        "From above, each laid upon the truth. The menu chooses a recording; click a name to hide or show a method.",
    )
    figure, owners = from_above(), []
    for recording, folders in runs.items():
        truth = _truth(next(iter(folders.values())))
        paths = {method: trajectories(folder)[which] for method, folder in folders.items()}
        paths = {method: moved(path, *fitted(path, truth)) for method, path in paths.items()}
        for method, path in {"truth": truth, **paths}.items():
            color, dash = (COLORS["good"], "dot") if path is truth else (colors[method], "solid")
            shown = {"visible": recording == next(iter(runs)), "showlegend": True}
            some = path.positions_xyz[_spread(len(path.timestamps), _POSES)]
            line(figure, some, method, color, dash=dash, **shown)
            owners.append(recording)
    buttons = [
        {"label": plain(name), "method": "restyle", "args": [{"visible": [owner == name for owner in owners]}]}
        for name in runs
    ]
    figure.update_layout(updatemenus=[{"buttons": buttons, "x": 1.02, "xanchor": "left", "y": 1, "yanchor": "top"}])
    page.plot(figure, height=640)


def draw_errors(
    page: Page, errors: Mapping[str, Mapping[str, tuple[Sequence[float], float]]], colors: Mapping[str, str]
) -> None:
    """Share of poses within an error, and errors of recordings.

    Args:
        errors: of position by method and recording, m: quantiles, as many of each recording, and the mean.
    """
    page.section(
        "Errors",
        "Share of all poses, every recording alike, whose position is off by no more than that, after alignment; and "
        "the mean error of each recording (dots).",
    )
    shares = panels("share of poses", x="position error, m")
    boxes = panels("mean position error, m", x="")
    for method, recordings in errors.items():
        values = np.sort(np.concatenate([quantiles for quantiles, _ in recordings.values()]))
        some = _spread(len(values), _ERRORS)
        line(shares, (values[some], (some + 1) / len(values)), method, colors[method])
        dots = {"text": [plain(name) for name in recordings], "boxpoints": "all", "marker": {"color": colors[method]}}
        boxes.add_box(y=[mean for _, mean in recordings.values()], name=plain(method), **dots)
    shares.update_xaxes(rangemode="tozero")
    shares.update_yaxes(range=[0, 1])
    page.plot(shares)
    boxes.update_yaxes(rangemode="tozero")
    boxes.update_layout(showlegend=False)
    page.plot(boxes)


def draw_maps(page: Page, runs: Runs, colors: Mapping[str, str]) -> None:
    """Maps beside the floor plan, a picture for each recording."""
    page.section(
        "Maps", "Floor plan where the simulated recording knows it, and SLAM's maps, all in the truth's frame."
    )
    for recording, folders in runs.items():
        first = next(iter(folders.values()))
        plan, truth = first.scans.get("truth/floor_plan"), _truth(first)
        path = truth.positions_xyz[:, :2]
        columns = min(1 + len(folders), 4)
        figure, axes = canvas(columns, -(-(1 + len(folders)) // columns), height=3.0)
        low, high = path.min(axis=0) - 5, path.max(axis=0) + 5
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, method in zip(axes.flat, [None, *folders], strict=False):
            axis.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
            axis.set_title(method or "floor plan", parse_math=False)
            if plan is not None:
                axis.plot(*walls(plan).T, color=INK, lw=0.4 if method else 0.8, alpha=0.9)
            if method:
                grid = folders[method].map
                assert grid is not None  # `radarize run` makes one
                turn, shift = fitted(trajectory(*folders[method].trajectory), truth)
                cells = grid.centers(grid.occupied) @ turn[:2, :2].T + shift[:2]
                axis.plot(*cells.T, ",", color=colors[method])
        axes.flat[0].plot(*path.T, color=COLORS["good"], lw=1)
        page.picture(figure, recording)


def _spread(count: int, most: int) -> np.ndarray:
    """Indices of some of so many from the first to the last."""
    return np.linspace(0, count - 1, min(most, count)).astype(int)
