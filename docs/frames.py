"""Draws the coordinate frames of world and sensor: `python -m docs.frames`."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Arc, Rectangle

OUTPUT = Path(__file__).parent / "pictures" / "frames.png"
FORWARD, LEFT, UP, GREY = "#c0392b", "#1e8449", "#1f618d", "0.45"


def arrow(axis: Axes, start: tuple, step: tuple, color: str, label: str, shift: tuple = (0.1, 0.1)) -> None:
    """A labelled arrow; all lengths in m."""
    end = np.add(start, step)
    axis.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2})
    axis.text(*np.add(end, shift), label, color=color, fontsize=11)


def from_above(axis: Axes) -> None:
    """Sensor in the world, an echo at azimuth theta, the velocity at course phi."""
    at, yaw, theta, phi = np.array([2.2, 1.4]), np.radians(35), np.radians(28), np.radians(-20)

    def ahead(angle: float, length: float) -> tuple:
        return tuple(length * np.array([np.cos(angle), np.sin(angle)]))

    arrow(axis, (0, 0), (1.2, 0), GREY, "world x")
    arrow(axis, (0, 0), (0, 1.2), GREY, "world y")
    arrow(axis, at, ahead(yaw, 2.6), FORWARD, "x forward (boresight)")
    arrow(axis, at, ahead(yaw + np.pi / 2, 1.3), LEFT, "y left", (-0.5, 0.12))
    arrow(axis, at, ahead(yaw + phi, 1.6), "black", "velocity v", (0.1, -0.15))
    echo = at + ahead(yaw + theta, 2.7)
    axis.plot(*zip(at, echo, strict=True), ":", color=GREY)
    axis.plot(*echo, "o", color="black")
    axis.text(echo[0] - 0.35, echo[1] + 0.18, "echo", fontsize=11)
    for angle, size, label in ((theta, 2.2, "θ > 0"), (phi, 1.7, "φ < 0")):
        first, last = sorted((yaw, yaw + angle))
        axis.add_patch(Arc(tuple(at), size, size, theta1=np.degrees(first), theta2=np.degrees(last), color="black"))
        axis.text(*(at + ahead(yaw + angle / 2, size / 2 + 0.12)), label, fontsize=10)
    axis.add_patch(Arc(tuple(at), 0.9, 0.9, theta1=0, theta2=np.degrees(yaw), color=GREY))
    axis.plot([at[0], at[0] + 0.8], [at[1], at[1]], "--", color=GREY, lw=0.8)
    axis.text(at[0] + 0.45, at[1] - 0.28, "yaw", color=GREY, fontsize=10)
    axis.text(0.1, -0.75, "static echo: closing speed = v cos(φ − θ)", fontsize=11)
    axis.set(xlim=(-0.3, 6.3), ylim=(-0.95, 4.9), title="from above, z towards you")


def from_the_side(axis: Axes) -> None:
    """Pitch and elevation."""
    pitch, at = np.radians(12), (1.0, 1.2)
    axis.plot([0, 5], [0, 0], color="black", lw=1.5)
    axis.text(3.6, 0.08, "floor, z = 0", fontsize=10)
    arrow(axis, at, (2.6 * np.cos(pitch), -2.6 * np.sin(pitch)), FORWARD, "x forward", (0.05, -0.3))
    arrow(axis, at, (1.2 * np.sin(pitch), 1.2 * np.cos(pitch)), UP, "z up")
    axis.plot([at[0], 3.8], [at[1], at[1]], "--", color=GREY, lw=0.8)
    axis.text(2.0, at[1] + 0.06, "pitch > 0: nose down", color=GREY, fontsize=10)
    axis.plot(4.0, 2.4, "o", color="black")
    axis.plot([at[0], 4.0], [at[1], 2.4], ":", color=GREY)
    axis.text(2.1, 2.2, "elevation > 0", fontsize=10)
    axis.set(xlim=(-0.1, 5), ylim=(-0.3, 3), title="from the side, y away from you")


def from_the_front(axis: Axes) -> None:
    """Antennas of the IWR1843BOOST as the radar itself sees them from behind: left is left."""
    for name, (left, up), color in (
        *((f"RX{k + 1}", (k, 0), LEFT) for k in range(4)),
        *((f"TX{k + 1}", place, FORWARD) for k, place in enumerate(((8, 0), (10, 1), (12, 0)))),
    ):
        axis.add_patch(Rectangle((-left - 0.35, up - 0.25), 0.7, 0.5, color=color, alpha=0.35))
        axis.text(-left, up, name, ha="center", va="center", fontsize=9)
    axis.annotate("", (-1, -0.7), (0, -0.7), arrowprops={"arrowstyle": "<->"})
    axis.text(-0.5, -1.15, "λ/2", ha="center", fontsize=10)
    arrow(axis, (1.6, 0), (-1.0, 0), LEFT, "y left", (-0.4, -0.55))
    arrow(axis, (1.6, 0), (0, 1.2), UP, "z up", (-0.3, 0.1))
    axis.set(xlim=(-13, 2.4), ylim=(-1.5, 2.2), title="IWR1843BOOST from behind (TX shown apart from RX)")


def main() -> None:
    figure = plt.figure(figsize=(10, 7.2), layout="constrained")
    axes = figure.subplot_mosaic([["above", "side"], ["front", "front"]], height_ratios=[3, 1.2])
    for axis, draw in zip(axes.values(), (from_above, from_the_side, from_the_front), strict=True):
        draw(axis)
        axis.set_aspect("equal")
        axis.axis("off")
    figure.savefig(OUTPUT, dpi=90)


if __name__ == "__main__":
    main()
