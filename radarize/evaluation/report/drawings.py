"""Drawings of heat maps and scans with matplotlib, on a transparent background and in neutral colours."""

from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarize.evaluation.report.page import COLORS, INK

if TYPE_CHECKING:  # matplotlib 3.10 has no such name yet
    from matplotlib.typing import RcKeyType

_STYLE: "dict[RcKeyType, object]" = {
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.titlesize": 10,
    "font.size": 9,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
#: Dynamic range of heat maps below the strongest cell, dB; range within which transmitter leakage can be stronger, m.
DEPTH, LEAKAGE = 45.0, 0.25
_MAP = "magma"


def canvas(columns: int, rows: int = 1, width: float = 11.0, height: float = 2.6) -> tuple[Figure, np.ndarray]:
    """Return a figure in the page's style, and its axes as an array (rows, columns). It does not use pyplot, so a
    notebook keeps its own figures and backend."""
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width, height * rows), layout="constrained")
        return figure, figure.subplots(rows, columns, squeeze=False)


def decibels(power: np.ndarray, reference: float | None = None) -> np.ndarray:
    """Convert power to dB relative to a reference, or to its maximum."""
    power = np.asarray(power, float)
    top = reference if reference else np.nanmax(power, initial=0.0)
    return 10 * np.log10(np.maximum(power, top * 10 ** (-DEPTH / 10 - 2)) / top) if top > 0 else np.zeros(power.shape)


def _relative_to_echoes(power: Float[np.ndarray, "range other"], ranges: Float[np.ndarray, "range"]) -> np.ndarray:
    """Convert power to dB relative to the maximum beyond the leakage."""
    far = ranges >= LEAKAGE
    return decibels(power, np.nanmax(power[far], initial=0.0) if far.any() else None)


def draw_fan(
    axis: Axes,
    power: Float[np.ndarray, "range azimuth"],
    ranges: Float[np.ndarray, "range"],
    azimuths: Float[np.ndarray, "azimuth"],
    title: str,
    reach: float | None = None,
) -> None:
    """Draw range-azimuth power from above: forward is up, left is left."""
    level = _relative_to_echoes(power, ranges)
    edges_r, edges_a = _edges(ranges), _edges(azimuths)
    x, y = -edges_r[:, None] * np.sin(edges_a), edges_r[:, None] * np.cos(edges_a)
    _draw_cells(axis, x, y, level)
    reach = reach or ranges[-1]
    half = reach * np.sin(min(np.abs(azimuths).max(), np.pi / 2))
    axis.set(aspect="equal", title=title, xlim=(-half, half), ylim=(0, reach))
    axis.set(xlabel="to the right, m", ylabel="forward, m")


def draw_doppler(
    axis: Axes,
    power: Float[np.ndarray, "doppler azimuth"],
    velocities: Float[np.ndarray, "doppler"],
    azimuths: Float[np.ndarray, "azimuth"],
    title: str,
    velocity: Float[np.ndarray, "2"] | None = None,
) -> None:
    """Draw Doppler-azimuth power; left is left. `velocity` (forward, left; m/s) adds the ridge v cos(phi - theta)."""
    x, y = -np.degrees(_edges(azimuths)), _edges(velocities)
    _draw_cells(axis, x, y, decibels(power))
    if velocity is not None and np.isfinite(velocity).all():
        closing = velocity[0] * np.cos(azimuths) + velocity[1] * np.sin(azimuths)
        span = velocities[-1] - velocities[0] + velocities[1] - velocities[0] if len(velocities) > 1 else np.inf
        wrapped = (closing - velocities[0]) % span + velocities[0]
        wrapped[np.abs(np.diff(wrapped, prepend=wrapped[0])) > span / 2] = np.nan
        axis.plot(-np.degrees(azimuths), wrapped, "--", color="#39d0d8", lw=1.4, label="v cos(φ − θ)")
        axis.legend(loc="lower left", frameon=False, labelcolor="w", fontsize=8)
    ticks = np.arange(-60, 61, 30)
    axis.set(title=title, xlabel="azimuth, deg (left is positive)", ylabel="closing speed, m/s")
    axis.set_xticks(-ticks, ticks)
    axis.set_xlim(-np.degrees(azimuths[-1]), -np.degrees(azimuths[0]))
    axis.set_box_aspect(0.6)  # about that of a fan, so that a row of pictures is one


def draw_range_doppler(
    axis: Axes,
    power: Float[np.ndarray, "range doppler"],
    ranges: Float[np.ndarray, "range"],
    velocities: Float[np.ndarray, "doppler"],
    title: str,
) -> None:
    """Draw range-Doppler power; closing speeds are to the right."""
    _draw_cells(axis, _edges(velocities), _edges(ranges), _relative_to_echoes(power, ranges))
    axis.set(title=title, xlabel="closing speed, m/s", ylabel="range, m")


def draw_scan(axis: Axes, azimuths: np.ndarray, ranges: np.ndarray, kind: str, label: str) -> None:
    """Draw the end points of a scan in the axes of `draw_fan`: ``"truth"`` as small dots, else as rings."""
    hit = np.isfinite(ranges) & (ranges > 0)
    x, y = -ranges[hit] * np.sin(azimuths[hit]), ranges[hit] * np.cos(azimuths[hit])
    if kind == "truth":
        axis.plot(x, y, ".", color="#39d0d8", ms=2.2, label=label)
    else:
        axis.plot(x, y, "o", mfc="none", mec=COLORS["good"], mew=1.0, ms=4, label=label)


def draw_profiles(axis: Axes, times: np.ndarray, ranges: np.ndarray, power: Float[np.ndarray, "time range"]) -> None:
    """Draw range profiles over time."""
    far = ranges >= LEAKAGE
    level = decibels(power, power[:, far].max() if far.any() and power.size else None)
    _draw_cells(axis, _edges(times), _edges(ranges), level.T)
    axis.set(xlabel="time, s", ylabel="range, m")


def _edges(values: np.ndarray) -> np.ndarray:
    """Return cell edges from evenly or unevenly spaced cell centres."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    inner = (values[1:] + values[:-1]) / 2
    return np.concatenate([[2 * values[0] - inner[0]], inner, [2 * values[-1] - inner[-1]]])


def _draw_cells(axis: Axes, x: np.ndarray, y: np.ndarray, level: np.ndarray) -> None:
    """Draw cells of a level in dB between edges, with a colour bar."""
    drawn = axis.pcolormesh(x, y, level, cmap=_MAP, vmin=-DEPTH, vmax=0, rasterized=True)
    bar = axis.figure.colorbar(drawn, ax=axis, pad=0.02, aspect=28)
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=7, color=INK, labelcolor=INK)
    bar.set_label("dB", color=INK, fontsize=8)
