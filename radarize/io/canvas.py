"""Matplotlib axes where none are given, and PNG pictures for notebooks."""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Dots per inch of a notebook's pictures.
_DPI = 90


def axes_or_new(axes: "Axes | None" = None) -> "Axes":
    """The given axes, or those of a new figure of pyplot."""
    if axes is None:
        import matplotlib.pyplot as plt

        _, axes = plt.subplots(layout="constrained")
    return axes


def png(plot: Callable[["Axes"], object]) -> bytes:
    """What a function draws on axes, as a PNG; pyplot knows nothing of it."""
    from matplotlib.figure import Figure

    figure, buffer = Figure(layout="constrained"), io.BytesIO()
    plot(figure.add_subplot())
    figure.savefig(buffer, format="png", dpi=_DPI)
    return buffer.getvalue()
