"""Unevenness of walls: its effect on their specular reflection.

A plastered wall keeps within some millimetres of its plane: DIN 18202, table 3, row 6, allows 3 mm between points 10 cm
apart, 5 mm at 1 m, 10 mm at 4 m. Here its height z over the plane is a smooth random field of the world, with a
Gaussian correlation exp(-r^2 / L^2) at two scales: waves of the float over half a metre, and ripples of some tenths of
a millimetre within a Fresnel zone. It is a sum of plane waves (`Heights`), so it costs nothing to keep, and
neighbouring parts of one wall share it.

The specular reflection of a wall at distance h is Kirchhoff's integral over it. Over that of the flat wall it is

    F = k / (j pi h) int exp(jk x^2 / h - 2jk z(x)) d^2x,

which this module sums around the foot of the perpendicular, in the beat signal's sign, as far as slopes lead back to
the radar. Free space is an all-pass filter, so moving along the wall by d, F has the correlation of the screen itself,

    <F F*'> = exp(-(2k)^2 (<z^2> - <z z'>)):   <F> = exp(-(2k)^2 <z^2> / 2),   <|F|^2> = 1

(Beckmann and Spizzichino 1963, chapter 5, without the paraxial terms). So unevenness does not reduce the mean power:
it causes fading from place to place, because slopes of a degree scatter within the beam of a small array.

A plate's edges near the foot get the same factor, so that it is continuous where the foot leaves the plate; far from it
an edge is met along a line, and is not changed. Ghosts and corners are not changed either: the mean of the factor is 1.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from numba import njit, prange

from radarsim.world.scene import Scene

#: RMS heights and correlation lengths of the two scales at level 1, m.
SCALES = ((0.8e-3, 0.25), (0.2e-3, 0.04))
#: Number of plane waves at each scale.
WAVES = 24
#: Heights of surfaces relative to plaster's; surfaces that are not named (glass, steel, boards of furniture) are flat.
FINISHES = {
    "plasterboard": 1.0, "concrete": 1.0, "brick": 1.5, "ceiling board": 1.0, "floorboard": 0.7, "vinyl": 0.7,
    "carpet": 0.7, "marble": 0.5,
}  # fmt: skip
#: Largest slopes that lead back to the radar, relative to the RMS, and reach in radii of the Fresnel zone.
SLOPES, ZONES = 3.0, 2.5
#: Oversampling.
FINER = 1.25


@dataclass(frozen=True)
class Heights:
    """Random height field of the world: z(x) = sum a cos(q . x + phase), m.

    Attributes:
        wave: q, rad/m.
        phase: rad.
        size: a, m.
    """

    wave: Float[np.ndarray, "wave 3"]
    phase: Float[np.ndarray, "wave"]
    size: Float[np.ndarray, "wave"]

    @classmethod
    def of(cls, scene: Scene, rng: np.random.Generator) -> "Heights | None":
        """Height field of a scene; None if all surfaces are flat."""
        if scene.surface_settings.unevenness == 0:
            return None
        wave = [np.sqrt(2) / length * rng.standard_normal((WAVES, 3)) for _, length in SCALES]
        size = [np.full(WAVES, scene.surface_settings.unevenness * rms * np.sqrt(2 / WAVES)) for rms, _ in SCALES]
        return cls(np.concatenate(wave), rng.uniform(0, 2 * np.pi, WAVES * len(SCALES)), np.concatenate(size))

    def __call__(self, place: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Heights at some positions, m."""
        return np.cos(place @ self.wave.T + self.phase) @ self.size

    @property
    def slope(self) -> float:
        """RMS slope along any direction."""
        return float(np.sqrt(np.sum((self.size[:, None] * self.wave) ** 2) / 6))

    def reach(
        self, away: Float[np.ndarray, "n"], finish: Float[np.ndarray, "n"], wavelength: float
    ) -> Float[np.ndarray, "n"]:
        """Radius around its foot within which a surface at a given distance matters, m."""
        return SLOPES * finish * self.slope * away + ZONES * np.sqrt(wavelength * away / 2)

    def factors(
        self, position: Float[np.ndarray, "n 3"], foot: Float[np.ndarray, "n 3"], finish: Float[np.ndarray, "n"],
        wavelength: float,
    ) -> Complex[np.ndarray, "n"]:  # fmt: skip
        """F of surfaces at their feet, seen from positions (m) on the normal.

        Args:
            finish: heights relative to those of this field.
        """
        normal = position - foot
        away = np.linalg.norm(normal, axis=1)
        normal = normal / away[:, None]
        u = np.cross(normal, np.where(np.abs(normal[:, 2:]) < 0.7, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
        u /= np.linalg.norm(u, axis=1)[:, None]
        v = np.cross(normal, u)
        reach = self.reach(away, finish, wavelength)
        # Sample spacing with a phase change below a full circle: the sum contains none of its images.
        steepest = 4 * np.pi / wavelength * (reach / away + SLOPES * finish * self.slope)
        count = np.ceil(FINER * reach * steepest / (2 * np.pi)).astype(np.int64)
        start = foot @ self.wave.T + self.phase
        along, across = u @ self.wave.T, v @ self.wave.T
        return _factors(start, along, across, np.outer(finish, self.size), away, reach, count, wavelength)


@njit(parallel=True, fastmath=True, cache=True)
def _factors(start, along, across, size, away, reach, count, wavelength):
    out = np.empty(len(away), np.complex128)
    for f in prange(len(away)):
        n = 2 * count[f] + 1
        step, k = reach[f] / count[f], 2 * np.pi / wavelength
        weight, flat = np.empty(n, np.complex128), 0j
        for i in range(n):
            x = (i - count[f]) * step
            fade = min(max(2 * (1 - abs(x) / reach[f]), 0.0), 1.0)  # zero at the rim, one below half the radius
            weight[i] = fade * fade * (3 - 2 * fade) * np.exp(1j * k * x * x / away[f])
            flat += weight[i]
        waves = size.shape[1]
        real, imaginary = np.empty((waves, n)), np.empty((waves, n))
        for m in range(waves):
            for j in range(n):
                angle = across[f, m] * (j - count[f]) * step
                real[m, j], imaginary[m, j] = np.cos(angle), np.sin(angle)
        height, total = np.empty(n), 0j
        for i in range(n):
            height[:] = 0
            for m in range(waves):
                angle = start[f, m] + along[f, m] * (i - count[f]) * step
                a, b = size[f, m] * np.cos(angle), size[f, m] * np.sin(angle)
                for j in range(n):
                    height[j] += a * real[m, j] - b * imaginary[m, j]
            line = 0j
            for j in range(n):
                angle = -2 * k * height[j]
                line += weight[j] * complex(np.cos(angle), np.sin(angle))
            total += weight[i] * line
        out[f] = total / (flat * flat)
    return out
