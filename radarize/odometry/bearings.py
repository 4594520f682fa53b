"""Heading from the bearings of strong echoes that are tracked from frame to frame, and from directions of walls.

The bearing of an echo in the world frame is the heading plus its bearing in the sensor frame. For a point scatterer or
a corner it changes by the parallax: cross-range velocity over range, integrated. For a wall's specular reflection it
stays the wall's normal wherever the sensor moves. One number distinguishes the two, the share of the parallax by which
the bearing changes: 1 or 0. This share and the bearing in the world frame are states of the filter. All measurements
that observe the heading therefore help to classify an echo, above all other echoes. A tracked echo observes the total
rotation since its first detection, so errors do not accumulate from frame to frame. Range and Doppler shift cannot
distinguish the two types: a translation along a wall and a circle around a point scatterer look the same.

Wall directions are remembered. Most walls of a building are at right angles. A wall that is observed again, or one at a
right angle to it, therefore observes the heading drift since then, if the association is unambiguous. In a building
without right angles it is ambiguous, and no correction is made.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from radarize.io.pose import wrap
from radarize.odometry.echoes import Echo
from radarize.odometry.rightangles import associate_direction, from_right_angle
from radarize.odometry.smoother import Gaussian, Row
from radarize.signal.heatmaps import Heatmaps

#: Index of the heading in the state of the filter.
YAW = 0
#: Maximum errors of the predicted echo for an association in the next frame: range (m), speed (m/s), bearing (standard
#: deviations).
_MAX_RANGE_CHANGE, _MAX_SPEED_ERROR, _SIGMAS = 0.06, 0.25, 2.5
#: Standard deviation of a measured sine of azimuth as a share of the beam width; random walk of a bearing in the world
#: frame, rad/s^0.5.
_SINE_NOISE, _BEARING_WALK = 0.04, np.radians(0.3)
#: Maximum number of tracked echoes; time without detection after which a track ends, s; distance (m, rad) below which
#: two echoes are one. Below 4.8 frames/s no echo is tracked, because associations there are often wrong.
_MAX_TRACKED, _MAX_AGE, _DUPLICATE = 8, 0.21, (0.1, np.radians(10.0))
#: Share of the parallax of specular reflections (0) and point scatterers (1); size of a point scatterer, m; standard
#: deviations of the share before and after the classification, per type. Size over range is added to the latter.
_KIND_SHARES, _SCATTERER_SIZE = np.array([0.0, 1.0]), 0.02
_SHARE_STD_BEFORE, _SHARE_STD_AFTER = np.array([0.02, 0.06]), np.array([0.003, 0.015])
#: Classification of an echo: minimum log-odds, maximum standard deviation of its share; number of standard deviations
#: from both types beyond which the echo is dropped, such as a double bounce or a moving object.
_MIN_LOG_ODDS, _MAX_SHARE_STD, _NEITHER_SIGMAS = 10.0, 0.245, 3.5
#: Minimum number of frames before a wall is associated with a direction; standard deviation of walls from right angles,
#: rad; maximum number of remembered directions.
_MIN_FRAMES, _RIGHT_ANGLE_STD, _MAX_DIRECTIONS = 5, np.radians(0.5), 6


@dataclass
class TrackedEcho:
    """An echo that is tracked from frame to frame.

    Attributes:
        echo: last detection, with its range predicted to the current frame.
        seen: time of the last detection, s.
        frames: number of frames with a detection.
        parallax: rad, change of the bearing since the first detection if it is a point scatterer.
        kind: 0, a wall's specular reflection; 1, a point scatterer; None before the classification.
        wall_associated: its wall was compared with the remembered directions.
    """

    echo: Echo
    seen: float
    frames: int = 1
    parallax: float = 0.0
    kind: int | None = None
    wall_associated: bool = False


class BearingTracker:
    """Tracker of echoes by range and bearing; frames are pushed in order.

    Args:
        heatmaps: of the radar.
        state: filter, which the caller shares; its heading is at `YAW`. The tracker appends the normals of the
            remembered walls, then the bearing in the world frame at the first detection and the share of the parallax
            of each tracked echo.
        right_angles: correct the heading by walls that are observed again.
    """

    def __init__(self, heatmaps: Heatmaps, state: Gaussian, right_angles: bool = True):
        self._state, self._first = state, len(state.mean)
        self._span, self._right_angles = 2 * heatmaps.config.max_velocity, right_angles
        self._range = max(_MAX_RANGE_CHANGE, (heatmaps.ranges[1] - heatmaps.ranges[0]) / 2)
        self._noise = _SINE_NOISE * 2 / max(len(heatmaps.row), 1)  # antenna spacing: half a wavelength
        self._walls: list[int] = []  # number of walls of each direction
        self._tracked: list[TrackedEcho] = []
        self._time = -np.inf

    @property
    def specular_ranges(self) -> list[float]:
        """Ranges of the walls' specular reflections in the last frame, m."""
        return [each.echo.range for each in self._tracked if each.kind == 0 and each.seen == self._time]

    def predict(self, dt: float, velocity: Float[np.ndarray, "2"]) -> None:
        """Predict ranges and parallaxes `dt` s later, at a velocity (m/s, sensor frame); the heading is predicted by
        the caller."""
        for k, each in enumerate(self._tracked):
            bearing = float(self._row(k) @ self._state.mean)
            ahead = np.array([np.cos(bearing), np.sin(bearing)])
            away = each.echo.range - dt * float(velocity @ ahead)
            each.echo = each.echo._replace(range=away)
            each.parallax -= dt * float(velocity[1] * ahead[0] - velocity[0] * ahead[1]) / max(away, 0.1)
            self._state.covariance[self._index(k), self._index(k)] += _BEARING_WALK**2 * dt

    def update(self, time: float, echoes: Sequence[Echo], velocity: Float[np.ndarray, "2"]) -> bool:
        """Correct the filter by a frame's echoes; False if no classified echo is detected, so that the heading is
        unobservable."""
        self._time, observed = time, False
        self._keep_only([k for k, each in enumerate(self._tracked) if time - each.seen < _MAX_AGE])
        new = [echo for echo in echoes if self._is_static(echo, velocity)]
        for k, each in enumerate(self._tracked):
            if (echo := self._associate(k, each, new)) is not None:
                new.remove(echo)
                each.echo, each.seen, each.frames = echo, time, each.frames + 1
                observed |= each.kind is not None
        self._keep_only([k for k, each in enumerate(self._tracked) if self._classify(k, each)])
        for echo in new:
            if len(self._tracked) < _MAX_TRACKED and not any(self._is_duplicate(echo, each) for each in self._tracked):
                self._start(echo)
        for k, each in enumerate(self._tracked if self._right_angles else ()):
            if each.kind == 0 and not each.wall_associated and each.seen == time and each.frames > _MIN_FRAMES:
                each.wall_associated = True
                self._associate_wall(k)
        return observed

    def _index(self, k: int) -> int:
        return self._first + len(self._walls) + 2 * k

    def _row(self, k: int) -> Row:
        """Row of the filter for the k-th bearing in the sensor frame."""
        place = self._index(k)
        return self._state.row({place: 1.0, place + 1: self._tracked[k].parallax, YAW: -1.0})

    def _variance(self, echo: Echo) -> float:
        return (self._noise / np.cos(echo.bearing)) ** 2

    def _is_duplicate(self, echo: Echo, each: TrackedEcho) -> bool:
        off = abs(each.echo.range - echo.range), abs(each.echo.bearing - echo.bearing)
        return each.seen == self._time and off[0] < _DUPLICATE[0] and off[1] < _DUPLICATE[1]

    def _is_static(self, echo: Echo, velocity: Float[np.ndarray, "2"]) -> bool:
        closing = velocity[0] * np.cos(echo.bearing) + velocity[1] * np.sin(echo.bearing)
        return abs((echo.speed - closing + self._span / 2) % self._span - self._span / 2) < _MAX_SPEED_ERROR

    def _associate(self, k: int, each: TrackedEcho, new: list[Echo]) -> Echo | None:
        """Associate the k-th track with one of the new echoes, and correct the filter by its bearing; None if there is
        none."""
        near = [echo for echo in new if abs(echo.range - each.echo.range) < self._range]
        if not near:
            return None
        row = self._row(k)
        expected = float(row @ self._state.mean)
        echo = min(near, key=lambda echo: abs(wrap(echo.bearing - expected)))
        off, variance = float(wrap(echo.bearing - expected)), self._variance(echo)
        if off**2 > _SIGMAS**2 * (self._state.variance(row) + variance):
            return None
        self._state.update(row, off, variance)
        return echo

    def _classify(self, k: int, each: TrackedEcho) -> bool:
        """Classify the k-th track if it is unambiguous; False if it is neither type."""
        if each.kind is not None or each.parallax == 0:
            return True
        place = self._index(k) + 1
        share, variance = self._state.mean[place], self._state.covariance[place, place]
        log_likelihood = -((share - _KIND_SHARES) ** 2) / (variance + _SHARE_STD_BEFORE**2) / 2
        if log_likelihood.max() < -(_NEITHER_SIGMAS**2) / 2:
            return False
        if abs(log_likelihood[0] - log_likelihood[1]) > _MIN_LOG_ODDS and variance < _MAX_SHARE_STD**2:
            each.kind = int(log_likelihood.argmax())
            off = np.hypot(_SHARE_STD_AFTER[each.kind], each.kind * _SCATTERER_SIZE / each.echo.range)
            self._state.update(self._state.row({place: 1.0}), _KIND_SHARES[each.kind] - share, off**2)
        return True

    def _keep_only(self, kept: list[int]) -> None:
        if len(kept) < len(self._tracked):
            places = [place for k in kept for place in (self._index(k), self._index(k) + 1)]
            self._state.keep([*range(self._index(0)), *places])
            self._tracked = [self._tracked[k] for k in kept]

    def _start(self, echo: Echo) -> None:
        """Start a track. Its share of the parallax is 0.5 +- 0.5 before the classification."""
        state, end = self._state, len(self._state.mean)
        state.add(end, state.row({YAW: 1.0}), echo.bearing, self._variance(echo))
        state.add(end + 1, state.row({}), 0.5, 0.5**2)
        self._tracked.append(TrackedEcho(echo, self._time))

    def _associate_wall(self, k: int) -> None:
        """Associate the wall of the k-th track with the remembered directions."""
        state, place = self._state, self._index(k)
        rows = [state.row({place: 1.0, self._first + wall: -1.0}) for wall in range(len(self._walls))]
        off = -from_right_angle(np.array([row @ state.mean for row in rows]))
        variances = np.array([state.variance(row) + _RIGHT_ANGLE_STD**2 for row in rows])
        direction = associate_direction(off, variances, self._walls)
        if direction is None:
            return
        if direction < len(rows):
            state.update(rows[direction], off[direction], _RIGHT_ANGLE_STD**2)
            self._walls[direction] += 1
            return
        if len(self._walls) == _MAX_DIRECTIONS:
            rarest = int(np.argmin(self._walls))
            state.keep([place for place in range(len(state.mean)) if place != self._first + rarest])
            self._walls.pop(rarest)
        state.add(self._index(0), state.row({self._index(k): 1.0}), 0.0, 0.0)
        self._walls.append(1)
