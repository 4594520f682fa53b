"""A run with known truth: a walk in an L-shaped room, scans by intersecting segments, a map drawn from the plan."""

import json
from pathlib import Path

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

#: L-shaped, without symmetry: a mirrored or turned map cannot fit.
CORNERS = np.array([[0, 0], [8, 0], [8, 3], [5, 3], [5, 6], [0, 6]], float)
PLAN = np.hstack([CORNERS, np.roll(CORNERS, -1, axis=0)])
#: Where the estimate's frame lies in the world: yaw (rad), x, y (m).
FRAME = (0.6, 1.0, 1.0)
RESOLUTION = 0.05
AZIMUTHS = np.radians(np.arange(-44.0, 44.0))
TRUE_AZIMUTHS = np.radians(np.arange(-60.0, 60.5, 0.5))
REACH = 4.28


def walk(rate: float = 15.0, duration: float = 20.0):
    """A loop through the room; times, positions (n, 2), yaw."""
    times = np.arange(0.0, duration, 1 / rate)
    phase = 2 * np.pi * times / duration
    positions = np.column_stack([2.5 + 1.3 * np.cos(phase), 2.6 + 1.5 * np.sin(phase)])
    yaw = phase + np.pi / 2 + 0.4 * np.sin(3 * phase)
    return times, positions, yaw


def cast(positions, yaw, azimuths, plan=PLAN):
    """True planar ranges (n, beams) by intersecting every ray with every segment; inf beyond REACH."""
    bearing = yaw[:, None] + azimuths
    direction = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)[..., None, :]
    start, edge = plan[:, :2], plan[:, 2:] - plan[:, :2]
    offset = start - positions[:, None, None]
    cross = direction[..., 0] * edge[:, 1] - direction[..., 1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (offset[..., 0] * edge[:, 1] - offset[..., 1] * edge[:, 0]) / cross
        share = (offset[..., 0] * direction[..., 1] - offset[..., 1] * direction[..., 0]) / cross
    hit = (along > 0) & (share >= 0) & (share <= 1)
    ranges = np.where(hit, along, np.inf).min(axis=-1)
    return np.where(ranges <= REACH, ranges, np.inf)


def to_estimate(points):
    """World coordinates in the estimate's frame."""
    yaw, x, y = FRAME
    c, s = np.cos(yaw), np.sin(yaw)
    return (points - [x, y]) @ np.array([[c, -s], [s, c]])


def tum(path: Path, times, positions, yaw) -> None:
    """Write planar poses."""
    quaternions = Rotation.from_euler("z", np.asarray(yaw)[:, None]).as_quat()
    rows = np.column_stack([times, positions, np.zeros(len(times)), quaternions])
    np.savetxt(path, rows, fmt="%.9f")


def write_map(folder: Path, points) -> None:
    """A map with the cells of points (estimate's frame) occupied, the rest of the room's box free, a rim unknown."""
    low, high = points.min(axis=0) - 0.5, points.max(axis=0) + 0.5
    width, height = np.ceil((high - low) / RESOLUTION).astype(int)
    pixels = np.full((height, width), 205, np.uint8)
    pixels[6:-6, 6:-6] = 254
    column, row = ((points - low) / RESOLUTION).astype(int).T
    pixels[height - 1 - row, column] = 0
    (folder / "map.pgm").write_bytes(b"P5\n# a comment\n%d %d\n255\n" % (width, height) + pixels.tobytes())
    (folder / "map.yaml").write_text(
        f"image: map.pgm\nresolution: {RESOLUTION}\norigin: [{low[0]}, {low[1]}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def write_run(folder: Path, seed: int = 0, truth: bool = True, walked: float = 20.0) -> Path:
    """Write a whole run folder: a good trajectory, a drifting odometry, and the truth if asked for."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    times, positions, yaw = walk(duration=walked)
    step = np.gradient(positions, times, axis=0)
    c, s = np.cos(yaw), np.sin(yaw)
    velocity = np.column_stack([c * step[:, 0] + s * step[:, 1], -s * step[:, 0] + c * step[:, 1]])

    smooth = np.cumsum(rng.normal(0, 0.003, positions.shape), axis=0)
    tum(folder / "trajectory.tum", times, to_estimate(positions) + smooth, yaw - FRAME[0])
    tum(folder / "odometry.tum", times, 1.04 * to_estimate(positions), yaw - FRAME[0] + 0.006 * times)
    if truth:
        tum(folder / "reference.tum", times, positions, yaw)

    true_scan = cast(positions, yaw, TRUE_AZIMUTHS)
    ranges = cast(positions, yaw, AZIMUTHS)
    noisy = ranges + rng.normal(0, 0.03, ranges.shape)
    noisy[rng.random(ranges.shape) < 0.3] = np.inf
    hit = np.isfinite(ranges)
    bearing = yaw[:, None] + AZIMUTHS
    ends = positions[:, None] + np.where(hit, ranges, 0)[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], -1)
    write_map(folder, to_estimate(ends[hit]))

    frames = np.array([20, 110, 200]) * len(times) // 300
    map_ranges, speeds = np.arange(96) * 0.0446, np.linspace(-1.9, 1.8, 32)
    azimuths = np.radians(np.arange(-60.0, 61.0))
    with h5py.File(folder / "scans.h5", "w") as file:
        file["time"], file["ranges"], file["azimuths"] = times, noisy, AZIMUTHS
        file["velocity"] = velocity + rng.normal(0, [0.02, 0.05], velocity.shape)
        file["velocity_covariance"] = np.tile(np.diag([0.02**2, 0.05**2]), (len(times), 1, 1))
        if truth:
            file["truth/velocity"], file["truth/scan"] = velocity, true_scan
            file["truth/scan_azimuths"], file["truth/floor_plan"] = TRUE_AZIMUTHS, PLAN
        maps = {"range_azimuth": [], "elevation_aware": [], "doppler_azimuth": []}
        for frame in frames:
            wall = cast(positions[frame : frame + 1], yaw[frame : frame + 1], azimuths)[0]
            noise = rng.exponential(1.0, (2, 96, 121))
            echo = 1e4 * np.exp(-(((map_ranges[:, None] - wall) / 0.06) ** 2))
            maps["range_azimuth"].append(echo + noise[0])
            maps["elevation_aware"].append(0.7 * echo + noise[1])
            ridge = velocity[frame, 0] * np.cos(azimuths) + velocity[frame, 1] * np.sin(azimuths)
            maps["doppler_azimuth"].append(
                1e4 * np.exp(-(((speeds[:, None] - ridge) / 0.1) ** 2)) + rng.exponential(10.0, (32, 121))
            )
        file["heatmaps/frames"], file["heatmaps/ranges"] = frames, map_ranges
        file["heatmaps/azimuths"], file["heatmaps/velocities"] = azimuths, speeds
        for name, pictures in maps.items():
            file[f"heatmaps/{name}"] = np.stack(pictures).astype("f4")
    (folder / "run.json").write_text(
        json.dumps(
            {
                "recording": "walk.h5",
                "seed": seed,
                "settings": {"odometry": "doppler", "scans": "first-echo", "slam": {"resolution": 0.05}},
                "versions": {"radarize": "0.1.0", "torch": "2.13.0"},
                "timings": {"heatmaps": 9.1, "velocity": 2.2, "rotation": 6.6, "scans": 3.1, "slam": 0.9},
            }
        )
    )
    return folder
