"""Turns told by the bearings of strong echoes that are followed from frame to frame, and by walls that are met again.

The bearing of an echo in the world is the heading plus its bearing in the sensor's frame. For a post or a corner it
moves by its parallax, the velocity across over the range; for a wall's specular flash it stays the wall's normal
wherever the sensor goes. One number tells the two apart, the share of its parallax by which an echo moves: 1 or 0. It
is a number of the filter, as is the echo's bearing in the world, so that whatever tells of turns tells which of the two
an echo is, other echoes above all; and as long as it is followed it tells of the whole turn since it was first seen, so
that errors do not add up from frame to frame. Range and Doppler shift cannot tell: a slide along a wall and a circle
about a post look the same.

Walls are remembered. Most of a building's stand at right angles, so one that is met says how far the heading has
drifted since another one was seen, where it is hardly in doubt which one that was: in a building without right angles
nothing is told.
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

#: Place of the heading in the filter.
YAW = 0
#: m and m/s: by how much an echo may be off what is expected of it in the next frame to be taken for the same; of its
#: bearing, standard deviations.
_MAX_RANGE_CHANGE, _MAX_SPEED_ERROR, _SIGMAS = 0.06, 0.25, 2.5
#: Standard deviation of a sine as a share of the beam's width, and rad/s^0.5: what a bearing in the world wanders.
_SINE_NOISE, _BEARING_WALK = 0.04, np.radians(0.3)
#: Maximum number of echoes; s without detection after which one is no longer followed; nearer to each other, m and rad,
#: they are one. Below 4.8 frames a second so none is followed: what is taken for the same echo there is often another.
_MAX_TRACKED, _MAX_AGE, _DUPLICATE = 8, 0.21, (0.1, np.radians(10.0))
#: Shares of parallax: standard deviations by which those of flashes and posts may differ from 0 and 1 until it is
#: known which of them they are, and from then on; a scatterer of `_SCATTERER_SIZE`, m, adds to that.
_KIND_SHARES, _SHARE_STD_BEFORE, _SHARE_STD_AFTER, _SCATTERER_SIZE = (
    np.array([0.0, 1.0]),
    np.array([0.02, 0.06]),
    np.array([0.003, 0.015]),
    0.02,
)
#: Log-odds from which on an echo is one of the two, its share being known this well, and standard deviations from both
#: beyond which it is neither, such as a path over two walls or something that moves.
_MIN_LOG_ODDS, _MAX_SHARE_STD, _NEITHER_SIGMAS = 10.0, 0.245, 3.5
#: Frames in which a wall was seen before its normal counts; rad, by which normals of walls are not quite at right
#: angles; directions remembered.
_MIN_FRAMES, _RIGHT_ANGLE_STD, _MAX_DIRECTIONS = 5, np.radians(0.5), 6


@dataclass
class TrackedEcho:
    """An echo that is followed.

    Attributes:
        echo: as it was seen last, its range kept up to now.
        seen: when that was, s.
        frames: in which it was.
        parallax: rad, by what the bearing of a post would have moved since it was seen first.
        kind: 0, a wall's flash; 1, a post; None as long as nobody knows.
        met: its wall was looked up among those that are remembered.
    """

    echo: Echo
    seen: float
    frames: int = 1
    parallax: float = 0.0
    kind: int | None = None
    wall_associated: bool = False


class BearingTracker:
    """Follows echoes; frames are pushed in order.

    Args:
        heatmaps: of the radar.
        state: the filter, whose numbers so far are others', the heading at `YAW`. Behind them stand normals of walls
            that are remembered, then of each followed echo its bearing in the world at first, and its share.
        right_angles: walls seen again correct the heading.
    """

    def __init__(self, heatmaps: Heatmaps, state: Gaussian, right_angles: bool = True):
        self._state, self._first = state, len(state.mean)
        self._span, self._right_angles = 2 * heatmaps.config.max_velocity, right_angles
        self._range = max(_MAX_RANGE_CHANGE, (heatmaps.ranges[1] - heatmaps.ranges[0]) / 2)
        self._noise = _SINE_NOISE * 2 / max(len(heatmaps.row), 1)  # antennas stand half a wavelength apart
        self._walls: list[int] = []  # how many had each of the directions
        self._tracked: list[TrackedEcho] = []
        self._time = -np.inf

    @property
    def specular_ranges(self) -> list[float]:
        """Ranges of the walls' flashes in the last frame, m."""
        return [each.echo.range for each in self._tracked if each.kind == 0 and each.seen == self._time]

    def predict(self, dt: float, velocity: Float[np.ndarray, "2"]) -> None:
        """Let `dt` s pass at a velocity (m/s, sensor frame); the heading has moved already."""
        for k, each in enumerate(self._tracked):
            bearing = float(self._row(k) @ self._state.mean)
            ahead = np.array([np.cos(bearing), np.sin(bearing)])
            away = each.echo.range - dt * float(velocity @ ahead)
            each.echo = each.echo._replace(range=away)
            each.parallax -= dt * float(velocity[1] * ahead[0] - velocity[0] * ahead[1]) / max(away, 0.1)
            self._state.covariance[self._index(k), self._index(k)] += _BEARING_WALK**2 * dt

    def update(self, time: float, echoes: Sequence[Echo], velocity: Float[np.ndarray, "2"]) -> bool:
        """Correct the filter by a frame's echoes; False if nothing known is among them, so that they tell no turn."""
        self._time, told = time, False
        self._drop_others([k for k, each in enumerate(self._tracked) if time - each.seen < _MAX_AGE])
        new = [echo for echo in echoes if self._is_static(echo, velocity)]
        for k, each in enumerate(self._tracked):
            if (echo := self._associate(k, each, new)) is not None:
                new.remove(echo)
                each.echo, each.seen, each.frames = echo, time, each.frames + 1
                told |= each.kind is not None
        self._drop_others([k for k, each in enumerate(self._tracked) if self._classify(k, each)])
        for echo in new:
            if len(self._tracked) < _MAX_TRACKED and not any(self._is_duplicate(echo, each) for each in self._tracked):
                self._start(echo)
        for k, each in enumerate(self._tracked if self._right_angles else ()):
            if each.kind == 0 and not each.wall_associated and each.seen == time and each.frames > _MIN_FRAMES:
                each.wall_associated = True
                self._associate_wall(k)
        return told

    def _index(self, k: int) -> int:
        return self._first + len(self._walls) + 2 * k

    def _row(self, k: int) -> Row:
        """The k-th followed echo's bearing in the sensor's frame."""
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
        """Which of new echoes the k-th is, if any; the filter learns its bearing."""
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
        """Say what the k-th is, once it is known; False if it is neither a flash nor a post."""
        if each.kind is not None or each.parallax == 0:
            return True
        place = self._index(k) + 1
        share, variance = self._state.mean[place], self._state.covariance[place, place]
        odds = -((share - _KIND_SHARES) ** 2) / (variance + _SHARE_STD_BEFORE**2) / 2
        if odds.max() < -(_NEITHER_SIGMAS**2) / 2:
            return False
        if abs(odds[0] - odds[1]) > _MIN_LOG_ODDS and variance < _MAX_SHARE_STD**2:
            each.kind = int(odds.argmax())
            off = np.hypot(_SHARE_STD_AFTER[each.kind], each.kind * _SCATTERER_SIZE / each.echo.range)
            self._state.update(self._state.row({place: 1.0}), _KIND_SHARES[each.kind] - share, off**2)
        return True

    def _drop_others(self, stay: list[int]) -> None:
        if len(stay) < len(self._tracked):
            places = [place for k in stay for place in (self._index(k), self._index(k) + 1)]
            self._state.keep([*range(self._index(0)), *places])
            self._tracked = [self._tracked[k] for k in stay]

    def _start(self, echo: Echo) -> None:
        """From now on; half of its parallax is as good a guess as any, and flashes and posts are half off."""
        state, end = self._state, len(self._state.mean)
        state.add(end, state.row({YAW: 1.0}), echo.bearing, self._variance(echo))
        state.add(end + 1, state.row({}), 0.5, 0.5**2)
        self._tracked.append(TrackedEcho(echo, self._time))

    def _associate_wall(self, k: int) -> None:
        """Look the k-th's wall up among the directions that are remembered."""
        state, place = self._state, self._index(k)
        rows = [state.row({place: 1.0, self._first + wall: -1.0}) for wall in range(len(self._walls))]
        off = -from_right_angle(np.array([row @ state.mean for row in rows]))
        variances = np.array([state.variance(row) + _RIGHT_ANGLE_STD**2 for row in rows])
        met = associate_direction(off, variances, self._walls)
        if met is None:
            return
        if met < len(rows):
            state.update(rows[met], off[met], _RIGHT_ANGLE_STD**2)
            self._walls[met] += 1
            return
        if len(self._walls) == _MAX_DIRECTIONS:
            rarest = int(np.argmin(self._walls))
            state.keep([place for place in range(len(state.mean)) if place != self._first + rarest])
            self._walls.pop(rarest)
        state.add(self._index(0), state.row({self._index(k): 1.0}), 0.0, 0.0)
        self._walls.append(1)
