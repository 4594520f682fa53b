"""Comparison of runs of several methods on a page: trajectories, distributions of errors, maps.

Runs are folders by recording and method; `colors` has a colour for each method.
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

#: Maximum number of drawn poses of a trajectory, and of points of a distribution.
_POSES, _ERRORS = 240, 200
Runs = Mapping[str, Mapping[str, RunFolder]]


def _truth(run: RunFolder) -> PoseTrajectory3D:
    assert run.reference is not None  # compared runs have been evaluated
    return trajectory(*run.reference)


def draw_trajectories(page: Page, runs: Runs, colors: Mapping[str, str], which: str) -> None:
    """Draw trajectories (``odometry`` or ``slam``) from above, aligned with the truth, one recording at a time."""
    page.section(
        "Trajectories",
        "Trajectories from above, each aligned with the truth. Select a recording in the menu; click a name to hide or "
        "show a method.",
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
    """Draw the cumulative distribution of position errors, and the mean error of each recording.

    Args:
        page: page to extend.
        errors: position errors by method and recording, m: quantiles, equally many for each recording, and the mean.
        colors: colour of each method.
    """
    page.section(
        "Errors",
        "Cumulative distribution of the position error after alignment, where all recordings have the same weight; and "
        "the mean position error of each recording (dots).",
    )
    shares = panels("cumulative share of poses", x="position error, m")
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
    """Draw maps beside the floor plan, one picture for each recording."""
    page.section("Maps", "Floor plan of a simulated recording, and occupied cells of the SLAM maps, in the true frame.")
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
    """Return at most a number of indices, evenly spaced from the first to the last."""
    return np.linspace(0, count - 1, min(most, count)).astype(int)
