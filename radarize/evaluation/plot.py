"""Plots of the results of this package's functions."""

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from radarize.evaluation.report.drawings import draw_doppler, draw_fan, draw_profiles, draw_range_doppler
from radarize.io.canvas import axes_or_new
from radarize.io.errors import InputError
from radarize.io.recording import Clip, Recording
from radarize.io.trajectory import Trajectory
from radarize.pipeline.pointcloud import PointCloud
from radarize.pipeline.run import Run
from radarize.pipeline.runfolder import OccupancyMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot(
    what: "xarray.DataArray | Trajectory | PointCloud | Run | OccupancyMap | Recording | Clip",
    axes: "Axes | None" = None,
    *,
    title: str = "",
    velocity: "np.ndarray | None" = None,
) -> "Axes":
    """Draw a map, a trajectory, points, a run or a recording.

    Args:
        what: a heat map of one frame (range-azimuth maps are drawn from above, in dB relative to the strongest cell),
            range profiles of one or more frames, a trajectory, a point cloud, a run, its map or its scans, or a
            recording (its true trajectory).
        axes: axes to draw on; by default those of a new figure.
        title: title of the axes.
        velocity: (2,) velocity forward, left in m/s: adds the ridge of static surfaces to a Doppler-azimuth map.

    Returns:
        The axes.

    Raises:
        InputError: another type, maps of several frames, one row of a map over azimuth, or a recording without truth.

    Example:
        >>> axes = rz.plot(rz.range_azimuth(rec[4]), title="frame 4")
        >>> axes.get_xlabel()
        'to the right, m'
        >>> rz.plot(rec.truth, axes) is axes
        True
    """
    axes = axes_or_new(axes)
    if isinstance(what, Recording | Clip):
        if what.truth is None:
            raise InputError(f"{what!r}: has no true poses to draw, expected maps of it, such as range_azimuth(rec[0])")
        what = what.truth
    if isinstance(what, Trajectory | PointCloud | Run | OccupancyMap):
        what.plot(axes)
        if title:
            axes.set_title(title)
    elif isinstance(what, xarray.DataArray):
        _array(axes, what, title, velocity)
    else:
        raise InputError(f"{type(what).__name__} cannot be drawn, expected what a function of radarize returned")
    return axes


def _array(axes: "Axes", array: xarray.DataArray, title: str, velocity: Any) -> None:
    if array.ndim == 3 and array.sizes.get("frame") == 1:
        array = array[0]
    values = array.values
    match array.dims:
        case ("range", "azimuth"):
            draw_fan(axes, values, array.range.values, array.azimuth.values, title)
        case ("doppler", "azimuth"):
            draw_doppler(axes, values, array.doppler.values, array.azimuth.values, title, velocity)
        case ("range", "doppler"):
            draw_range_doppler(axes, values, array.range.values, array.doppler.values, title)
        case ("frame", "range"):
            draw_profiles(axes, array.time.values, array.range.values, values)
            axes.set_title(title)
        case ("range",):
            axes.plot(array.range, 10 * np.log10(np.maximum(values, values.max(initial=1e-30) * 1e-9)))
            axes.set(xlabel="range, m", ylabel="power, dB of squared ADC counts", title=title)
        case ("time", "azimuth") | ("azimuth",) if array.name != "power":  # scans
            ahead, left = array * np.cos(array.azimuth), array * np.sin(array.azimuth)
            axes.plot(-left.values.ravel(), ahead.values.ravel(), ".", markersize=2)
            axes.set(xlabel="to the right, m", ylabel="forward, m", aspect="equal", title=title)
        case _:
            one = "maps[0]" if "frame" in array.dims else "range_azimuth(rec[10]) without [0]: it has no axis frame"
            raise InputError(
                f"axes are {', '.join(map(str, array.dims)) or 'none'}, expected a map of one frame, such as {one}"
            )
