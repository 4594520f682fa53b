"""Figures of the other sensors of a recording, for its report."""

import numpy as np
from jaxtyping import Int
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from scipy.spatial.transform import Rotation

from radarize.evaluation.report.drawings import canvas
from radarize.evaluation.report.page import COLORS, Page
from radarize.io.recording import Recording

#: Value of cells without a path type in /truth/cause.
_NONE = 255


def show_sensors(page: Page, recording: Recording, frames: Int[np.ndarray, "frame"]) -> None:
    """Add sections for the sensors of a recording: pictures at some frames, IMU, tracking camera."""
    drawers = {
        "truth/depth": ("Depth camera", "Distance along the optical axis, m; white: unknown.", _depth),
        "truth/occupancy": ("Occupancy label", "From above: free, first surface, unknown behind it.", _occupancy),
        "truth/cause": ("Path type of the strongest echo in each cell", "", _cause),
        "points/cloud": ("Point cloud", "From above; colour: closing speed, m/s.", _points),
    }
    for name, (title, about, draw) in drawers.items():
        if recording.has(name):
            page.section(title, about or str(recording.describe(name)["about"]))
            figure, axes = canvas(len(frames), height=2.6)
            for axis, frame in zip(axes[0], frames, strict=True):
                draw(axis, recording, recording.rows(name, frame, frame + 1))
                axis.set_title(f"frame {frame}")
            page.picture(figure)
    if recording.has("imu/time"):
        page.section("IMU", "Specific force and angular velocity (x, y, z).")
        names = ("imu/accelerometer", "imu/gyroscope")
        lines = {f"{n.removeprefix('imu/')}, {recording.describe(n)['unit']}": recording.read(n) for n in names}
        _draw_lines(page, recording.read("imu/time"), lines)
    if recording.has("tracking/pose") and recording.has("tracking/true_pose"):
        page.section("Tracking camera", "Errors of its poses: position (x, y, z), and rotation vector.")
        time, tracked, truth = (recording.read(f"tracking/{n}") for n in ("time", "pose", "true_pose"))
        turn = (Rotation.from_quat(tracked[:, 3:]) * Rotation.from_quat(truth[:, 3:]).inv()).as_rotvec()
        off = tracked[:, :3] - truth[:, :3]
        _draw_lines(page, time, {"position, m": off, "rotation, deg": np.degrees(turn)})


def _depth(axis: Axes, recording: Recording, pictures: np.ndarray) -> None:
    drawn = axis.imshow(np.where(pictures[0] > 0, pictures[0] / 1000, np.nan), cmap="viridis", aspect="auto")
    axis.set(xticks=[], yticks=[])
    axis.figure.colorbar(drawn, ax=axis, label="m")


def _occupancy(axis: Axes, recording: Recording, cells: np.ndarray) -> None:
    _polar(axis, recording, "truth/occupancy", cells[0], "viridis", 2)


def _cause(axis: Axes, recording: Recording, cells: np.ndarray) -> None:
    drawn = _polar(axis, recording, "truth/cause", np.where(cells[0] == _NONE, np.nan, cells[0]), "tab10", 9)
    names = recording.labels("truth/cause")
    axis.figure.colorbar(drawn, ax=axis).set_ticks(range(len(names)), labels=names, fontsize=7)


def _polar(axis: Axes, recording: Recording, name: str, cells: np.ndarray, colors: str, top: int) -> QuadMesh:
    ranges, azimuths = recording.read(f"{name}_ranges"), recording.read(f"{name}_azimuths")
    x, y = -ranges[:, None] * np.sin(azimuths), ranges[:, None] * np.cos(azimuths)
    axis.set(aspect="equal", xlabel="to the right, m", ylabel="forward, m")
    return axis.pcolormesh(x, y, cells, cmap=colors, vmin=0, vmax=top, rasterized=True)


def _points(axis: Axes, recording: Recording, cloud: np.ndarray) -> None:
    limit, reach = recording.config.max_velocity, recording.config.max_range
    drawn = axis.scatter(-cloud[:, 1], cloud[:, 0], c=cloud[:, 3], cmap="coolwarm", vmin=-limit, vmax=limit, s=14)
    axis.set(aspect="equal", xlim=(-reach, reach), ylim=(0, reach), xlabel="to the right, m", ylabel="forward, m")
    axis.figure.colorbar(drawn, ax=axis)


def _draw_lines(page: Page, time: np.ndarray, values: dict[str, np.ndarray]) -> None:
    """Draw axes for each name with x, y, z over time."""
    figure, axes = canvas(len(values))
    for axis, (label, columns) in zip(axes[0], values.items(), strict=True):
        for column, name in zip(columns.T, ("odometry", "good", "slam"), strict=True):
            axis.plot(time, column, color=COLORS[name], lw=0.7)
        axis.set(xlabel="time, s", ylabel=label)
    page.picture(figure)
