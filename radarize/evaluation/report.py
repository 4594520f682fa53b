"""Reports: a run against the truth, or whatever a recording holds, as one HTML page that opens without a network."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from radarize.errors import InputError
from radarize.evaluation import comparison
from radarize.evaluation.drawings import canvas, draw_doppler, draw_fan, draw_scan
from radarize.evaluation.evaluate import (
    MAP_WORDS,
    SCAN_WORDS,
    VELOCITY_WORDS,
    evaluate,
    trajectories,
    trajectory_errors,
)
from radarize.evaluation.metrics import TrajectoryErrors
from radarize.evaluation.page import COLORS, INK, Page
from radarize.evaluation.recording_report import report_recording
from radarize.evaluation.trajectory import moved
from radarize.runfolder import RunFolder, Scans

__all__ = ["report_recording", "report_run"]

#: Frames whose heat maps are shown.
_FRAMES = 4
_NAMES = {"slam": "SLAM", "odometry": "odometry"}


def report_run(run: Path, output: Path | None = None, beside: Sequence[Path] = ()) -> Path:
    """Draw a run as ``report.html``; it is evaluated first where it knows the truth.

    Args:
        run: folder of a run.
        output: file to write; by default ``report.html`` in the folder.
        beside: other runs of the same recording, to compare with.

    Returns:
        The page's path.

    Raises:
        InputError: not a run, or a damaged one.
    """
    folder = RunFolder(run)
    scans, others = folder.scans, [RunFolder(other) for other in beside]
    errors = trajectory_errors(folder) if folder.has("reference.tum") else {}
    metrics = evaluate(folder) if errors else {}

    page = Page(f"Run {folder.path.resolve().name}", _about(folder, errors))
    if errors:
        _figures(page, metrics, errors)
    if errors and beside:
        page.section("Beside other methods", "The same recording; odometry and SLAM against the truth.")
        heads = ("method", *(name for name, *_ in comparison.COLUMNS))
        page.table(heads, comparison.compare([run, *beside]), numbers=tuple(range(1, len(heads))))
    _plan(page, folder, errors, others)
    if errors:
        _over_time(page, errors)
    if "velocity" in scans:
        _velocities(page, scans, metrics.get("velocity"))
    if "heatmaps/frames" in scans:
        _heatmaps(page, scans, metrics.get("scans"))
    _settings(page, folder.facts)
    return page.write(Path(output) if output else folder.path / "report.html")


def _about(run: RunFolder, errors: dict[str, TrajectoryErrors]) -> str:
    facts = run.facts
    parts = [f"Radar-only SLAM on {facts['recording']}" if "recording" in facts else "Radar-only SLAM"]
    if errors:
        best = errors["slam"]
        parts.append(f"{best.distance:.1f} m in {best.duration:.0f} s")
    if run.methods:
        parts.append(", ".join(f"{name} {value}" for name, value in run.methods.items()))
    return " · ".join(parts)


def _figures(page: Page, metrics: dict, errors: dict[str, TrajectoryErrors]) -> None:
    slam = errors["slam"]
    cards = [(f"{slam.position.mean:.2f} m", "mean position error of SLAM (ATE)")]
    if "odometry" in errors:
        cards.append((f"{errors['odometry'].position.mean:.2f} m", "mean position error of odometry alone"))
    cards.append((f"{np.degrees(slam.rotation.mean):.1f}°", "mean heading error of SLAM"))
    if metrics.get("map", {}).get("f1") is not None:
        cards.append((f"{100 * metrics['map']['f1']:.0f} %", "agreement of map and visible walls (F1 at 10 cm)"))
    page.section("Result")
    page.headline(cards)

    names = [name for name in ("odometry", "slam") if name in errors]
    rows = []

    def row(label: str, text, meaning: str) -> None:
        values = [text(errors[name]) for name in names]
        rows.append((label, *("–" if "nan" in value else value for value in values), meaning))

    row("position error, mean", lambda e: f"{e.position.mean:.3f} m", "distance to the truth after laying both "
        "trajectories upon each other")  # fmt: skip
    row("position error, rms / worst", lambda e: f"{e.position.rmse:.3f} / {e.position.max:.3f} m", "")
    row("heading error, mean", lambda e: f"{e.rotation.mean:.3f} rad", "")
    row("share of the way", lambda e: f"{100 * e.share:.2f} %", "mean position error over distance travelled")
    row("end drift", lambda e: f"{100 * e.drift:.2f} %", "how far the ends are apart if the starts agree")
    for name, words in {"frame": "one frame", "second": "one second", "metre": "one metre"}.items():
        row(
            f"error over {words}",
            lambda e, n=name: f"{e.relative_position[n].mean:.4f} m, {e.relative_rotation[n].mean:.4f} rad",
            "mean relative error, no alignment" if name == "frame" else "",
        )
    page.table(("", *(_NAMES[name] for name in names), "what it means"), rows, numbers=tuple(range(1, 1 + len(names))))
    for name, title, words in (("map", "Map", MAP_WORDS), ("scans", "Scans", SCAN_WORDS)):
        if name in metrics:
            _words(page, title, metrics[name], words)


def _words(page: Page, title: str, content: dict, words: dict) -> None:
    rows = [
        (label, "–" if content.get(key) is None else f"{factor * content[key]:.3g} {unit}".strip())
        for key, (label, unit, factor) in words.items()
        if key in content
    ]
    page.table((title, ""), rows, numbers=(1,))


def _plan(page: Page, run: RunFolder, errors: dict[str, TrajectoryErrors], beside: Sequence[RunFolder]) -> None:
    """Trajectories, map and floor plan from above, in the truth's frame if there is one."""
    page.section(
        "Trajectory and map",
        "From above, one metre is one metre both ways. Click a name to hide or show it."
        + (" Each trajectory is laid upon the truth, the map along with SLAM's." if errors else ""),
    )
    figure = go.Figure()
    turn, shift = (errors["slam"].turn, errors["slam"].shift) if errors else (np.eye(3), np.zeros(3))
    if errors and "truth/floor_plan" in run.scans:
        plan = run.scans["truth/floor_plan"]
        x, y = (np.column_stack([plan[:, i], plan[:, i + 2], np.full(len(plan), np.nan)]).ravel() for i in (0, 1))
        style = {"color": COLORS["truth"], "width": 1.2}
        figure.add_scatter(x=_short(x), y=_short(y), name="floor plan", mode="lines", line=style)
    if (grid := run.map) is not None:
        cells = grid.centers(grid.occupied)
        cells = np.column_stack([cells, np.zeros(len(cells))]) @ turn.T + shift
        marker = {"color": COLORS["map"], "size": 3, "symbol": "square"}
        figure.add_scatter(x=_short(cells[:, 0]), y=_short(cells[:, 1]), name="map", mode="markers", marker=marker)
    if errors:
        for name, item in errors.items():
            _line(figure, item.estimate.positions_xyz, _NAMES[name], COLORS[name])
        for other in beside:
            path = trajectory_errors(other)["odometry"].estimate.positions_xyz
            _line(figure, path, f"odometry {comparison.methods(other)}", INK, dash="dash")
        _line(figure, errors["slam"].reference.positions_xyz, "truth", "#22a06b", dash="dot")
    else:
        for name, path in trajectories(run).items():
            _line(figure, moved(path, turn, shift).positions_xyz, _NAMES[name], COLORS[name])
    figure.update_xaxes(title="x, m", constrain="domain")
    figure.update_yaxes(title="y, m", scaleanchor="x")
    page.plot(figure, height=640)


