"""What a benchmark's page shows below its tables: trajectories, maps beside the floor plan, distributions of errors."""

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from radarize.benchmark.benchmark import Study
from radarize.benchmark.runs import Pair, Run
from radarize.evaluation.drawings import canvas
from radarize.evaluation.evaluate import trajectories
from radarize.evaluation.page import COLORS, INK, Page
from radarize.evaluation.trajectory import alignment, matched, moved, planar, trajectory
from radarize.runfolder import RunFolder

#: Recordings whose maps are shown, and poses of a trajectory that are drawn.
_MAPS, _POSES = 4, 240


def draw_odometry(study: Study, page: Page) -> None:
    """Trajectories and errors of odometry."""
    names = {pair: pair.odometry for pair in study.pairs}
    _trajectories(study, page, "odometry", names)
    _distributions(study, page, "odometry", names)


def draw_slam(study: Study, page: Page) -> None:
    """Trajectories, errors and maps of SLAM."""
    names = {pair: str(pair) for pair in study.pairs}
    _trajectories(study, page, "slam", names)
    _distributions(study, page, "slam", names)
    _maps(study, page, names)


def draw_maps(study: Study, page: Page) -> None:
    """Maps and errors of SLAM."""
    names = {pair: pair.scans for pair in study.pairs}
    _maps(study, page, names)
    _distributions(study, page, "slam", names)


def _trajectories(study: Study, page: Page, which: str, names: dict[Pair, str]) -> None:
    """All methods' trajectories of a recording on the truth; a menu chooses the recording, a click hides a method."""
    runs = {pair: {run.case: run for run in study.once(pair)} for pair in names}
    cases = list(dict.fromkeys(case for found in runs.values() for case in found))
    if not cases:
        return
    page.section(
        "Trajectories",
        "From above, each laid upon the truth. The menu chooses a recording; click a name to hide or show a method.",
    )
    figure, owners = go.Figure(), []
    for case in cases:
        drawn = [(pair, run) for pair, found in runs.items() if (run := found.get(case))]
        reference = trajectory(*RunFolder(study.output / drawn[0][1].place).reference)
        _line(figure, planar(reference).positions_xyz, "truth", COLORS["good"], case is cases[0], dash="dot")
        owners.append(case)
        for pair, run in drawn:
            estimate, truth = map(planar, matched(trajectories(RunFolder(study.output / run.place))[which], reference))
            path = moved(estimate, *alignment(estimate, truth, in_plane=True)).positions_xyz
            _line(figure, path, names[pair], _color(study, pair), case is cases[0])
            owners.append(case)
    buttons = [
        {"label": case.name, "method": "restyle", "args": [{"visible": [owner is case for owner in owners]}]}
        for case in cases
    ]
    figure.update_layout(updatemenus=[{"buttons": buttons, "x": 1.02, "xanchor": "left", "y": 1, "yanchor": "top"}])
    figure.update_xaxes(title="x, m", constrain="domain")
    figure.update_yaxes(title="y, m", scaleanchor="x")
    page.plot(figure, height=640)


def _line(figure: go.Figure, positions: np.ndarray, name: str, color: str, shown: bool, dash: str = "solid") -> None:
    some = positions[np.linspace(0, len(positions) - 1, min(_POSES, len(positions))).astype(int)]
    x, y = (np.round(some[:, axis], 3).tolist() for axis in (0, 1))
    style = {"color": color, "width": 2, "dash": dash}
    figure.add_scatter(x=x, y=y, name=name, mode="lines", line=style, visible=shown)


#: Lines of other methods than ours, told apart on light and dark ground.
_OTHERS = (
    "#2a7fd4",
    "#9a6fd0",
    "#c2881c",
    "#1f9e9e",
    "#c04f8a",
    "#7d8590",
    "#6d8f2e",
    "#8a5a3c",
    "#5b6ee1",
    "#d98fb0",
    "#4f9d69",
    "#b5651d",
    "#3f6f8f",
    "#a3a33b",
)


def _color(study: Study, pair: Pair) -> str:
    """One and the same in all plots of a page."""
    return COLORS["slam"] if pair == study.chosen.partner else _OTHERS[study.pairs.index(pair) % len(_OTHERS)]


