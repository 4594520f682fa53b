"""Flat parts of the scene: mirrors for ghosts, and plates that flash where they face the radar."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float

from radarize.radar.config import RadarConfig
from radarsim.physics.bodies import recognise
from radarsim.physics.coefficients import TABLE, as_slab, reflection
from radarsim.physics.grid import Grid
from radarsim.physics.planes import plates
from radarsim.physics.unevenness import FINISHES
from radarsim.scene.materials import Material
from radarsim.scene.scene import Scene

#: Facets below this area (m^2) do not flash: their scatterers stand for them. A conductor's are hundreds of times
#: brighter: 2 cm x 2 cm of metal still has 0.13 m^2 of radar cross section.
SMALLEST_PLATE, SMALLEST_METAL_PLATE = 0.01, 4e-4
#: Facets below this area (m^2) are no mirrors: at 77 GHz and 2 m the first Fresnel zone is about 0.03 m^2 wide.
SMALLEST_MIRROR = 0.25


@dataclass(frozen=True)
class Facets:
    """Flat convex quadrilaterals, and in each a rectangle that stands for it where it is a mirror for scatterers.

    Attributes:
        corners: in order around, m; of a triangle two fall together.
        center, normal, u, v: m and unit vectors; u, v lie along the rectangle's sides.
        half: half the rectangle's side lengths along u and v, m.
        two_sided: sheets without a volume show both sides.
        mirror: large enough to be a mirror.
        horizontal: part of a floor or ceiling.
        reflection: complex reflection coefficient by (facet, polarisation TE / TM, cosine of incidence), roughness
            included, as it appears in the beat signal (conjugate of the field's).
        finish: how uneven they are over plaster, see `unevenness.FINISHES`; default: flat.
    """

    corners: Float[np.ndarray, "facet 4 3"]
    center: Float[np.ndarray, "facet 3"]
    normal: Float[np.ndarray, "facet 3"]
    u: Float[np.ndarray, "facet 3"]
    v: Float[np.ndarray, "facet 3"]
    half: Float[np.ndarray, "facet 2"]
    two_sided: np.ndarray
    mirror: np.ndarray
    horizontal: np.ndarray
    reflection: Complex[np.ndarray, "facet 2 cosine"]
    finish: Float[np.ndarray, "facet"] | None = None

    def __post_init__(self):
        if self.finish is None:
            object.__setattr__(self, "finish", np.zeros(len(self)))

    def __len__(self) -> int:
        return len(self.center)

    @cached_property
    def _grid(self) -> Grid:
        return Grid(self.corners.min(axis=1), self.corners.max(axis=1))

    def near(self, positions: Float[np.ndarray, "position 3"], reach: float) -> "Facets":
        """Those within `reach` (m) of any of the positions, in the same order."""
        index, _ = self._grid.near(positions, reach)
        return Facets(*(getattr(self, field.name)[index] for field in fields(self)))

    @classmethod
    def of(cls, scene: Scene, config: RadarConfig) -> "Facets":
        """The quadrilaterals that cover the flat regions of a scene."""
        rows = []
        tables: dict[Material, np.ndarray] = {}
        for item in scene.objects:
            slab, _ = as_slab(item)
            if slab not in tables:
                tables[slab] = reflection(slab, config)
            smallest = SMALLEST_METAL_PLATE if item.material.conductor else SMALLEST_PLATE
            finish = FINISHES.get(item.material.name, 0.0)
            _, is_round = recognise(item.mesh)
            for p in plates(item.mesh, ~is_round, smallest):
                mirror = 4 * p.half.prod() >= SMALLEST_MIRROR
                sides = (item.two_sided, mirror, item.is_floor_or_ceiling)
                rows.append((p.corners, p.center, p.normal, p.u, p.v, p.half, *sides, tables[slab], finish))
        if rows:
            return cls(*(np.array(column) for column in zip(*rows, strict=True)))
        none, empty = np.zeros(0, bool), np.zeros((0, 3))
        return cls(
            np.zeros((0, 4, 3)), empty, empty, empty, empty, np.zeros((0, 2)), none, none, none,
            np.zeros((0, 2, TABLE), complex),
        )  # fmt: skip