def _line(figure: go.Figure, positions: np.ndarray, name: str, color: str, dash: str = "solid") -> None:
    style = {"color": color, "width": 2.4, "dash": dash}
    figure.add_scatter(x=_short(positions[:, 0]), y=_short(positions[:, 1]), name=name, mode="lines", line=style)


def _short(values: np.ndarray) -> list[float | None]:
    """Four digits are enough for a picture, and keep the page small."""
    return [None if not np.isfinite(value) else round(float(value), 4) for value in values]


def _over_time(page: Page, errors: dict[str, TrajectoryErrors]) -> None:
    page.section("Error over time", "Distance to the truth and difference of heading, after alignment.")
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for name, item in errors.items():
        time = _short(item.time - item.time[0])
        style = {"line": {"color": COLORS[name], "width": 1.8}, "name": _NAMES[name], "legendgroup": name}
        figure.add_scatter(x=time, y=_short(item.position_errors), **style, row=1, col=1)
        degrees = _short(np.degrees(item.rotation_errors))
        figure.add_scatter(x=time, y=degrees, **style, showlegend=False, row=2, col=1)
    figure.update_yaxes(title="position, m", rangemode="tozero", row=1, col=1)
    figure.update_yaxes(title="heading, deg", rangemode="tozero", row=2, col=1)
    figure.update_xaxes(title="time, s", row=2, col=1)
    page.plot(figure, height=440)


