"""Matplotlib axes, created if none are given, and PNG images for notebooks."""

import io
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Dots per inch of images in notebooks.
_DPI = 90


def axes_or_new(axes: "Axes | None" = None) -> "Axes":
    """Return the given axes, or those of a new pyplot figure."""
    if axes is None:
        import matplotlib.pyplot as plt

        _, axes = plt.subplots(layout="constrained")
    return axes


def png(plot: Callable[["Axes"], object]) -> bytes:
    """Return what a function draws on axes as a PNG; the figure is not registered with pyplot."""
    from matplotlib.figure import Figure

    figure, buffer = Figure(layout="constrained"), io.BytesIO()
    plot(figure.add_subplot())
    figure.savefig(buffer, format="png", dpi=_DPI)
    return buffer.getvalue()
