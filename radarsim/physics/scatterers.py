"""World-anchored point scatterers: what stands for the diffuse echo of every surface.

They are drawn once, when the scene is built, each with its place, normal, area and random phase. So speckle is a
property of the world: it stays coherent while the sensor moves over it, as on a real wall.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from radarsim.scene.scene import Scene

#: Scatterers per square metre: about ten per range-azimuth cell of the `radarize` preset on a wall 2 m away.
DENSITY = 150.0
#: Of a sampled surface every n-th scatterer is seen over mirrors.
BOUNCE_STRIDE = 4


@dataclass(frozen=True)
class Scatterers:
    """Point scatterers in the world.

    Attributes:
        position: m.
        normal: unit outward normal, or zero for an isotropic scatterer.
        sigma: radar cross section at normal incidence, m^2 (sigma0 times the area it stands for).
        phase: rad, uniformly random.
        two_sided: whether it scatters from behind as well (sheets without a volume).
        horizontal: whether it belongs to a floor or ceiling.
        bounces: weight of its power in paths over mirrors. Ghosts are many and weak, so of a sampled surface only
            every fourth scatterer has them, with four times the power.
    """

    position: Float[np.ndarray, "scatterer 3"]
    normal: Float[np.ndarray, "scatterer 3"]
    sigma: Float[np.ndarray, "scatterer"]
    phase: Float[np.ndarray, "scatterer"]
    two_sided: np.ndarray
    horizontal: np.ndarray
    bounces: Float[np.ndarray, "scatterer"]

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def points(
        cls,
        position: Float[np.ndarray, "n 3"],
        sigma: Float[np.ndarray, "n"],
        phase: Float[np.ndarray, "n"] | None = None,
    ) -> "Scatterers":
        """Isotropic scatterers of given cross sections, m^2."""
        position = np.atleast_2d(np.asarray(position, float))
        n = len(position)
        zeros = np.zeros(n, bool)
        return cls(
            position,
            np.zeros((n, 3)),
            np.broadcast_to(np.asarray(sigma, float), n).copy(),
            np.zeros(n) if phase is None else phase,
            zeros,
            zeros,
            np.ones(n),
        )

    @classmethod
    def sample(cls, scene: Scene, rng: np.random.Generator, density: float = DENSITY) -> "Scatterers":
        """Scatterers on all surfaces of a scene, `density` per square metre.

        Each object's surface is cut into equal areas along its faces and gets one scatterer in each (systematic
        sampling), which keeps the density even without a lattice. An object with sigma0 = 0 gets none.
        """
        parts = [_on_object(item, rng, density) for item in scene.objects if item.material.sigma0 > 0]
        parts = [p for p in parts if len(p)]
        if not parts:
            return cls.points(np.zeros((0, 3)), np.zeros(0))
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in cls.__dataclass_fields__))


def _on_object(item, rng: np.random.Generator, density: float) -> Scatterers:
    mesh = item.mesh
    areas = mesh.area_faces
    total = areas.sum()
    count = int(np.floor(total * density + rng.random()))
    along = (np.arange(count) + rng.random(count)) / max(count, 1) * total
    faces: Int[np.ndarray, n] = np.minimum(np.searchsorted(np.cumsum(areas), along), len(areas) - 1)
    r1, r2 = np.sqrt(rng.random(count)), rng.random(count)
    a, b, c = np.moveaxis(mesh.triangles[faces], 1, 0)
    position = (1 - r1)[:, None] * a + (r1 * (1 - r2))[:, None] * b + (r1 * r2)[:, None] * c
    normal = mesh.face_normals[faces]
    return Scatterers(
        position,
        normal,
        np.full(count, item.material.sigma0 * total / max(count, 1)),
        rng.uniform(0, 2 * np.pi, count),
        np.full(count, item.two_sided),
        np.full(count, item.is_floor_or_ceiling),
        np.where(np.arange(count) % BOUNCE_STRIDE == 0, float(BOUNCE_STRIDE), 0.0),
    )