def _velocities(page: Page, scans: Scans, metrics: dict | None) -> None:
    known = "truth/velocity" in scans
    page.section(
        "Velocity",
        "Estimated from single frames" + (", against the truth." if known else ".")
        + (" The band is two standard deviations." if "velocity_covariance" in scans else ""),
    )  # fmt: skip
    figure = make_subplots(rows=2, cols=1, shared_xaxes=True, vertical_spacing=0.06)
    time = scans["time"] - scans["time"][0]
    for row, label in ((1, "forward, m/s"), (2, "left, m/s")):
        column = row - 1
        estimate = scans["velocity"][:, column]
        if "velocity_covariance" in scans:
            spread = 2 * np.sqrt(np.maximum(scans["velocity_covariance"][:, column, column], 0))
            figure.add_scatter(
                x=_short(np.concatenate([time, time[::-1]])),
                y=_short(np.concatenate([estimate + spread, (estimate - spread)[::-1]])),
                fill="toself", fillcolor="rgba(228,87,46,0.16)", line={"width": 0}, hoverinfo="skip",
                name="±2σ", legendgroup="spread", showlegend=row == 1, row=row, col=1,
            )  # fmt: skip
        if known:
            style = {"color": INK, "width": 2.2}
            truth = _short(scans["truth/velocity"][:, column])
            figure.add_scatter(
                x=_short(time), y=truth, name="truth", legendgroup="t", showlegend=row == 1, line=style, row=row, col=1
            )
        style = {"color": COLORS["slam"], "width": 1.3}
        figure.add_scatter(
            x=_short(time), y=_short(estimate), name="estimate", legendgroup="e", showlegend=row == 1, line=style,
            row=row, col=1,
        )  # fmt: skip
        # A few outliers must not flatten the rest.
        shown = np.concatenate([estimate, scans["truth/velocity"][:, column] if known else estimate])
        shown = shown[np.isfinite(shown)]
        if len(shown):
            low, high = np.percentile(shown, [0.5, 99.5])
            margin = 0.15 * (high - low) + 0.05
            figure.update_yaxes(range=[low - margin, high + margin], row=row, col=1)
        figure.update_yaxes(title=label, row=row, col=1)
    figure.update_xaxes(title="time, s", row=2, col=1)
    page.plot(figure, height=440)
    if metrics:
        _words(page, "Error", metrics, VELOCITY_WORDS)


def _heatmaps(page: Page, scans: Scans, metrics: dict | None) -> None:
    page.section(
        "Heat maps and scans",
        "Left: range and azimuth from above, with the scan that was made of it (rings) on the true surfaces (dots). "
        "Middle: the same from antenna pairs that pass the horizon and weaken ceiling and floor. Right: closing speed "
        "over azimuth; a static world lies on the dashed ridge v cos(φ − θ) of the "
        + ("true" if "truth/velocity" in scans else "estimated")
        + " velocity. dB below the strongest cell.",
    )
    ranges, azimuths = scans["heatmaps/ranges"], scans["heatmaps/azimuths"]
    kinds = [name for name in ("range_azimuth", "elevation_aware", "doppler_azimuth") if f"heatmaps/{name}" in scans]
    frames = np.asarray(scans["heatmaps/frames"], int)
    for index in np.unique(np.linspace(0, len(frames) - 1, min(_FRAMES, len(frames))).astype(int)):
        frame = frames[index]
        if not 0 <= frame < len(scans["time"]):
            raise InputError(f"scans.h5: /heatmaps/frames holds {frame}, expected an index into /time")
        figure, axes = canvas(len(kinds))
        for axis, kind in zip(axes[0], kinds, strict=True):
            power = scans[f"heatmaps/{kind}"][index]
            if kind == "doppler_azimuth":
                speeds = scans.get("truth/velocity", scans.get("velocity"))
                velocity = None if speeds is None else speeds[frame, :2]
                draw_doppler(axis, power, scans["heatmaps/velocities"], azimuths, "Doppler-azimuth", velocity)
                continue
            draw_fan(axis, power, ranges, azimuths, kind.replace("_", "-").replace("elevation-a", "elevation a"))
            if kind == "range_azimuth":
                if "truth/scan" in scans:
                    draw_scan(axis, scans["truth/scan_azimuths"], scans["truth/scan"][frame], "truth", "truth")
                draw_scan(axis, scans["azimuths"], scans["ranges"][frame], "measured", "scan")
        time = scans["time"][frame]
        page.picture(figure, f"Frame {frame}, {time - scans['time'][0]:.2f} s after the start")


def _settings(page: Page, facts: dict) -> None:
    page.section("Settings, versions, timings", "Everything needed to repeat this run.")
    timings = facts.get("ms_per_frame") or facts.get("timings")
    if isinstance(timings, dict) and timings:
        rows = [(stage, f"{value:.2f} ms") for stage, value in timings.items()]
        page.table(("time per frame", ""), [*rows, ("sum", f"{sum(timings.values()):.2f} ms")], numbers=(1,))
    plain = {name: value for name, value in facts.items() if not isinstance(value, dict)}
    nested = {
        name.replace("_", " "): value
        for name, value in facts.items()
        if isinstance(value, dict) and value is not timings
    }
    page.columns({"run": plain, **nested})
