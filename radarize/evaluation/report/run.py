"""A run as a page: errors against the truth, map, velocities, heat maps, and all that is needed to repeat it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from radarize.evaluation.evaluate import evaluate, trajectories, trajectory_errors
from radarize.evaluation.metrics import TrajectoryErrors
from radarize.evaluation.report import words
from radarize.evaluation.report.drawings import canvas, draw_doppler, draw_fan, draw_scan
from radarize.evaluation.report.page import COLORS, INK, Page
from radarize.evaluation.report.plots import band, from_above, line, panels, shade, walls
from radarize.io.errors import InputError
from radarize.pipeline.runfolder import RunFolder, Scans

#: Frames whose heat maps are shown.
_FRAMES = 4
_NAMES = {"slam": "SLAM", "odometry": "odometry"}


def report_run(run: Path, output: Path | None = None, beside: Sequence[Path] = ()) -> Path:
    """Draw a run, with its errors where it knows the truth. Nothing but the page is written.

    Args:
        output: file to write; by default ``report.html`` in the folder.
        beside: other runs of the same recording, to compare with.

    Raises:
        InputError: not a run, or a damaged one.
    """
    folder, others = RunFolder(run), [RunFolder(other) for other in beside]
    errors = trajectory_errors(folder) if folder.has("reference.tum") else {}
    metrics = evaluate(folder, errors=errors) if errors else {}
    blind = folder.unobservable_spans

    page = Page(f"Run {folder.path.resolve().name}", _about(folder, errors))
    if errors:
        _result(page, metrics)
    for sentence in folder.warnings:
        page.text(f"Warning: {sentence}.")
    if blind:
        sentence, table = words.blindness(blind)
        page.text(sentence)
        if table.rows and not folder.health:  # of a version that gave no advice
            page.table(*table, sortable=True)
    if folder.health:
        page.table(*words.health(folder.health), sortable=True)
    if errors and others:
        page.section("Beside other methods", "The same recording; odometry and SLAM against the truth.")
        rows = [(methods(folder), metrics), *((methods(other), evaluate(other)) for other in others)]
        page.table(*words.beside(rows), sortable=True)
    _plan(page, folder, errors, others)
    spans = blind.spans if blind else []
    start = folder.trajectory[0][0]
    if errors:
        _over_time(page, errors, start, spans)
    if "velocity" in folder.scans:
        _velocities(page, folder.scans, start, spans)
    if "heatmaps/frames" in folder.scans:
        _heatmaps(page, folder.scans)
    _settings(page, folder.facts)
    return page.write(Path(output) if output else folder.path / "report.html")


def methods(run: RunFolder) -> str:
    """What a run was made with, in short."""
    told = ("odometry", "scans", "frames")
    return " + ".join(run.methods[name] for name in told if name in run.methods) or run.path.name


def _about(run: RunFolder, errors: dict[str, TrajectoryErrors]) -> str:
    parts = [f"Radar-only SLAM on {run.facts['recording']}" if "recording" in run.facts else "Radar-only SLAM"]
    if errors:
        parts.append(f"{errors['slam'].distance:.1f} m in {errors['slam'].duration:.0f} s")
    if run.methods:
        parts.append(", ".join(f"{name} {value}" for name, value in run.methods.items()))
    return " · ".join(parts)


def _result(page: Page, metrics: dict) -> None:
    slam = metrics["slam"]["ate"]
    cards = [(f"{slam['position']['mean']:.2f} m", "mean position error of SLAM (ATE)")]
    if "odometry" in metrics:
        own = metrics["odometry"]["ate"]["position"]["mean"]
        cards.append((f"{own:.2f} m", "mean position error of odometry alone"))
    cards.append((f"{np.degrees(slam['rotation']['mean']):.1f}°", "mean heading error of SLAM"))
    if metrics.get("map", {}).get("f1") is not None:
        cards.append((f"{100 * metrics['map']['f1']:.0f} %", "agreement of map and visible walls (F1 at 10 cm)"))
    page.section("Result")
    page.headline(cards)
    page.table(*words.trajectories(metrics))
    page.columns(
        {table.head[0]: {row[0]: row[1] for row in table.rows} for table in words.parts(metrics)}, numbers=(1,)
    )


def _plan(page: Page, run: RunFolder, errors: dict[str, TrajectoryErrors], beside: Sequence[RunFolder]) -> None:
    """Trajectories, map and floor plan from above, in the truth's frame if there is one."""
    page.section(
        "Trajectory and map",
        "From above, one metre is one metre both ways. Click a name to hide or show it."
        + (" Each trajectory is laid upon the truth, the map along with SLAM's." if errors else ""),
    )
    figure = from_above()
    turn, shift = (errors["slam"].turn, errors["slam"].shift) if errors else (np.eye(3), np.zeros(3))
    if errors and "truth/floor_plan" in run.scans:
        line(figure, walls(run.scans["truth/floor_plan"]), "floor plan", COLORS["truth"], 1.2)
    if (grid := run.map) is not None:
        cells = grid.centers(grid.occupied) @ turn[:2, :2].T + shift[:2]
        marker = {"color": COLORS["map"], "size": 3, "symbol": "square"}
        line(figure, cells, "map", COLORS["map"], mode="markers", marker=marker)
    for name, path in trajectories(run).items():
        path = errors[name].estimate if errors else path
        line(figure, path.positions_xyz, _NAMES[name], COLORS[name], 2.4)
    if errors:
        for other in beside:
            path = trajectory_errors(other)["odometry"].estimate.positions_xyz
            line(figure, path, f"odometry {methods(other)}", INK, 2.4, dash="dash")
        line(figure, errors["slam"].reference.positions_xyz, "truth", COLORS["good"], 2.4, dash="dot")
    page.plot(figure, height=640)


