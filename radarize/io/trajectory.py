"""A trajectory as an object of arrays: truth, odometry, or SLAM."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Bool, Float

from radarize.io.canvas import axes_or_new, png
from radarize.io.tum import planar, write_tum

if TYPE_CHECKING:
    import pandas
    from evo.core.trajectory import PoseTrajectory3D
    from matplotlib.axes import Axes

_COLUMNS = ("x", "y", "z", "qx", "qy", "qz", "qw")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of the sensor over time.

    Attributes:
        time: (pose,) s: stamps of the truth, or else the middle of each frame's burst of chirps.
        pose: (pose, 7) position in m and quaternion x y z w; x forward, y left, z up.
        covariance: (pose, 3, 3) covariance of each pose's x, y (m) and yaw (rad) in its own frame, given the first
            pose; None if unknown.
        velocity: (pose, 2 or 3) m/s in the sensor frame: forward, left, possibly up; None if unknown.
        velocity_covariance: (pose, 2, 2) m^2/s^2; None if unknown.
        floor_plan: (segment, 4) walls of the place, x0 y0 x1 y1 in m; None if unknown.
        name: in plots.

    Example:
        >>> truth = rz.load("walk.h5").truth
        >>> truth.planar.shape, round(truth.distance, 1)  # x, y, yaw; m
        ((24, 3), 0.4)
        >>> truth.to_tum("truth.tum").name
        'truth.tum'
    """

    time: Float[np.ndarray, "pose"]
    pose: Float[np.ndarray, "pose 7"]
    covariance: Float[np.ndarray, "pose 3 3"] | None = None
    velocity: Float[np.ndarray, "pose axis"] | None = None
    velocity_covariance: Float[np.ndarray, "pose 2 2"] | None = None
    floor_plan: Float[np.ndarray, "segment 4"] | None = None
    name: str = "trajectory"

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        duration = float(self.time[-1] - self.time[0]) if len(self) else 0.0
        return f"<{self.name}: {len(self)} poses, {self.distance:.2f} m in {duration:.2f} s>"

    @cached_property
    def planar(self) -> Float[np.ndarray, "pose 3"]:
        """Planar poses (pose, 3): x, y in m and yaw in rad."""
        return planar(self.pose)

    @property
    def distance(self) -> float:
        """Length of the path in the plane, m."""
        return float(np.hypot(*np.diff(self.pose[:, :2], axis=0).T).sum())

    def where(self, chosen: Bool[np.ndarray, "pose"]) -> "Trajectory":
        """Return the trajectory with the chosen poses only."""
        names = ("time", "pose", "covariance", "velocity", "velocity_covariance")
        known = {name: values[chosen] for name in names if (values := getattr(self, name)) is not None}
        return replace(self, **known)

    def to_tum(self, path: str | Path) -> Path:
        """Write a TUM file with lines ``time x y z qx qy qz qw``.

        Raises:
            InputError: the file cannot be written.
        """
        return write_tum(path, self.time, self.pose)

    def to_evo(self) -> "PoseTrajectory3D":
        """Return the trajectory as an object of the `evo` package."""
        from evo.core.trajectory import PoseTrajectory3D

        return PoseTrajectory3D(self.pose[:, :3], np.roll(self.pose[:, 3:], 1, axis=1), self.time)

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table with the time (s) as index: x y z (m), qx qy qz qw, yaw (rad), and vx vy (m/s) if known."""
        import pandas

        table = dict(zip(_COLUMNS, self.pose.T, strict=True)) | {"yaw": self.planar[:, 2]}
        if self.velocity is not None:
            table |= {"vx": self.velocity[:, 0], "vy": self.velocity[:, 1]}
        return pandas.DataFrame(table, index=pandas.Index(self.time, name="time"))

    def plot(self, axes: "Axes | None" = None, **style: Any) -> "Axes":
        """Draw the trajectory from above, in m, with the floor plan if known; `style` is passed to matplotlib's
        plot."""
        axes = axes_or_new(axes)
        if self.floor_plan is not None:
            for x0, y0, x1, y1 in self.floor_plan:
                axes.plot((x0, x1), (y0, y1), color="0.6", linewidth=1.2)
        axes.plot(*self.pose[:, :2].T, **{"label": self.name} | style)
        axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
        axes.legend()
        return axes

    def _repr_png_(self) -> bytes:
        return png(self.plot)
