"""Peaks between samples."""

from numba.extending import register_jitable


@register_jitable
def vertex(left: float, middle: float, right: float) -> float:
    """Offset, in steps, of the vertex of the parabola through three values a step apart; 0 where it is no peak."""
    bend = left - 2 * middle + right
    return 0.5 * (left - right) / bend if bend < -1e-9 else 0.0
