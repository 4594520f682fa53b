"""Compare trajectories: read them, interpolate to common stamps, project to the plane, align.

Trajectories are evo's `PoseTrajectory3D`. Planar ones lie in z = 0 and turn about z only.
"""

from pathlib import Path
from typing import Literal

import numpy as np
from evo.core.geometry import GeometryException, umeyama_alignment
from evo.core.trajectory import PoseTrajectory3D
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from radarize.io.errors import InputError
from radarize.io.tum import read_tum

#: s, maximum difference of stamps that are matched (as in the paper).
NEAR = 0.01
#: s, longest gap over which a reference is interpolated; a pedestrian turns by a few degrees in this time.
LONGEST_GAP = 0.2

Association = Literal["interpolate", "nearest"]


def trajectory(times: Float[np.ndarray, "pose"], poses: Float[np.ndarray, "pose 7"]) -> PoseTrajectory3D:
    """Return an evo trajectory from stamps (s) and poses (position m, quaternion x y z w)."""
    poses = np.asarray(poses, float)
    return PoseTrajectory3D(poses[:, :3], np.roll(poses[:, 3:], 1, axis=1), np.asarray(times, float))


def load(path: Path) -> PoseTrajectory3D:
    """Read a trajectory from a TUM file.

    Raises:
        InputError: a line has no pose or a NaN, or there are no poses; names the line.
    """
    return trajectory(*read_tum(path))


def matched(
    estimate: PoseTrajectory3D,
    reference: PoseTrajectory3D,
    association: Association = "interpolate",
    names: tuple[str, str] = ("estimate", "reference"),
) -> tuple[PoseTrajectory3D, PoseTrajectory3D]:
    """Return both trajectories at common times.

    Args:
        estimate, reference: with finite poses.
        association: ``"interpolate"`` gives the reference at the estimate's stamps where its neighbours are close
            enough (`LONGEST_GAP`), and the nearest pose within `NEAR` elsewhere; ``"nearest"`` is the latter only.
        names: names of the trajectories in errors.

    Returns:
        Estimate and reference of equal length; stamps are the estimate's.

    Raises:
        InputError: fewer than three poses match, or some are not finite.
    """
    for item, name in zip((estimate, reference), names, strict=True):
        values = np.hstack([item.positions_xyz, item.orientations_quat_wxyz])
        if broken := np.count_nonzero(~np.isfinite(values).all(axis=1)):
            raise InputError(f"{name}: {broken} of {len(values)} poses are not finite, expected numbers everywhere")
    times, known = estimate.timestamps, reference.timestamps
    if len(times) and len(known) > 1:
        after = np.clip(np.searchsorted(known, times), 1, len(known) - 1)
        before = after - 1
        nearest = np.where(times - known[before] <= known[after] - times, before, after)
        near = np.abs(known[nearest] - times) <= NEAR + 1e-9
        inside = (times >= known[0]) & (times <= known[-1]) & (known[after] - known[before] <= LONGEST_GAP)
        between = inside if association == "interpolate" else np.zeros(len(times), bool)
        used = np.flatnonzero(near | between)
    else:
        used = np.zeros(0, int)
    if len(used) < 3:
        raise InputError(
            f"{names[0]}: {len(used)} of {len(times)} poses have a counterpart in {names[1]}, expected at least 3; "
            f"{_span(names[0], times)}, {_span(names[1], known)}"
        )
    instants = np.where(between, times, known[nearest])[used]
    positions = np.column_stack([np.interp(instants, known, axis) for axis in reference.positions_xyz.T])
    turns = Slerp(known, Rotation.from_quat(reference.orientations_quat_wxyz, scalar_first=True))(instants)
    return (
        PoseTrajectory3D(estimate.positions_xyz[used], estimate.orientations_quat_wxyz[used], times[used]),
        PoseTrajectory3D(positions, turns.as_quat(scalar_first=True), times[used]),
    )


def _span(name: str, times: np.ndarray) -> str:
    return f"{name} spans {times[0]:.3f} to {times[-1]:.3f} s" if len(times) else f"{name} is empty"


def yaws(path: PoseTrajectory3D) -> Float[np.ndarray, "pose"]:
    """Return the headings of the x axis about z, rad."""
    forward = Rotation.from_quat(path.orientations_quat_wxyz, scalar_first=True).apply([1.0, 0.0, 0.0])
    return np.arctan2(forward[:, 1], forward[:, 0])


def planar(path: PoseTrajectory3D) -> PoseTrajectory3D:
    """Return the trajectory projected to the plane: x, y, yaw."""
    positions = path.positions_xyz * [1.0, 1.0, 0.0]
    quaternions = Rotation.from_rotvec(yaws(path)[:, None] * [0.0, 0.0, 1.0]).as_quat(scalar_first=True)
    return PoseTrajectory3D(positions, quaternions, path.timestamps)


def alignment(
    estimate: PoseTrajectory3D, reference: PoseTrajectory3D, in_plane: bool
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Return rotation and translation (no scale) that align the estimate with the reference (Umeyama, PAMI 1991).

    In the plane it rotates about z only. If positions do not determine the rotation (the sensor stands still), it is
    the mean rotation between orientations.
    """
    x, y = estimate.positions_xyz.T, reference.positions_xyz.T
    size = 2 if in_plane else 3
    turn = np.eye(3)
    try:
        if min(x[:size].std(axis=1).max(), y[:size].std(axis=1).max()) < 1e-6:
            raise GeometryException("no motion")
        turn[:size, :size] = umeyama_alignment(x[:size], y[:size])[0]
    except GeometryException:
        attitudes = [Rotation.from_quat(p.orientations_quat_wxyz, scalar_first=True) for p in (reference, estimate)]
        turn = (attitudes[0] * attitudes[1].inv()).mean().as_matrix()
    return turn, y.mean(axis=1) - turn @ x.mean(axis=1)


def fitted(
    estimate: PoseTrajectory3D, reference: PoseTrajectory3D
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Return the `alignment` in the plane of the common part of two trajectories.

    Raises:
        InputError: fewer than three poses match.
    """
    estimate, reference = matched(estimate, reference)
    return alignment(planar(estimate), planar(reference), in_plane=True)


def moved(path: PoseTrajectory3D, turn: Float[np.ndarray, "3 3"], shift: Float[np.ndarray, "3"]) -> PoseTrajectory3D:
    """Return the trajectory in another frame: each pose T becomes (turn, shift) T."""
    attitudes = Rotation.from_matrix(turn) * Rotation.from_quat(path.orientations_quat_wxyz, scalar_first=True)
    positions = path.positions_xyz @ turn.T + shift
    return PoseTrajectory3D(positions, attitudes.as_quat(scalar_first=True), path.timestamps)
