"""Interpolation of peaks between samples."""

from numba.extending import register_jitable


@register_jitable
def vertex(left: float, middle: float, right: float) -> float:
    """Offset, in steps, of the vertex of the parabola through three equally spaced values; 0 where it has no
    maximum."""
    curvature = left - 2 * middle + right
    return 0.5 * (left - right) / curvature if curvature < -1e-9 else 0.0
