"""Mounting of the sensor on its carrier, as far as the motion determines it.

Height comes from the floor's echoes. Yaw and lever arm come from a carrier on wheels, which rolls straight ahead: a
sensor with yaw psi at l_x ahead of the axle moves with v_y cos(psi) + v_x sin(psi) = omega l_x. A pedestrian also steps
sideways, so that neither is observable. The lateral position of the sensor changes only the speed in turns, which
nothing else measures.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.channels import PARTS, Waves
from radarize.pipeline.calibration.egomotion import LEAN, PURE, TILT, EgoMotion

#: m/s, minimum speed at which the direction of motion is used; rad/s, minimum standard deviation of yaw rate.
_MOVING, _TURNING = 0.2, np.radians(5.0)
#: m/s, maximum sideways speed of a carrier on wheels.
_ROLLS = 0.04
#: Heights that are tried for the floor (m below the sensor), their spacing, and standard deviation of elevation (rad).
_FLOOR, _STEP, _BLUR = (0.1, 2.0), 0.01, 0.05
#: Minimum sine of depression, below which echoes are those of walls; minimum number of echoes; minimum ratio of their
#: density at the floor to that above and below it.
_BELOW, _ECHOES, _STANDS_OUT = 0.25, 60, 1.25


class Estimate(NamedTuple):
    """A value with its standard error, or the reason why it is unknown."""

    value: float = np.nan
    error: float = np.inf
    why: str = ""


def roll(motion: EgoMotion, yaw: Float[np.ndarray, "frame"], period: float) -> tuple[Estimate, Estimate]:
    """Estimate yaw (rad) and forward lever arm (m) of a sensor on wheels, from headings (rad) at each frame."""
    turning = np.gradient(yaw) / period if len(yaw) > 1 else np.zeros(len(yaw))
    forward, sideways = motion.velocity[:, 0], motion.velocity[:, 1]
    used = np.flatnonzero(motion.seen & (np.hypot(forward, sideways) > _MOVING))
    if len(used) < 3 * PARTS:
        return (Estimate(why="the walk is too short"),) * 2
    columns, right = np.stack([-forward, turning], axis=1)[used], sideways[used]
    weight = np.ones(len(used))
    for _ in range(10):
        solved = np.linalg.lstsq(columns * weight[:, None] ** 0.5, right * weight**0.5, rcond=None)[0]
        off = right - columns @ solved
        weight = 1 / (1 + off**2 / (3 * _ROLLS) ** 2) ** 2
    if np.sqrt(np.mean(off**2)) > _ROLLS or abs(solved[0]) > np.radians(45):
        return (Estimate(why="the carrier does not roll straight ahead, it also moves sideways"),) * 2
    parts = np.array_split(np.arange(len(used)), PARTS)
    without = [
        np.linalg.lstsq(np.delete(columns, part, axis=0), np.delete(right, part), rcond=None)[0] for part in parts
    ]
    error = np.sqrt((PARTS - 1) * np.var(without, axis=0))
    still = np.std(turning[used]) < _TURNING
    lever = Estimate(why="the walk hardly turns") if still else Estimate(float(solved[1]), float(error[1]))
    return Estimate(float(np.arctan(solved[0])), float(error[0])), lever


def height(cells: Cells, waves: Waves, motion: EgoMotion, bias: float) -> Estimate:
    """Estimate the height of the sensor above the floor, m: echoes end at the floor, and are dense just above it."""
    left, up = motion.directions.T
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 0.02))
    away = cells.range - bias
    under = -away * (up + motion.values[TILT] * ahead + motion.values[LEAN] * left)
    used = (waves.purity > PURE) & (under > _BELOW * away) & (under < 1.5 * _FLOOR[1])
    if np.count_nonzero(used) < _ECHOES:
        return Estimate(why="too few echoes come from below the sensor")
    found = _edge(under[used], away[used])
    if found is None:
        return Estimate(why="the floor's echoes do not stand out")
    return found


def _edge(under: np.ndarray, away: np.ndarray) -> Estimate | None:
    """Return the depth of the floor, or None if no depth stands out.

    It lies between the depth at which echoes are densest, since objects stand on the floor, and the depth below it at
    which they are half as dense, since elevations are blurred.
    """
    depths = np.arange(*_FLOOR, _STEP)
    blur = _BLUR * away[:, None]
    density = (np.exp(-((under[:, None] - depths) ** 2) / 2 / blur**2) / blur).sum(axis=0)
    peaks = np.flatnonzero((density[1:-1] > density[:-2]) & (density[1:-1] >= density[2:])) + 1
    for k in peaks[np.argsort(-density[peaks])]:
        if density[k] > _STANDS_OUT * density[:k].min() and density[k] > _STANDS_OUT * density[k:].min():
            fall = depths[k + np.argmax(density[k:] < density[k] / 2)]
            return Estimate(float(depths[k] + fall) / 2, max(float(fall - depths[k]) / 2, _BLUR / 2))
    return None
