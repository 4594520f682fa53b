"""Changes of yaw, trajectories and maps on real walks, from a radar's pictures and from the scans of each method.

The reference is the lidar on the same rig: its poses, and the map of its points at these poses.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from radarize.baselines.pictures.odometry import PictureRates
from radarize.baselines.scan_matching.odometry import ScanMatching
from radarize.baselines.walks.poses import BEARINGS, at, stamps
from radarize.baselines.walks.walks import PERIOD
from radarize.evaluation.mapping import agreement
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.errors import InputError
from radarize.io.pose import between, compose, transform, wrap
from radarize.io.tum import planar_poses
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.method import Inputs, Weights
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from radarize.signal.batch import Batch, Signal
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from radarize.slam.grid import OccupancyGrid

#: Frames over which changes of yaw are evaluated: 0.2 s.
SPAN = 4
#: Standard deviation of the Gaussian that smooths changes of yaw, frames: 0.3 s. Chosen on walks 112, 113 and 120,
#: where it reduces the RMSE from 1.01, 0.93, 0.83 deg to 0.74, 0.73, 0.59 deg; a wider one gains little.
SMOOTH = 6
#: Maximum shift between two pictures, columns: 57 deg/s.
_MOST = 4
#: Standard deviations of the simulated odometry's errors: share of a step's length and m per step; rad per step; bias
#: of the yaw rate, rad/s. They are those of a cart's wheel odometry in the lidar logs.
_STEP, _YAW, _BIAS = (0.05, 0.001), np.radians(0.1), np.radians(0.3)
#: Settings of the SLAM back end.
_CONFIG = SlamConfig.preset("radar")
#: Cell size of the lidar's map, m; minimum number of frames with points in a cell; distances within which maps agree,
#: m.
_CELL, _SEEN, NEAR = 0.05, 3, (0.1, 0.2)


def turn_errors(found: Float[np.ndarray, "frame"], poses: Float[np.ndarray, "frame 3"]) -> dict[str, float]:
    """Return errors of changes of yaw over the `SPAN` frames up to each frame (rad; NaN: none): RMSE and median, and
    the RMS of the true changes, deg."""
    true = np.full(len(poses), np.nan)
    true[SPAN:] = wrap(poses[SPAN:, 2] - poses[:-SPAN, 2])
    known = np.isfinite(found) & np.isfinite(true)
    error = np.degrees(wrap(found - true)[known])
    return {
        "yaw_rmse_deg": float(np.sqrt(np.mean(error**2))),
        "yaw_median_deg": float(np.median(np.abs(error))),
        "turns_rms_deg": float(np.sqrt(np.mean(np.degrees(true[known]) ** 2))),
    }


def shifted_turns(pictures: UInt8[np.ndarray, "frame range azimuth"]) -> Float[np.ndarray, "frame"]:
    """Estimate changes of yaw over `SPAN` frames, rad, by the shift over azimuth that maximises the correlation of two
    pictures, with parabolic interpolation between columns."""
    size = 2 * polar.COLUMNS
    spectra = np.fft.rfft(pictures.astype(np.float32), size, axis=2)
    found = np.full(len(pictures), np.nan)
    shifts = np.arange(-_MOST, _MOST + 1)
    for frame in range(SPAN, len(pictures)):
        both = np.fft.irfft((spectra[frame - SPAN] * spectra[frame].conj()).sum(axis=0), size)[shifts]
        best = int(both.argmax())
        if 0 < best < len(shifts) - 1:
            before, at, after = both[best - 1 : best + 2]
            best += (before - after) / (2 * (before - 2 * at + after) or 1.0)
        found[frame] = (best - _MOST) * (polar.AZIMUTHS[1] - polar.AZIMUTHS[0])
    return found


def smoothed(turns: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
    """Smooth changes of yaw over neighbouring frames with a Gaussian; frames without an estimate (NaN) stay NaN."""
    known = np.isfinite(turns)
    weights = gaussian_filter1d(known.astype(float), SMOOTH)
    averaged = gaussian_filter1d(np.where(known, turns, 0.0), SMOOTH) / np.maximum(weights, 1e-9)
    return np.where(known, averaged, np.nan)


def disturbed(
    poses: Float[np.ndarray, "frame 3"], seed: int
) -> tuple[Float[np.ndarray, "frame 3"], Float[np.ndarray, "frame 3 3"]]:
    """Simulate an odometry with errors: its integrated poses, and the covariance of each step.

    Covariances are of independent steps: the bias of the yaw rate is modelled as an error that changes every second.
    """
    rng = np.random.default_rng(seed)
    steps = between(poses[:-1], poses[1:])
    deviation = _STEP[0] * np.hypot(steps[:, 0], steps[:, 1]) + _STEP[1]
    steps[:, :2] += rng.normal(size=(len(steps), 2)) * deviation[:, None]
    steps[:, 2] += rng.normal(0, _YAW, len(steps)) + PERIOD * rng.normal(0, _BIAS)
    found = [poses[0]]
    for step in steps:
        found.append(compose(found[-1], step))
    covariance = np.zeros((len(poses), 3, 3))
    covariance[1:, 0, 0] = covariance[1:, 1, 1] = deviation**2
    covariance[1:, 2, 2] = _YAW**2 + _BIAS**2 * PERIOD
    return np.array(found), covariance


def matched_scans(
    ranges: Float[np.ndarray, "frame bearing"], rates: Float[np.ndarray, "frame 2"] | None
) -> tuple[Float[np.ndarray, "frame 3"], ErrorModel]:
    """Estimate poses by scan matching alone, with the error model of the relative motions.

    Args:
        ranges: scans on `BEARINGS`, m.
        rates: yaw rates by a network, rad/s, and their variances; NaN where unknown.
    """
    batch = Batch(Signal(PRESETS["radarhd"]), None, stamps(len(ranges)))
    known = None if rates is None else lambda batch: rates
    batch.ranges = np.where(np.isnan(ranges), np.inf, ranges)
    matching = ScanMatching(rates=known, bearings=BEARINGS)
    track = matching.update(batch)
    return track.pose, track.errors


def network_rates(weights: Weights, pictures: UInt8[np.ndarray, "frame range azimuth"]) -> Float[np.ndarray, "frame 2"]:
    """Estimate yaw rates over `SPAN` frames (rad/s) and their variances by a network trained in simulation; NaN where
    pictures are missing."""
    inputs, times = Inputs(PRESETS["radarhd"], weights=weights), stamps(len(pictures))
    network, found = PictureRates(inputs), np.empty((len(pictures), 2))
    if round(network.span / PERIOD) != SPAN:
        raise InputError(f"picture-turns: reads frames {network.span:g} s apart, expected {SPAN * PERIOD:g} s")
    for start in range(0, len(pictures), 64):
        some = slice(start, start + 64)
        found[some] = network.rates(Batch(inputs.signal, None, times[some], maps={"picture": pictures[some]}))
    return found


def mapped(
    ranges: Float[np.ndarray, "frame bearing"],
    poses: Float[np.ndarray, "frame 3"],
    surface: Float[np.ndarray, "point 2"],
    odometry: Float[np.ndarray, "frame 3"],
    errors: ErrorModel | Float[np.ndarray, "frame 3 3"],
) -> dict[str, float]:
    """Run SLAM on scans, and return the ATE of its trajectory (m) and the agreement of its map with the lidar's.

    Args:
        ranges: scans on `BEARINGS`, m; NaN where unknown.
        poses: true poses.
        surface: occupied cells of the lidar's map, m, in the frame of the poses.
        odometry: poses of the odometry.
        errors: error model of the odometry's relative motions, or their covariances.
    """
    slam = Slam(_CONFIG)
    for frame in range(len(ranges)):
        slam.add_odometry(PERIOD * frame, odometry[frame], errors[frame])
        slam.add_scan(PERIOD * frame, BEARINGS, ranges[frame])
    slam.finish()
    times, found = slam.trajectory()
    turn, shift = _alignment(found, at(times, stamps(len(poses)), poses))
    return {
        "ate_m": float(_compared(times, found, poses).position.mean),
        **map_agreement(slam.map(), turn, shift, surface),
    }


def drift(odometry: Float[np.ndarray, "frame 3"], poses: Float[np.ndarray, "frame 3"]) -> float:
    """Return the ATE of an odometry, m."""
    return float(_compared(stamps(len(poses)), odometry, poses).position.mean)


def surface_of(
    clouds: Sequence[Float[np.ndarray, "point 2"]], poses: Float[np.ndarray, "frame 3"]
) -> Float[np.ndarray, "cell 2"]:
    """Return the lidar's map: centres of the cells with points in at least three frames, m."""
    touched = [
        np.unique(np.floor(transform(pose, cloud) / _CELL).astype(int), axis=0)
        for pose, cloud in zip(poses, clouds, strict=True)
    ]
    cells, count = np.unique(np.concatenate(touched), axis=0, return_counts=True)
    return (cells[count >= _SEEN] + 0.5) * _CELL


