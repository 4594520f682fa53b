"""Interactive plots: lines over time and from above. Names in them are data, not the markup that plotly reads."""

from collections.abc import Iterable
from html import escape

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from plotly.subplots import make_subplots

from radarize.evaluation.report.page import COLORS, INK
from radarize.odometry.observability import Span


def panels(*labels: str, x: str = "time, s") -> go.Figure:
    """Axes below each other, one for each label of an ordinate, over the same abscissa."""
    figure = make_subplots(rows=len(labels), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for row, label in enumerate(labels, 1):
        figure.update_yaxes(title=label, row=row, col=1)
    figure.update_xaxes(title=x, row=len(labels), col=1)
    return figure


def from_above() -> go.Figure:
    """Axes on which a metre is a metre both ways."""
    figure = panels("y, m", x="x, m")
    figure.update_xaxes(constrain="domain")
    figure.update_yaxes(scaleanchor="x")
    return figure


def plain(name: str) -> str:
    """A name that plotly shows as it is."""
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
    """A line through points, (x, y) each or all x and all y, with gaps where these are not finite.

    Lines of the same name in several rows have one entry in the legend. `style` is plotly's.
    """
    x, y = points if isinstance(points, tuple) else points.T[:2]
    name = plain(name)
    stroke = {"color": color, "width": width, "dash": style.pop("dash", "solid")}
    style = {"showlegend": all(trace.name != name for trace in figure.data), "mode": "lines", "line": stroke} | style
    # Single precision is enough for a picture, and keeps the page small.
    figure.add_scatter(x=np.float32(x), y=np.float32(y), name=name, legendgroup=name, row=row, col=1, **style)


def walls(plan: Float[np.ndarray, "segment 4"]) -> Float[np.ndarray, "point 2"]:
    """A floor plan (x0 y0 x1 y1) as one line with gaps."""
    ends = np.full((len(plan), 3, 2), np.nan)
    ends[:, :2] = np.reshape(plan, (-1, 2, 2))
    return ends.reshape(-1, 2)


def band(figure: go.Figure, x: np.ndarray, low: np.ndarray, high: np.ndarray, name: str, row: int) -> None:
    """What lies between two lines, filled."""
    around = np.concatenate([x, x[::-1]]), np.concatenate([high, low[::-1]])
    fill = {"fill": "toself", "fillcolor": "rgba(228,87,46,0.16)", "hoverinfo": "skip"}
    line(figure, around, name, COLORS["slam"], 0, row, **fill)


def shade(figure: go.Figure, spans: Iterable[Span]) -> None:
    """Grey where odometry was blind; the abscissa is s since the first frame."""
    for span in spans:
        figure.add_vrect(x0=span.start_s, x1=span.stop_s, fillcolor=INK, opacity=0.22, line_width=0)
