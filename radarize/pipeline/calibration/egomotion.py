"""Velocities of a walk and errors of directions, estimated from echoes of a static world.

An echo from direction u closes at v . u, where v is the velocity of the sensor. A phase that grows linearly along the
array shifts all direction cosines by the same amount. For echoes ahead, a shift to the left looks like a course farther
to the right; for echoes to the side it does not, because their u_x = sqrt(1 - u_y^2 - u_z^2) changes faster. The wide
azimuths of a walk therefore separate the shift from the course. Elevation is constrained twice: the sensor moves
horizontally, so that its tilt shows in its velocity, and the reflections of vertical walls, the strongest of all
echoes, come from the horizon. One robust least-squares problem (Geman-McClure) estimates a velocity per frame, and the
shifts, a scale of azimuth and the tilt of the whole walk.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from radarize.odometry.doppler import DopplerVelocity
from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.channels import PARTS, Array, Waves
from radarize.radar.config import RadarConfig
from radarize.signal.heatmaps import Heatmaps

#: Indices of the unknowns beside the velocities, and their prior standard deviations: shifts of direction cosines to
#: the left and up, scale of the one to the left minus 1, and rotation that raises the sensor's front or its left side,
#: rad.
SHIFT_LEFT, SHIFT_UP, SCALE, TILT, LEAN = VALUES = range(5)
_EXPECTED = np.array([1.0, 1.0, 0.05, np.radians(3.0), np.radians(3.0)])
#: Minimum purity of cells; maximum sine of azimuth; minimum number of cells, and of agreeing ones, per frame.
PURE, _EDGE, _FEWEST = 0.85, 0.95, 8
#: m/s: standard deviation of a measured speed, of vertical velocity (mean zero), and of a velocity (prior).
_SPEED, _CLIMB, _FASTEST = 0.008, 0.15, 10.0
#: Prior standard deviation of elevation direction cosines, about the horizon.
_ELEVATION = 0.4
_ROUNDS, _SIGMAS = 20, 3.0
#: Ratio of standard errors to the scatter between parts of a walk: some errors are common to all parts (8 walks of 20
#: s, handheld and on a cart, in buildings of seeds 701 to 708).
_SHARED = 2.0
#: Echoes of walls: ratio of power to the median cell, purity, minimum range (m), maximum elevation; standard deviation
#: of their elevation, and the one used as weight, larger since many of them come from the same wall.
_STRONG, _SINGLE, _OFF, _FLAT, _LEVEL, _CORRELATED = 1e4, 0.95, 0.8, 0.3, 0.05, 0.1


@dataclass(frozen=True)
class EgoMotion:
    """Velocities of a walk, and errors of directions.

    Attributes:
        velocity: (frame, 3) m/s, sensor frame; the last column is vertical velocity beyond the tilt.
        seen: (frame,) whether the frame's echoes determine a velocity.
        values, error: (value,) `SHIFT_LEFT` to `LEAN`, and standard errors from parts of the walk.
        directions: (cell, 2) corrected direction cosines.
        residual: (cell,) closing speed minus that of a static world, m/s; NaN where the frame has no velocity.
    """

    velocity: Float[np.ndarray, "frame 3"]
    seen: Bool[np.ndarray, "frame"]
    values: Float[np.ndarray, "value"]
    error: Float[np.ndarray, "value"]
    directions: Float[np.ndarray, "cell 2"]
    residual: Float[np.ndarray, "cell"]


def solve(cells: Cells, waves: Waves, array: Array, config: RadarConfig, frames: int) -> EgoMotion:
    """Estimate velocities and direction errors of a walk of `frames` frames."""
    motion = _initial(cells, waves, config, frames)
    noise = array.noise(waves.purity)
    used = (waves.purity > PURE) & motion.seen[cells.frame] & (np.abs(waves.directions[:, 0]) < _EDGE)
    chosen, spread, measured = np.flatnonzero(used), noise[used], waves.directions[used]
    frame, speed, span = cells.frame[used], cells.speed[used], 2 * config.max_velocity
    if not len(chosen):
        return motion
    prior = 1 / _EXPECTED**2
    prior[[axis for axis in (SHIFT_LEFT, SHIFT_UP) if axis not in array.axes]] = np.inf
    free = np.isfinite(prior)
    velocity, values, count = motion.velocity.copy(), np.zeros(len(VALUES)), len(VALUES)
    walls = np.flatnonzero(
        (cells.power > _STRONG)
        & (waves.purity > _SINGLE)
        & (cells.range > _OFF)
        & (waves.directions[:, 1] ** 2 < _FLAT**2)
    )
    walls = walls if 1 in array.axes else walls[:0]
    for _ in range(_ROUNDS):
        off, by_velocity, by_value, variance = _linear(measured, spread, speed, velocity[frame], values)
        off -= span * np.rint(off / span)
        weight = 1 / (1 + off**2 / variance / _SIGMAS**2) ** 2 / variance
        # Velocities are eliminated frame by frame, which leaves a small system for the values of the walk.
        a, b, c = np.zeros((frames, 3, 3)), np.zeros((frames, 3, count)), np.zeros((frames, count, count))
        right, rest = np.zeros((frames, 3)), np.zeros((frames, count))
        weighted = weight[:, None] * by_velocity
        np.add.at(a, frame, weighted[:, :, None] * by_velocity[:, None])
        np.add.at(b, frame, weighted[:, :, None] * by_value[:, None])
        np.add.at(c, frame, weight[:, None, None] * by_value[:, :, None] * by_value[:, None])
        np.add.at(right, frame, weighted * off[:, None])
        np.add.at(rest, frame, (weight * off)[:, None] * by_value)
        _level(waves.directions[walls], values, cells.frame[walls], c, rest)
        a += np.diag([_FASTEST**-2, _FASTEST**-2, _CLIMB**-2])
        right[:, 2] -= velocity[:, 2] / _CLIMB**2
        inverse = np.linalg.inv(a)
        normal = (c - b.transpose(0, 2, 1) @ inverse @ b)[:, free][:, :, free]
        rest = (rest - (b.transpose(0, 2, 1) @ (inverse @ right[..., None]))[..., 0])[:, free]
        total, sum_ = normal.sum(axis=0) + np.diag(prior[free]), rest.sum(axis=0) - (prior * values)[free]
        step = np.zeros(count)
        step[free] = np.linalg.solve(total, sum_)
        values = values + step
        velocity += (inverse @ (right - b @ step)[..., None])[..., 0]
    error = np.zeros(count)
    error[free] = _jackknife(normal, rest, total, sum_)
    directions = waves.directions.copy()
    directions -= values[:2]
    directions[:, 0] *= 1 + values[SCALE]
    found = replace(motion, velocity=velocity, values=values, error=error, directions=directions)
    return replace(found, residual=_residual(cells, found, span))


def _initial(cells: Cells, waves: Waves, config: RadarConfig, frames: int) -> EgoMotion:
    """Return initial velocities frame by frame, estimated as in odometry."""
    estimator = DopplerVelocity(Heatmaps(config))
    velocity, seen = np.zeros((frames, 3)), np.zeros(frames, bool)
    pure = np.flatnonzero(waves.purity > PURE)
    for group in np.split(pure, np.flatnonzero(np.diff(cells.frame[pure])) + 1):
        if len(group) < _FEWEST:
            continue
        columns = cells.range[group], cells.speed[group], *waves.directions[group].T
        echoes = np.column_stack([*columns, np.full(len(group), 0.003), 10 * cells.power[group], waves.purity[group]])
        found, covariance, inliers = estimator.solve(echoes)
        number = cells.frame[group[0]]
        velocity[number, :2] = found
        seen[number] = inliers >= _FEWEST and np.linalg.eigvalsh(covariance)[-1] < 0.3**2
    nothing = np.full(len(cells), np.nan)
    return EgoMotion(velocity, seen, np.zeros(len(VALUES)), np.full(len(VALUES), np.inf), waves.directions, nothing)


def _linear(
    measured: np.ndarray, spread: np.ndarray, speed: np.ndarray, velocity: np.ndarray, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return closing speed minus expected one, its derivatives with opposite sign, and its variance."""
    left = (1 + values[SCALE]) * (measured[:, 0] - values[SHIFT_LEFT])
    up = measured[:, 1] - values[SHIFT_UP]
    # Measurement errors bias a fit (see `radarize.odometry.doppler`), so the expected direction is used instead.
    kept = _ELEVATION**2 / (_ELEVATION**2 + spread[:, 1] ** 2)
    up, leftover = kept * up, kept * spread[:, 1] ** 2 + spread[:, 0] ** 2
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2 - leftover, 0.02))
    forward, sideways = velocity[:, 0], velocity[:, 1]
    climb = velocity[:, 2] - values[TILT] * forward - values[LEAN] * sideways
    off = speed - (forward * ahead + sideways * left + climb * up)
    by_left, by_up = sideways - forward * left / ahead, climb - forward * up / ahead
    variance = _SPEED**2 + (by_left * spread[:, 0]) ** 2 + (by_up * spread[:, 1]) ** 2
    variance += 0.5 * (spread[:, 1] ** 2 * forward / ahead) ** 2
    by_velocity = np.stack([ahead - values[TILT] * up, left - values[LEAN] * up, up], axis=1)
    by_scale = by_left * (measured[:, 0] - values[SHIFT_LEFT])
    by_value = np.stack([-by_left, -by_up, by_scale, -forward * up, -sideways * up], axis=1)
    return off, by_velocity, by_value, variance


