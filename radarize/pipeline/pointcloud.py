"""Sparse point clouds, computed as in the radar's own firmware."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from radarize.io.canvas import axes_or_new, png
from radarize.io.load import Samples, Source, samples_of
from radarize.signal.effort import together
from radarize.signal.points import COLUMNS, PointCloudConfig, PointClouds

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of some frames.

    Attributes:
        points: (point, 6) x forward, y left, z up (m), radial speed (m/s, closing positive), SNR and noise (dB).
        frame: (point,) number of the frame that each belongs to.

    Example:
        >>> points = rz.point_cloud(rec[:2])
        >>> points.xyz.shape[1], set(points.frame) <= {0, 1}
        (3, True)
    """

    points: Float[np.ndarray, "point 6"]
    frame: Int[np.ndarray, "point"]

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        return f"<{len(self)} points of {len(np.unique(self.frame))} frames>"

    @property
    def xyz(self) -> Float[np.ndarray, "point 3"]:
        """Positions (point, 3): x forward, y left, z up, m."""
        return self.points[:, :3]

    @property
    def velocity(self) -> Float[np.ndarray, "point"]:
        """Radial speed (point,), m/s, closing positive."""
        return self.points[:, 3]

    @property
    def snr(self) -> Float[np.ndarray, "point"]:
        """Signal-to-noise ratio (point,), dB."""
        return self.points[:, 4]

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a table: frame, x, y, z (m), velocity (m/s), snr, noise (dB)."""
        import pandas

        return pandas.DataFrame({"frame": self.frame} | dict(zip(COLUMNS, self.points.T, strict=True)))

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """Draw the points from above in m, forward up and left to the left, coloured by radial speed in m/s."""
        axes = axes_or_new(axes)
        shown = axes.scatter(-self.points[:, 1], self.points[:, 0], c=self.velocity, s=12, cmap="coolwarm")
        axes.figure.colorbar(shown, ax=axes, label="closing speed, m/s")
        axes.set(xlabel="to the right, m", ylabel="forward, m", aspect="equal")
        return axes

    def _repr_png_(self) -> bytes:
        return png(self.plot)


def point_cloud(frames: Samples | Source, *, settings: PointCloudConfig | None = None) -> PointCloud:
    """Detect points by the processing chain of TI's demo firmware: CFAR over range and Doppler, then angles.

    Args:
        frames: frames of a recording, such as ``rec[100]``; a recording for all of its frames.
        settings: thresholds and windows; by default those of TI's profile for the xWR1843.

    Returns:
        Points with their frames' numbers.

    Raises:
        InputError: a recording without samples, or too few loops or samples for the CFAR windows.

    Example:
        >>> points = rz.point_cloud(rec[4])
        >>> points.xyz.shape[1], sorted(points.to_pandas())
        (3, ['frame', 'noise', 'snr', 'velocity', 'x', 'y', 'z'])
    """
    frames = samples_of(frames)
    clouds, size = PointClouds(frames.config, settings), together(frames.config)
    points, numbers = [np.zeros((0, len(COLUMNS)))], [np.zeros(0, int)]
    for part in (frames[start : start + size] for start in range(0, len(frames), size)):
        found, frame = clouds(part.samples, part.valid)
        points.append(found)
        numbers.append(np.array(part.numbers)[frame])
    return PointCloud(np.concatenate(points), np.concatenate(numbers))
