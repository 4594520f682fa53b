"""Window functions missing in numpy; scipy.signal has them, but its import takes a fifth of every command's start."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

Window = Float[np.ndarray, "count"]


def periodic(window: Callable[[int], Window], count: int) -> Window:
    """One period of a window of numpy's, which are symmetric, for spectra."""
    return window(count + (count > 1))[:count]  # the next period's first value comes as well; a single value is 1


def taylor(count: int, near: int = 4, level: float = 25.0) -> Window:
    """Taylor window with the `near` first sidelobes at about -`level` dB, 1 in the middle (Carrara, Goodman, Majewski,
    "Spotlight synthetic aperture radar", 1995, appendix D)."""
    if count < 3:
        return np.ones(count)
    a = np.arccosh(10 ** (level / 20)) / np.pi
    m = np.arange(1, near)
    squares = m[:, None] ** 2
    zeros = near**2 / (a**2 + (near - 0.5) ** 2) * (a**2 + (m - 0.5) ** 2)
    others = np.where(m[:, None] == m, 1.0, 1 - squares / m**2)
    waves = -((-1.0) ** m) * (1 - squares / zeros).prod(axis=1) / others.prod(axis=1)  # twice the book's F_m
    place = (np.arange(count) - (count - 1) / 2) / count
    return (1 + waves @ np.cos(2 * np.pi * m[:, None] * place)) / (1 + waves.sum())
