"""Pictures of what sensors beside the radar recorded, for the report of a recording."""

import numpy as np
from jaxtyping import Float, Shaped
from scipy.spatial.transform import Rotation

from radarize.recording import Recording
from radarize.report.drawings import canvas
from radarize.report.page import COLORS, Page

#: Value of cells that no cause fills (/truth/cause).
_NONE = 255


def show_sensors(page: Page, recording: Recording, frames: list[int]) -> None:
    """Sections for whatever there is of pictures at some frames, IMU and tracking camera."""
    drawers = {
        "truth/depth": ("Depth camera", "Nearer is darker; white has no value.", _depth),
        "truth/occupancy": ("Occupancy label", "From above: free, first surface, unknown behind it.", _occupancy),
        "truth/cause": ("Strongest cause of every cell", "", _cause),
        "points/cloud": ("Point cloud", "From above, by closing speed, m/s.", _points),
    }
    for name, (title, about, draw) in drawers.items():
        if recording.has(name):
            page.section(title, about or str(recording.describe(name)["about"]))
            figure, axes = canvas(len(frames), height=2.6)
            for axis, frame in zip(axes[0], frames, strict=True):
                draw(axis, recording, frame)
                axis.set_title(f"frame {frame}")
            page.picture(figure)
    if recording.has("imu/time"):
        page.section("IMU", "Specific force and angular velocity; x, y, z.")
        figure, axes = canvas(2)
        time = recording.read("imu/time")
        for axis, name in zip(axes[0], ("imu/accelerometer", "imu/gyroscope"), strict=True):
            values = recording.read(name)
            _lines(axis, time, values, f"{name.removeprefix('imu/')}, {recording.describe(name)['unit']}")
        page.picture(figure)
    if recording.has("tracking/pose") and recording.has("tracking/true_pose"):
        page.section("Tracking camera", "How far its poses are off: position, and rotation vector.")
        figure, axes = canvas(2)
        time, tracked, truth = (recording.read(f"tracking/{n}") for n in ("time", "pose", "true_pose"))
        turn = (Rotation.from_quat(tracked[:, 3:]) * Rotation.from_quat(truth[:, 3:]).inv()).as_rotvec()
        _lines(axes[0, 0], time, tracked[:, :3] - truth[:, :3], "position, m")
        _lines(axes[0, 1], time, np.degrees(turn), "rotation, deg")
        page.picture(figure)


def _depth(axis, recording: Recording, frame: int) -> None:
    picture = recording.rows("truth/depth", frame, frame + 1)[0]
    drawn = axis.imshow(np.where(picture > 0, picture / 1000, np.nan), cmap="viridis", aspect="auto")
    axis.set(xticks=[], yticks=[])
    axis.figure.colorbar(drawn, ax=axis, label="m")


def _occupancy(axis, recording: Recording, frame: int) -> None:
    _polar(axis, recording, "truth/occupancy", recording.rows("truth/occupancy", frame, frame + 1)[0], "viridis", 2)


def _cause(axis, recording: Recording, frame: int) -> None:
    cause = recording.rows("truth/cause", frame, frame + 1)[0].astype(float)
    drawn = _polar(axis, recording, "truth/cause", np.where(cause == _NONE, np.nan, cause), "tab10", 9)
    axis.figure.colorbar(drawn, ax=axis)


def _polar(axis, recording: Recording, name: str, cells: Shaped[np.ndarray, "range azimuth"], colors: str, top: int):
    ranges, azimuths = recording.read(f"{name}_ranges"), recording.read(f"{name}_azimuths")
    x, y = -ranges[:, None] * np.sin(azimuths), ranges[:, None] * np.cos(azimuths)
    axis.set(aspect="equal", xlabel="to the right, m", ylabel="forward, m")
    return axis.pcolormesh(x, y, cells, cmap=colors, vmin=0, vmax=top, rasterized=True)


def _points(axis, recording: Recording, frame: int) -> None:
    cloud = recording.rows("points/cloud", frame, frame + 1)
    limit = recording.config.max_velocity
    drawn = axis.scatter(-cloud[:, 1], cloud[:, 0], c=cloud[:, 3], cmap="coolwarm", vmin=-limit, vmax=limit, s=14)
    reach = recording.config.max_range
    axis.set(aspect="equal", xlim=(-reach, reach), ylim=(0, reach), xlabel="to the right, m", ylabel="forward, m")
    axis.figure.colorbar(drawn, ax=axis)


def _lines(axis, time: Float[np.ndarray, "n"], values: Float[np.ndarray, "n 3"], label: str) -> None:
    for column, color in zip(values.T, (COLORS["slam"], COLORS["good"], COLORS["odometry"]), strict=True):
        axis.plot(time, column, color=color, lw=0.7)
    axis.set(xlabel="time, s", ylabel=label)