def _level(
    directions: np.ndarray, values: np.ndarray, frame: np.ndarray, normal: np.ndarray, right: np.ndarray
) -> None:
    """Add to the equations of each frame that walls are vertical: their reflections come from the horizon."""
    left, up = (1 + values[SCALE]) * (directions[:, 0] - values[SHIFT_LEFT]), directions[:, 1] - values[SHIFT_UP]
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 0.02))
    over = values[TILT] * ahead + values[LEAN] * left + up
    weight = 1 / (1 + over**2 / _LEVEL**2 / _SIGMAS**2) ** 2 / _CORRELATED**2
    columns = np.zeros((len(over), len(VALUES)))
    columns[:, SHIFT_UP], columns[:, TILT], columns[:, LEAN] = 1.0, -ahead, -left
    np.add.at(normal, frame, weight[:, None, None] * columns[:, :, None] * columns[:, None])
    np.add.at(right, frame, (weight * over)[:, None] * columns)


def _jackknife(normal: np.ndarray, rest: np.ndarray, total: np.ndarray, sum_: np.ndarray) -> Float[np.ndarray, "value"]:
    """Return standard errors from solutions without each part of the walk; echoes last over many frames."""
    parts = np.array_split(np.arange(len(normal)), PARTS)
    without = [np.linalg.solve(total - normal[k].sum(axis=0), sum_ - rest[k].sum(axis=0)) for k in parts]
    formal = np.diag(np.linalg.inv(total))
    return _SHARED * np.sqrt(np.maximum((PARTS - 1) * np.var(without, axis=0), formal))


def _residual(cells: Cells, motion: EgoMotion, span: float) -> Float[np.ndarray, "cell"]:
    left, up = motion.directions.T
    velocity = motion.velocity[cells.frame]
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 0.02))
    climb = velocity[:, 2] - motion.values[[TILT, LEAN]] @ velocity[:, :2].T
    off = cells.speed - (velocity[:, 0] * ahead + velocity[:, 1] * left + climb * up)
    return np.where(motion.seen[cells.frame], off - span * np.rint(off / span), np.nan)