def _over_time(page: Page, errors: dict[str, TrajectoryErrors], start: float, spans: Sequence) -> None:
    page.section(
        "Error over time",
        "Distance to the truth and difference of heading, after alignment."
        + (" Shaded: odometry was blind." if spans else ""),
    )
    figure = panels("position, m", "heading, deg")
    for name, item in errors.items():
        time, degrees = item.time - start, np.degrees(item.rotation_errors)
        line(figure, (time, item.position_errors), _NAMES[name], COLORS[name])
        line(figure, (time, degrees), _NAMES[name], COLORS[name], row=2)
    figure.update_yaxes(rangemode="tozero")
    shade(figure, spans)
    page.plot(figure, height=440)


def _velocities(page: Page, scans: Scans, start: float, spans: Sequence) -> None:
    true, covariance = scans.get("truth/velocity"), scans.get("velocity_covariance")
    page.section(
        "Velocity",
        "Estimated from single frames" + (", against the truth." if true is not None else ".")
        + (" The band is two standard deviations." if covariance is not None else "")
        + (" Shaded: odometry was blind." if spans else ""),
    )  # fmt: skip
    figure = panels("forward, m/s", "left, m/s")
    time = scans["time"] - start
    for k, estimate in enumerate(scans["velocity"].T[:2]):
        shown = estimate
        if covariance is not None:
            spread = 2 * np.sqrt(np.maximum(covariance[:, k, k], 0))
            band(figure, time, estimate - spread, estimate + spread, "±2σ", row=k + 1)
        if true is not None:
            line(figure, (time, true[:, k]), "truth", INK, 2.2, row=k + 1)
            shown = np.concatenate([estimate, true[:, k]])
        line(figure, (time, estimate), "estimate", COLORS["slam"], 1.3, row=k + 1)
        if np.isfinite(shown).any():
            # A few outliers must not flatten the rest.
            low, high = np.nanpercentile(np.where(np.isfinite(shown), shown, np.nan), [0.5, 99.5])
            margin = 0.15 * (high - low) + 0.05
            figure.update_yaxes(range=[low - margin, high + margin], row=k + 1, col=1)
    shade(figure, spans)
    page.plot(figure, height=440)


def _heatmaps(page: Page, scans: Scans) -> None:
    true_velocity = scans.get("truth/velocity")
    page.section(
        "Heat maps and scans",
        "Left: range and azimuth from above, with the scan that was made of it (rings) on the true surfaces (dots). "
        "Middle: the same from antenna pairs that pass the horizon and weaken ceiling and floor. Right: closing speed "
        "over azimuth; a static world lies on the dashed ridge v cos(φ − θ) of the "
        f"{'estimated' if true_velocity is None else 'true'} velocity. dB below the strongest cell.",
    )
    ranges, azimuths = scans["heatmaps/ranges"], scans["heatmaps/azimuths"]
    fans = {"range_azimuth": "range-azimuth", "elevation_aware": "elevation aware"}
    kinds = [name for name in (*fans, "doppler_azimuth") if f"heatmaps/{name}" in scans]
    speeds = scans.get("velocity") if true_velocity is None else true_velocity
    frames = np.asarray(scans["heatmaps/frames"], int)
    for index in np.unique(np.linspace(0, len(frames) - 1, min(_FRAMES, len(frames))).astype(int)):
        frame = frames[index]
        if not 0 <= frame < len(scans["time"]):
            raise InputError(f"scans.h5: /heatmaps/frames holds {frame}, expected an index into /time")
        figure, axes = canvas(len(kinds))
        for axis, kind in zip(axes[0], kinds, strict=True):
            power = scans[f"heatmaps/{kind}"][index]
            if kind in fans:
                draw_fan(axis, power, ranges, azimuths, fans[kind])
            else:
                velocity = None if speeds is None else speeds[frame, :2]
                draw_doppler(axis, power, scans["heatmaps/velocities"], azimuths, "Doppler-azimuth", velocity)
            if kind == "range_azimuth":
                if "truth/scan" in scans:
                    draw_scan(axis, scans["truth/scan_azimuths"], scans["truth/scan"][frame], "truth", "truth")
                draw_scan(axis, scans["azimuths"], scans["ranges"][frame], "measured", "scan")
        page.picture(figure, f"Frame {frame}, {scans['time'][frame] - scans['time'][0]:.2f} s after the start")


def _settings(page: Page, facts: dict) -> None:
    page.section("Settings, versions, timings", "Everything needed to repeat this run.")
    timings = facts.get("ms_per_frame")
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