def _distributions(study: Study, page: Page, which: str, names: dict[Pair, str]) -> None:
    """Share of poses within an error, and errors of recordings."""
    page.section(
        "Errors",
        "Share of all poses, every recording alike, whose position is off by no more than that, after alignment; and "
        "the mean error of each recording (dots).",
    )
    shares, boxes = go.Figure(), go.Figure()
    for pair, name in names.items():
        runs = study.once(pair)
        if not runs:
            continue
        style = {"color": _color(study, pair), "width": 2}
        errors = np.sort(np.concatenate([study.results[run]["quantiles"][which] for run in runs]))
        some = np.linspace(0, len(errors) - 1, min(200, len(errors))).astype(int)
        shares.add_scatter(
            x=errors[some].round(4).tolist(), y=((some + 1) / len(errors)).round(4).tolist(), name=name, line=style,
            mode="lines",
        )  # fmt: skip
        means = [study.results[run][which]["ate"]["position"]["mean"] for run in runs]
        boxes.add_box(
            y=means, name=name, boxpoints="all", marker={"color": style["color"]}, text=[run.case.name for run in runs]
        )
    if shares.data:
        shares.update_xaxes(title="position error, m", rangemode="tozero")
        shares.update_yaxes(title="share of poses", range=[0, 1])
        page.plot(shares)
        boxes.update_yaxes(title="mean position error, m", rangemode="tozero")
        boxes.update_layout(showlegend=False)
        page.plot(boxes)


def _maps(study: Study, page: Page, names: dict[Pair, str]) -> None:
    """Maps beside the floor plan, a row a recording."""
    runs = {pair: {run.case: run for run in study.once(pair)} for pair in names}
    runs = {pair: found for pair, found in runs.items() if found}
    cases = list(dict.fromkeys(case for found in runs.values() for case in found))[:_MAPS]
    if not cases:
        return
    page.section(
        "Maps", "Floor plan where the simulated recording knows it, and SLAM's maps, all in the truth's frame."
    )
    for case in cases:
        drawn = [(pair, found[case]) for pair, found in runs.items() if case in found]
        page.picture(_row(study, drawn, names), case.name)


def _row(study: Study, drawn: Sequence[tuple[Pair, Run]], names: dict[Pair, str]):
    columns = min(len(drawn) + 1, 4)
    rows = -(-(len(drawn) + 1) // columns)
    figure, axes = canvas(columns, rows, height=3.0)
    first = RunFolder(study.output / drawn[0][1].place)
    plan, reference = first.scans.get("truth/floor_plan"), trajectory(*first.reference)
    path = planar(reference).positions_xyz
    low, high = path[:, :2].min(axis=0) - 5, path[:, :2].max(axis=0) + 5
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, title in zip(axes.flat, ["floor plan", *(names[pair] for pair, _ in drawn)], strict=False):
        axis.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axis.set_title(title)
        if plan is not None:
            axis.plot(*_segments(plan), color=INK, lw=0.8 if title == "floor plan" else 0.4, alpha=0.9)
    axes.flat[0].plot(path[:, 0], path[:, 1], color=COLORS["good"], lw=1)
    for axis, (pair, run) in zip(axes.flat[1:], drawn, strict=False):
        x, y = _cells(RunFolder(study.output / run.place), reference)
        axis.plot(x, y, ",", color=COLORS["slam"] if pair == study.chosen.partner else COLORS["odometry"])
    return figure


def _segments(plan: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.column_stack([plan[:, i], plan[:, i + 2], np.full(len(plan), np.nan)]).ravel() for i in (0, 1))


def _cells(run: RunFolder, reference) -> tuple[np.ndarray, np.ndarray]:
    """Occupied cells in the truth's frame."""
    estimate, truth = map(planar, matched(trajectory(*run.trajectory), reference))
    turn, shift = alignment(estimate, truth, in_plane=True)
    grid = run.map
    cells = grid.centers(grid.occupied)
    return tuple((np.column_stack([cells, np.zeros(len(cells))]) @ turn.T + shift)[:, :2].T)
