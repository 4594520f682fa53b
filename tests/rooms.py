"""A furnished room of point scatterers and a handheld walk through it, for odometry tests."""

import numpy as np
from scipy.interpolate import CubicSpline


def furnished_room(rng: np.random.Generator, size=(7.0, 5.0), boxes: int = 14, density: float = 60.0):
    """Points (n, 3) on walls, boxes, floor and ceiling, sensor height 0, and their complex amplitudes at 1 m."""
    points, strengths = [], []

    def surface(count, corner, a, b, strength):
        count = int(count)
        u, v = rng.random((2, count, 1))
        points.append(np.asarray(corner) + u * np.asarray(a) + v * np.asarray(b))
        strengths.append(strength * np.abs(rng.normal(size=count) + 1j * rng.normal(size=count)))

    w, h = size
    low, high = -1.2, 1.3
    for corner, along in (((0, 0), (w, 0)), ((0, h), (w, 0)), ((0, 0), (0, h)), ((w, 0), (0, h))):
        extent = np.hypot(*along)
        surface(density * extent, (*corner, low), (*along, 0), (0, 0, high - low), 30.0)
        for _ in range(int(1.0 * extent)):  # door frames, pillars, radiators
            at = np.asarray(corner) + rng.random() * np.asarray(along)
            surface(15, (*at, low), (0.06, 0.06, 0), (0, 0, 2.0), 90.0)
    for level in (low, high):
        surface(density * w * h / 3, (0, 0, level), (w, 0, 0), (0, h, 0), 15.0)
    for _ in range(boxes):
        x, y = rng.uniform(0.3, w - 0.3), rng.uniform(0.3, h - 0.3)
        a, b, top = rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.8), rng.uniform(-0.5, 0.6)
        for corner, along in (((x, y), (a, 0)), ((x, y + b), (a, 0)), ((x, y), (0, b)), ((x + a, y), (0, b))):
            surface(density * max(along), (*corner, low), (*along, 0), (0, 0, top - low), 60.0)
    strengths = np.concatenate(strengths)
    return np.concatenate(points), strengths * np.exp(2j * np.pi * rng.random(len(strengths)))


def antenna_gain(points: np.ndarray) -> np.ndarray:
    """Two-way amplitude for points (n, 3) in the sensor frame: spreading loss and a patch antenna's beam."""
    distance = np.linalg.norm(points, axis=1)
    azimuth, elevation = np.arctan2(points[:, 1], points[:, 0]), np.arcsin(points[:, 2] / distance)
    beam = (azimuth / np.radians(28)) ** 2 + (elevation / np.radians(14)) ** 2  # half power at 28 and 14 deg
    return np.maximum(np.exp(-np.log(2) / 2 * beam), 0.01) / np.maximum(distance, 0.3) ** 2


def walk(rng: np.random.Generator, duration: float, size=(7.0, 5.0), speed=0.8, sway=0.02):
    """Pose function of a smooth tour round the room: position (..., 3) and yaw (...), turning up to about 90 deg/s."""
    knots = np.arange(-1.0, duration + 2.5, 1.0)
    w, h = size
    bearing = np.cumsum(np.full(len(knots), speed / (0.25 * (w + h))) * rng.uniform(0.5, 1.5, len(knots)))
    x = w / 2 + 0.27 * w * np.cos(bearing) + rng.normal(0, 0.1, len(knots))
    y = h / 2 + 0.27 * h * np.sin(bearing) + rng.normal(0, 0.1, len(knots))
    path = CubicSpline(knots, np.stack([x, y], axis=1))
    look = bearing + np.pi / 2 + np.cumsum(rng.normal(0, 0.35, len(knots)))
    turn = CubicSpline(knots, look)

    def pose(t):
        t = np.asarray(t, float)
        bob = sway * np.sin(2 * np.pi * 1.9 * t)
        return np.concatenate([path(t), bob[..., None]], axis=-1), turn(t)

    return pose
