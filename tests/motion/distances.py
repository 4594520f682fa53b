"""Distance from points to triangles by brute force, sharing nothing with the planner."""

import numpy as np

from radarsim.world.scene import Scene


def least_distance(points: np.ndarray, triangles: np.ndarray, reach: float = 0.5) -> np.ndarray:
    """Distance of each of points (n, 3) to the nearest of triangles (t, 3, 3) in float64; inf beyond `reach` m."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    result = np.full(len(points), np.inf)
    for i, point in enumerate(points):
        near = np.all((low < point + reach) & (high > point - reach), axis=1)
        if near.any():
            result[i] = _to_triangles(point, triangles[near]).min()
    return np.where(result <= reach, result, np.inf)


def _to_triangles(point: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    edges = np.roll(triangles, -1, axis=1) - triangles
    toward = point - triangles
    share = np.sum(toward * edges, axis=2) / np.maximum(np.sum(edges**2, axis=2), 1e-18)
    to_edges = np.linalg.norm(toward - np.clip(share, 0, 1)[..., None] * edges, axis=2).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-18)
    above = np.sum(toward[:, 0] * normal, axis=1)
    sides = np.sum(np.cross(edges, toward) * normal[:, None], axis=2)
    return np.where(np.all(sides >= 0, axis=1), np.abs(above), to_edges)


def obstacles(scene: Scene) -> np.ndarray:
    """Triangles of everything that rises 4 cm above a floor at z = 0."""
    return scene.triangles[scene.triangles[:, :, 2].max(axis=1) > 0.04]


def column(places: np.ndarray, low: float, high: float, step: float = 0.1) -> np.ndarray:
    """Points (n * heights, 3) above places (n, 2), from `low` to `high` m."""
    heights = np.arange(low, high + step / 2, step)
    return np.column_stack([np.repeat(places, len(heights), axis=0), np.tile(heights, len(places))])