def map_agreement(
    grid: OccupancyGrid, turn: float, shift: Float[np.ndarray, "2"], surface: Float[np.ndarray, "point 2"]
) -> dict[str, float]:
    """Return the share of occupied cells near the surface (precision), that of the surface near occupied cells
    (recall), and F1.

    Args:
        grid: map of SLAM.
        turn, shift: alignment from the frame of the map to that of the surface, rad and m.
        surface: occupied cells of the lidar's map, m.
    """
    row, column = np.nonzero(grid.probability > 0.5)
    cells = transform(np.array([*shift, turn]), grid.origin + (np.column_stack([column, row]) + 0.5) * grid.resolution)
    off_surface = cKDTree(surface).query(cells)[0]
    off_map = cKDTree(cells).query(surface)[0]  # far from a map without cells
    found = {}
    for near in NEAR:
        for name, value in agreement(off_surface, off_map, near).items():
            found[f"map_{name}_{100 * near:.0f}cm"] = float(value)
    return found


def _alignment(
    found: Float[np.ndarray, "scan 3"], true: Float[np.ndarray, "scan 3"]
) -> tuple[float, Float[np.ndarray, "2"]]:
    """Return rotation (rad) and translation (m) from one frame to the other. The rotation is from headings, because
    positions do not determine it while the rig stands still."""
    apart = true[:, 2] - found[:, 2]
    turn = float(np.arctan2(np.sin(apart).mean(), np.cos(apart).mean()))
    return turn, true[:, :2].mean(axis=0) - transform(np.array([0.0, 0.0, turn]), found[:, :2]).mean(axis=0)


def _compared(
    times: Float[np.ndarray, "scan"], found: Float[np.ndarray, "scan 3"], poses: Float[np.ndarray, "frame 3"]
) -> TrajectoryErrors:
    reference = trajectory(stamps(len(poses)), planar_poses(poses))
    return evaluate_trajectory(trajectory(times, planar_poses(found)), reference)
