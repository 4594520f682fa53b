"""Scan-to-submap matching: Gauss-Newton on a smoothly interpolated grid, with odometry as prior.

The pose T of a scan in a submap minimises

    sum_k ((1 - M(T p_k)) / sigma)^2 + e^T C^-1 e,      e = (R0^T (t - t0), yaw - yaw0)

over the points p_k of the scan. M is the occupancy of the submap; (t0, yaw0) is the pose predicted by odometry and C
its covariance (compare Hess et al., ICRA 2016, eq. CS, which omits the covariance of the prior). M is the quadratic
B-spline over max(2 p - 1, 0) of the cells. Its gradient is continuous and it does not overshoot. As free and unknown
cells are both 0, the ridge along a wall is symmetric.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.slam.grid import OccupancyGrid


class Surface(NamedTuple):
    """Grid in the form of the kernels: probabilities in steps of `unit`, outer corner and cell size in m."""

    probability: np.ndarray
    unit: float
    x: float
    y: float
    resolution: float


@dataclass(frozen=True)
class Match:
    """Result of scan matching.

    Attributes:
        pose: of the scan in the frame of the grid.
        score: mean occupancy M at the points, 0...1.
        information: of the scan alone, without the prior, for (x, y, yaw) in the frame of the scan.
    """

    pose: Float[np.ndarray, "3"]
    score: float
    information: Float[np.ndarray, "3 3"]


def match(
    grid: OccupancyGrid,
    points: Float[np.ndarray, "n 2"],
    guess: Float[np.ndarray, "3"],
    *,
    sigma: float,
    prior: Float[np.ndarray, "3"] | None = None,
    covariance: Float[np.ndarray, "3 3"] | None = None,
    iterations: int = 20,
) -> Match:
    """Refine the pose of a scan in a submap.

    Args:
        grid: of the submap.
        points: in the frame of the scan, m.
        guess: initial pose, in the frame of the grid.
        sigma: standard deviation of a residual 1 - M.
        prior, covariance: predicted pose and its covariance for (x, y, yaw) in the frame of that pose; None: no prior.
        iterations: maximum number of iterations.
    """
    weight = np.zeros((3, 3)) if covariance is None else np.linalg.inv(covariance)
    return Match(
        *_refine(
            Surface(grid.probability, grid.unit, grid.origin[0], grid.origin[1], grid.resolution),
            np.ascontiguousarray(points, float),
            np.asarray(guess, float),
            np.asarray(guess if prior is None else prior, float),
            weight,
            1 / sigma**2,
            iterations,
        )
    )


def thin(points: Float[np.ndarray, "n 2"], spacing: float) -> Float[np.ndarray, "m 2"]:
    """Return the mean of the points in every occupied square of the given size (m), so that near walls do not get more
    weight than far ones."""
    if not len(points):
        return points
    cells = np.floor(points / spacing).astype(np.int64)
    _, index, count = np.unique(cells[:, 0] * (1 << 32) + cells[:, 1], return_inverse=True, return_counts=True)
    return np.stack([np.bincount(index, points[:, axis]) / count for axis in (0, 1)], axis=-1)


@numba.njit(cache=True, nogil=True)
def interpolate(probability: np.ndarray, x: float, y: float, unit: float = 1.0) -> tuple[float, float, float]:
    """Return the quadratic B-spline over max(2 p - 1, 0) and its gradient; x, y in cells from the corner of the grid; 0
    outside."""
    rows, columns = probability.shape
    column, row = int(np.floor(x)), int(np.floor(y))
    if column < 1 or row < 1 or column >= columns - 1 or row >= rows - 1:
        return 0.0, 0.0, 0.0
    u, v = x - column - 0.5, y - row - 0.5
    wx = (0.5 * (0.5 - u) ** 2, 0.75 - u * u, 0.5 * (0.5 + u) ** 2)
    wy = (0.5 * (0.5 - v) ** 2, 0.75 - v * v, 0.5 * (0.5 + v) ** 2)
    gx = (u - 0.5, -2 * u, u + 0.5)
    gy = (v - 0.5, -2 * v, v + 0.5)
    value = slope_x = slope_y = 0.0
    for j in range(3):
        for i in range(3):
            p = max(2 * unit * probability[row + j - 1, column + i - 1] - 1, 0)
            value += wy[j] * wx[i] * p
            slope_x += wy[j] * gx[i] * p
            slope_y += gy[j] * wx[i] * p
    return value, slope_x, slope_y


@numba.njit(cache=True, nogil=True)
def _cost(surface, points, pose, prior, prior_weight, weight, hessian, gradient):
    # Compute the Gauss-Newton system at a pose; returns the cost and the mean occupancy.
    hessian[:] = 0
    gradient[:] = 0
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    cost = total = 0.0
    for k in range(len(points)):
        rx = cos * points[k, 0] - sin * points[k, 1]
        ry = sin * points[k, 0] + cos * points[k, 1]
        x, y = (rx + pose[0] - surface.x) / surface.resolution, (ry + pose[1] - surface.y) / surface.resolution
        m, gx, gy = interpolate(surface.probability, x, y, surface.unit)
        total += m
        residual = 1 - m
        cost += weight * residual * residual
        jx, jy = -gx / surface.resolution, -gy / surface.resolution
        jt = -ry * jx + rx * jy
        gradient[0] += weight * jx * residual
        gradient[1] += weight * jy * residual
        gradient[2] += weight * jt * residual
        hessian[0, 0] += weight * jx * jx
        hessian[0, 1] += weight * jx * jy
        hessian[0, 2] += weight * jx * jt
        hessian[1, 1] += weight * jy * jy
        hessian[1, 2] += weight * jy * jt
        hessian[2, 2] += weight * jt * jt
    hessian[1, 0], hessian[2, 0], hessian[2, 1] = hessian[0, 1], hessian[0, 2], hessian[1, 2]
    score = total / max(len(points), 1)
    c0, s0 = np.cos(prior[2]), np.sin(prior[2])
    turn = np.array([[c0, s0, 0.0], [-s0, c0, 0.0], [0.0, 0.0, 1.0]])
    difference = pose - prior
    difference[2] = (difference[2] + np.pi) % (2 * np.pi) - np.pi
    error = turn @ difference
    return cost + error @ prior_weight @ error, score, turn.T @ (prior_weight @ error), turn.T @ prior_weight @ turn


@numba.njit(cache=True, nogil=True)
def _refine(surface, points, guess, prior, prior_weight, weight, iterations):
    # Levenberg-Marquardt: a step that increases the cost is rejected, and the damping raised.
    pose = guess.copy()
    hessian, gradient = np.empty((3, 3)), np.empty(3)
    trial_hessian, trial_gradient = np.empty((3, 3)), np.empty(3)
    cost, score, prior_gradient, prior_hessian = _cost(
        surface, points, pose, prior, prior_weight, weight, hessian, gradient
    )
    damping = 1e-3
    for _ in range(iterations):
        full = hessian + prior_hessian
        for d in range(3):
            full[d, d] += damping * full[d, d] + 1e-6
        step = -np.linalg.solve(full, gradient + prior_gradient)
        trial = pose + step
        new_cost, new_score, new_prior_gradient, new_prior_hessian = _cost(
            surface, points, trial, prior, prior_weight, weight, trial_hessian, trial_gradient
        )
        if new_cost < cost:
            small = np.abs(step[0]) + np.abs(step[1]) < 1e-4 and np.abs(step[2]) < 1e-5
            pose, cost, score = trial, new_cost, new_score
            prior_gradient, prior_hessian = new_prior_gradient, new_prior_hessian
            hessian[:], gradient[:] = trial_hessian, trial_gradient
            damping = max(damping / 10, 1e-6)
            if small:
                break
        else:
            damping *= 10
            if damping > 1e4:
                break
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    frame = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    pose[2] = (pose[2] + np.pi) % (2 * np.pi) - np.pi
    return pose, score, frame.T @ hessian @ frame
