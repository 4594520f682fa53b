"""Intersection of a ray with a rigid part of a mover."""

import numpy as np
from numba import njit


@njit
def crossing(origin, way, turn, center, half, capsule):
    """Distances along a ray at which it enters and leaves a part, m; inf and -inf if it misses."""
    # In scalars: most rays miss the bounding sphere, and arrays would take longer than the test.
    x, y, z = center[0] - origin[0], center[1] - origin[1], center[2] - origin[2]
    along = x * way[0] + y * way[1] + z * way[2]
    square = (half[2] + half[0]) ** 2 if capsule else half[0] ** 2 + half[1] ** 2 + half[2] ** 2
    if x * x + y * y + z * z - along * along > square:
        return np.inf, -np.inf
    towards = (x, y, z)
    a, d = np.zeros(3), np.zeros(3)  # in the part's own frame
    for k in range(3):
        for j in range(3):
            a[k] -= turn[j, k] * towards[j]
            d[k] += turn[j, k] * way[j]
    return _capsule(a, d, half) if capsule else _box(a, d, half)


@njit
def _box(a, d, half):
    """Intersect a box by the slab method."""
    low, high = -np.inf, np.inf
    for k in range(3):
        if abs(d[k]) < 1e-12:
            if abs(a[k]) > half[k]:
                return np.inf, -np.inf
            continue
        first, second = (-half[k] - a[k]) / d[k], (half[k] - a[k]) / d[k]
        low, high = max(low, min(first, second)), min(high, max(first, second))
    return (low, high) if low <= high else (np.inf, -np.inf)


@njit
def _capsule(a, d, half):
    """Intersect a capsule: a cylinder about z and a sphere at either end, together convex."""
    radius, length = half[0], half[2]
    low, high = np.inf, -np.inf
    across = d[0] * d[0] + d[1] * d[1]
    b = a[0] * d[0] + a[1] * d[1]
    root = b * b - across * (a[0] * a[0] + a[1] * a[1] - radius * radius)
    if across > 1e-12 and root >= 0:
        for s in ((-b - np.sqrt(root)) / across, (-b + np.sqrt(root)) / across):
            if abs(a[2] + s * d[2]) <= length:
                low, high = min(low, s), max(high, s)
    for end in (-length, length):
        z = a[2] - end
        c = b + z * d[2]
        root = c * c - (a[0] * a[0] + a[1] * a[1] + z * z - radius * radius)
        if root >= 0:
            low, high = min(low, -c - np.sqrt(root)), max(high, -c + np.sqrt(root))
    return low, high
