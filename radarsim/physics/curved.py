"""The coherent echo of spheres and cylinders, from the point or the line that faces the radar.

Physical optics of a round body (stationary phase across the curvature) is the wall's echo lambda / (8 pi h), h from the
sensor to the nearest point, times sqrt(a / (a + h)) for each curved direction:

    sphere    lambda / (8 pi h) a / (a + h), far away sigma = pi a^2;
    cylinder  lambda / (8 pi h) sqrt(a / (a + h)) (interior - ends), far away at broadside sigma = k a l^2.

Along a cylinder the Fresnel integral and its end terms are those of a plate's side. Paths are isometries of the
receiver as for plates: a half turn about the nearest line of the cylinder, inversions in its ends and in the sphere's
nearest point. The body's point or line wanders over it as the sensor moves, but is held during one burst: the path is
then wrong by delta^2 (1 / h - 1 / (a + h)) for a step delta across, below 0.01 mm for a table leg or a lamp at walking
pace and zero in its first derivative, so Doppler is right.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from radarize.radar.config import RadarConfig
from radarsim.physics import plates
from radarsim.physics.bodies import recognise
from radarsim.physics.facets import reflection_table
from radarsim.scene.scene import Scene


@dataclass(frozen=True)
class Curved:
    """Round bodies.

    Attributes:
        center: m.
        axis: unit vector along a cylinder; zero for a sphere.
        radius: m.
        half: half the length of a cylinder, m; zero for a sphere.
        reflection: coefficient at normal incidence, roughness included, as in the beat signal.
    """

    center: Float[np.ndarray, "body 3"]
    axis: Float[np.ndarray, "body 3"]
    radius: Float[np.ndarray, "body"]
    half: Float[np.ndarray, "body"]
    reflection: Complex[np.ndarray, "body"]

    def __len__(self) -> int:
        return len(self.center)

    @classmethod
    def of(cls, scene: Scene, config: RadarConfig) -> "Curved":
        """The spheres and cylinders of a scene."""
        rows = []
        for item in scene.objects:
            bodies, _ = recognise(item.mesh)
            if bodies:
                reflection = reflection_table(item.material, config)[0, -1]
                rows += [(b.center, b.axis, b.radius, b.half, reflection) for b in bodies]
        if not rows:
            return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, complex))
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    def parts(
        self,
        position: Float[np.ndarray, "3"],
        rotation: Float[np.ndarray, "3 3"],
        reach: float,
        wavelength: float,
        weakest: float,
        tables: tuple[np.ndarray, np.ndarray],
    ) -> tuple[Float[np.ndarray, "part 3"], Float[np.ndarray, "part 3 4"], Complex[np.ndarray, "part"]]:
        """Flashes and ends for a sensor pose: point that each comes from (m), isometry of the receiver, amplitude.

        Args: as of `plates.parts`.
        """
        offset = position - self.center
        z = np.einsum("bd,bd->b", offset, self.axis)
        radial = offset - z[:, None] * self.axis
        rho = np.linalg.norm(radial, axis=1)
        near = np.flatnonzero((rho - self.radius > 0.01) & (rho - self.radius < reach) & (abs(z) - self.half < reach))
        z, radius, half, axis = z[near], self.radius[near], self.half[near], self.axis[near]
        h = rho[near] - radius
        line = self.center[near] + radial[near] * (radius / rho[near])[:, None]
        sphere = half == 0
        across = np.stack([np.zeros_like(z), -half - z, half - z], axis=1)
        slant = np.hypot(h[:, None], across)
        size = plates.side_terms(across[:, None], slant[:, None], h, wavelength)[:, 0]
        size[:, 1:] *= np.sqrt(2) * h[:, None] ** 2 / (slant[:, 1:] ** 1.5 * np.sqrt(slant[:, 1:] + h[:, None]))
        size[sphere] = [1.0, 0.0, 0.0]
        spread = radius / (radius + h)
        size *= (wavelength / (8 * np.pi * h) * np.where(sphere, spread, np.sqrt(spread)))[:, None]
        size *= self.reflection[near, None]
        b, part = np.nonzero((np.abs(size) * plates.PEAK_GAIN > weakest) & (slant < reach))
        along = np.stack([np.where(sphere, 0, z), -half, half], axis=1)[b, part]
        point = line[b] + along[:, None] * axis[b]
        amplitude = size[b, part] * plates.gains((point - position) @ rotation, *tables) ** 2
        keep = np.abs(amplitude) > weakest
        b, part, point, amplitude = b[keep], part[keep], point[keep], amplitude[keep]
        turned = axis[b] * (part == 0)[:, None]
        matrix = 2 * np.einsum("pd,pe->pde", turned, turned) - np.eye(3)
        shift = point - np.einsum("pde,pe->pd", matrix, point)
        inward = np.array([0.0, 1.0, -1.0])[part] * np.minimum(0.01, half[b])
        return point + inward[:, None] * axis[b], np.concatenate([matrix, shift[:, :, None]], axis=2), amplitude
