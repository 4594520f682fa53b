"""Trajectory errors: absolute after alignment (ATE), and relative over a frame, a second and a metre (RE).

As in the paper (section 6): association within 10 ms, alignment without scale, means per trajectory. Relative rotation
is a relative error, in contrast to the paper's tables. Definitions are those of evo's `evo_ape` and `evo_rpe`.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import overload

import numpy as np
from evo.core.trajectory import PoseTrajectory3D
from jaxtyping import Float
from scipy.spatial.transform import RigidTransform, Rotation

from radarize.io.alignment import Association, alignment, matched, moved, planar

#: Spans of relative errors, s and m; maximum relative deviation of the span of a pair of poses.
SECOND, METRE, TOLERANCE = 1.0, 1.0, 0.1


def over(values: np.ndarray, statistic: Callable[[np.ndarray], float] = np.mean) -> float:
    """Return a statistic of values; NaN without values."""
    return float(statistic(values)) if np.size(values) else np.nan


@dataclass(frozen=True)
class Statistics:
    """Mean, root mean square and maximum of errors, and their number; NaN without errors."""

    mean: float
    rmse: float
    max: float
    count: int

    @classmethod
    def of(cls, errors: np.ndarray) -> "Statistics":
        """Compute statistics of finite errors."""
        rmse = float(np.sqrt(over(np.square(errors))))
        return cls(over(errors), rmse, over(errors, np.max), len(errors))


@dataclass(frozen=True)
class TrajectoryErrors:
    """Errors of an estimated trajectory against its reference.

    Attributes:
        position, rotation: absolute errors after alignment, m and rad (ATE).
        relative: ``position`` and ``rotation`` by ``frame``, ``second`` and ``metre``, m and rad (RE).
        distance: length of the reference in the plane, without the vertical motion of walking, m.
        duration: duration of the reference, s.
        share: mean absolute position error as a share of the distance.
        drift: position error of the last pose if the first poses are aligned, as a share of the distance.
        time: time stamps of the matched poses, s.
        position_errors, rotation_errors: absolute errors of each pose, m and rad.
        estimate, reference: matched trajectories, the estimate aligned.
        turn, shift: the alignment: a point p in the frame of the estimate is turn p + shift in that of the reference.
    """

    position: Statistics
    rotation: Statistics
    relative: dict[str, dict[str, Statistics]]
    distance: float
    duration: float
    share: float
    drift: float
    time: Float[np.ndarray, "pose"] = field(repr=False)
    position_errors: Float[np.ndarray, "pose"] = field(repr=False)
    rotation_errors: Float[np.ndarray, "pose"] = field(repr=False)
    estimate: PoseTrajectory3D = field(repr=False)
    reference: PoseTrajectory3D = field(repr=False)
    turn: Float[np.ndarray, "3 3"] = field(repr=False)
    shift: Float[np.ndarray, "3"] = field(repr=False)

    def summary(self) -> dict[str, object]:
        """Return the content of metrics.json; None for values that do not exist."""
        figures = {
            "ate": {"position": asdict(self.position), "rotation": asdict(self.rotation)},
            "re": {span: {what: asdict(each) for what, each in both.items()} for span, both in self.relative.items()},
            "distance": self.distance,
            "duration": self.duration,
            "ate_share": self.share,
            "drift": self.drift,
            "matched": len(self.time),
        }
        return without_nan(figures)


def evaluate_trajectory(
    estimate: PoseTrajectory3D,
    reference: PoseTrajectory3D,
    *,
    in_plane: bool = True,
    association: Association = "interpolate",
    names: tuple[str, str] = ("estimate", "reference"),
) -> TrajectoryErrors:
    """Compute the errors of an estimated trajectory against a reference.

    Args:
        estimate, reference: trajectories, see `radarize.io.alignment.load`.
        in_plane: compare x, y and yaw only, for planar estimates; else all six degrees of freedom.
        association: see `radarize.io.alignment.matched`.
        names: names of both trajectories in error messages.

    Raises:
        InputError: fewer than three matching poses, or poses that are not finite.
    """
    estimate, reference = matched(estimate, reference, association, names)
    if in_plane:
        estimate, reference = planar(estimate), planar(reference)
    # Relative errors do not depend on the alignment, absolute ones do.
    ways = _transforms(reference), _transforms(estimate)
    relative = {span: _statistics(_relative_errors(*ways, pairs)) for span, pairs in _pairs(reference).items()}
    last = _relative_errors(*ways, np.array([[0, len(reference.timestamps) - 1]]))
    turn, shift = alignment(estimate, reference, in_plane)
    aligned = moved(estimate, turn, shift)
    errors = ways[0].inv() * _transforms(aligned)
    position_errors = np.linalg.norm(errors.translation, axis=1)
    rotation_errors = errors.rotation.magnitude()
    distance = float(reference.path_length)
    return TrajectoryErrors(
        position=Statistics.of(position_errors),
        rotation=Statistics.of(rotation_errors),
        relative=relative,
        distance=distance,
        duration=float(reference.timestamps[-1] - reference.timestamps[0]),
        share=float(position_errors.mean() / distance) if distance else np.nan,
        drift=float(np.linalg.norm(last.translation) / distance) if distance else np.nan,
        time=reference.timestamps,
        position_errors=position_errors,
        rotation_errors=rotation_errors,
        estimate=aligned,
        reference=reference,
        turn=turn,
        shift=shift,
    )


def _transforms(path: PoseTrajectory3D) -> RigidTransform:
    attitudes = Rotation.from_quat(path.orientations_quat_wxyz, scalar_first=True)
    return RigidTransform.from_components(path.positions_xyz, attitudes)


def _pairs(reference: PoseTrajectory3D) -> dict[str, np.ndarray]:
    """Return index pairs (first, second) of poses one frame, one second and one metre of the reference apart."""
    frames = np.arange(reference.num_poses)
    return {
        "frame": np.column_stack([frames[:-1], frames[1:]]),
        "second": _apart(reference.timestamps, SECOND),
        "metre": _apart(reference.distances, METRE),
    }


def _apart(values: np.ndarray, delta: float) -> np.ndarray:
    """Return index pairs of poses whose values differ by `delta` within the tolerance."""
    wanted = values + delta
    after = np.clip(np.searchsorted(values, wanted), 1, len(values) - 1)
    nearest = np.where(wanted - values[after - 1] < values[after] - wanted, after - 1, after)
    good = (np.abs(values[nearest] - wanted) <= TOLERANCE * delta) & (wanted <= values[-1] + 1e-9)
    return np.column_stack([np.flatnonzero(good), nearest[good]])


def _relative_errors(reference: RigidTransform, estimate: RigidTransform, pairs: np.ndarray) -> RigidTransform:
    """Return the estimated motion between the poses of each pair, relative to the true one."""
    first, second = pairs.T
    true, estimated = (path[first].inv() * path[second] for path in (reference, estimate))
    return true.inv() * estimated


def _statistics(errors: RigidTransform) -> dict[str, Statistics]:
    shifts = np.linalg.norm(errors.translation, axis=1)
    return {"position": Statistics.of(shifts), "rotation": Statistics.of(errors.rotation.magnitude())}


@overload
def without_nan(content: dict[str, object]) -> dict[str, object]: ...


@overload
def without_nan(content: object) -> object: ...


def without_nan(content: object) -> object:
    """Convert to plain data, with None for numbers that are not finite, which JSON cannot represent."""
    if isinstance(content, dict):
        return {key: without_nan(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [without_nan(value) for value in content]
    if isinstance(content, float | np.floating):
        return float(content) if np.isfinite(content) else None
    return content
