"""Training labels as in the published artefact, from true poses and depth pictures."""

import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16
from scipy.spatial.transform import Rotation

from radarize.io.recording import Recording

#: Cells of scans: 4.51 cm, while the radar's range bins are 4.46 cm; bearings (rad, ascending to the left), which
#: differ from those of the maps.
RANGES, BEARINGS = np.linspace(0.0, 4.284, 96), np.radians(np.linspace(-43.0, 43.0, 88))
#: Ranges of the cells of occupancy labels, up to the radar's maximum range with a speed of light of 3e8 m/s, m.
LABEL_RANGES = np.linspace(0.0, 3e8 * 2285e3 / (2 * 80e12), 96)
#: Height above and below the sensor's plane within which points count, m; the plane is not levelled.
SLAB = 0.03
_BATCH = 64


def velocity(recording: Recording, frames: slice) -> Float[np.ndarray, "frame 2"]:
    """Return the mean velocity since the previous frame in the sensor frame at that time: forward, left, m/s.

    Raises:
        InputError: the recording has no true poses.
    """
    return finite_difference(recording.read("truth/pose")[frames], recording.times[frames]).astype(np.float32)


def finite_difference(
    pose: Float[np.ndarray, "frame 7"], times: Float[np.ndarray, "frame"]
) -> Float[np.ndarray, "frame 2"]:
    """Compute `velocity` from poses and times (s); the first frame gets the value of the second."""
    moved = Rotation.from_quat(pose[:-1, 3:]).inv().apply(np.diff(pose[:, :3], axis=0))
    speed = (moved / np.diff(times)[:, None])[:, :2]
    return np.concatenate([speed[:1], speed])


def occupancy(recording: Recording, frames: slice) -> UInt8[np.ndarray, "frame range bearing"]:
    """Return occupancy of range-bearing cells by the depth picture; radar frame i is paired with picture i + 1.

    Raises:
        InputError: the recording has no depth pictures, or no intrinsics of the depth camera.
    """
    pinhole = recording.read("truth/depth_intrinsics")
    pictures = np.minimum(np.arange(len(recording))[frames] + 1, len(recording) - 1)
    parts = []
    for k in range(0, len(pictures), _BATCH):
        some = pictures[k : k + _BATCH]
        first = int(some[0])
        depth = recording.rows("truth/depth", first, int(some[-1]) + 1)
        parts.append(occupied(depth[some - first], pinhole))
    return np.concatenate(parts).astype(np.uint8)


def occupied(
    depth: UInt16[np.ndarray, "frame row column"], pinhole: Float[np.ndarray, "4"]
) -> Bool[np.ndarray, "frame range bearing"]:
    """Return cells with a point in the camera's plane, and their neighbours one farther and one to the left.

    Points whose nearest cell is the first or last of its row or column are left out.

    Args:
        depth: distance along the optical axis, mm; 0 where unknown.
        pinhole: fx, fy, cx, cy, pixels.
    """
    fx, fy, cx, cy = pinhole
    frames, rows, columns = depth.shape
    across, down = (np.arange(columns) - cx) / fx, (np.arange(rows) - cy) / fy
    forward = depth * 1e-3
    distance, azimuth = forward * np.hypot(1, across), -np.arctan(across)
    cell = np.rint(distance / LABEL_RANGES[1]).astype(int)
    column = np.rint((azimuth - BEARINGS[0]) / (BEARINGS[1] - BEARINGS[0])).astype(int)
    seen = (depth > 0) & (np.abs(forward * down[:, None]) < SLAB)
    seen &= (cell >= 1) & (cell < len(LABEL_RANGES) - 1) & (column >= 1) & (column < len(BEARINGS) - 1)
    frame, _, at = seen.nonzero()
    label = np.zeros((frames, len(LABEL_RANGES), len(BEARINGS)), bool)
    for farther in (0, 1):
        for left in (0, 1):
            label[frame, cell[seen] + farther, column[at] + left] = True
    return label
