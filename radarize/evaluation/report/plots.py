"""Interactive plots over time and from above. Names in them are escaped, because plotly interprets markup."""

from collections.abc import Iterable
from html import escape

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from radarize.evaluation.report.page import COLORS, INK
from radarize.odometry.observability import Span


def panels(*labels: str, x: str = "time, s") -> go.Figure:
    """Return a figure with one row of axes for each label of an ordinate, with a common abscissa."""
    figure = make_subplots(rows=len(labels), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, label in enumerate(labels, 1):
        figure.update_yaxes(title=label, row=row, col=1)
    figure.update_xaxes(title=x, row=len(labels), col=1)
    return figure


def from_above() -> go.Figure:
    """Return a figure with x and y axes of equal scale, m."""
    figure = panels("y, m", x="x, m")
    figure.update_xaxes(constrain="domain")
    figure.update_yaxes(scaleanchor="x")
    return figure


def plain(name: str) -> str:
    """Escape a name, so that plotly shows it unchanged."""
    return escape(name)


def line(
    figure: go.Figure,
    points: Float[np.ndarray, "point column"] | tuple[np.ndarray, np.ndarray],
    name: str,
    color: str,
    width: float = 2.0,
    row: int = 1,
    **style: object,
) -> None:
    """Draw a line through points (x and y per point, or all x and all y), with gaps at values that are not finite.

    Lines of the same name in several rows have one entry in the legend. `style` is passed to plotly.
    """
    x, y = points if isinstance(points, tuple) else points.T[:2]
    name = plain(name)
    stroke = {"color": color, "width": width, "dash": style.pop("dash", "solid")}
    style = {"showlegend": all(trace.name != name for trace in figure.data), "mode": "lines", "line": stroke} | style
    # Single precision is enough for a picture, and keeps the page small.
    figure.add_scatter(x=np.float32(x), y=np.float32(y), name=name, legendgroup=name, row=row, col=1, **style)


def walls(plan: Float[np.ndarray, "segment 4"]) -> Float[np.ndarray, "point 2"]:
    """Convert a floor plan of segments (x0 y0 x1 y1) to one line with gaps."""
    ends = np.full((len(plan), 3, 2), np.nan)
    ends[:, :2] = np.reshape(plan, (-1, 2, 2))
    return ends.reshape(-1, 2)


def band(figure: go.Figure, x: np.ndarray, low: np.ndarray, high: np.ndarray, name: str, row: int) -> None:
    """Fill the area between two lines, in the colour of SLAM."""
    around = np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]])
    fill = {"fill": "toself", "fillcolor": "rgba(42,127,212,0.16)", "hoverinfo": "skip"}
    line(figure, around, name, COLORS["slam"], 0, row, **fill)


def shade(figure: go.Figure, spans: Iterable[Span]) -> None:
    """Shade spans in which motion was unobservable; the abscissa is time since the first pose, s."""
    for span in spans:
        figure.add_vrect(x0=span.start_s, x1=span.stop_s, fillcolor=INK, opacity=0.22, line_width=0)
