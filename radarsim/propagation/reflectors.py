"""Specular reflectors of a scene: flat parts with their apertures, round bodies, and smooth curved pieces."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from radarize.radar.config import RadarConfig
from radarsim.propagation.bodies import recognise
from radarsim.propagation.clutter import uncovered
from radarsim.propagation.curved import RoundBodies
from radarsim.propagation.hashgrid import Grid
from radarsim.propagation.media import as_slab, covered, lag, layer
from radarsim.propagation.patches import Patches
from radarsim.propagation.smooth import pieces
from radarsim.propagation.table import Table
from radarsim.propagation.unevenness import FINISHES, Heights
from radarsim.world.materials import Material
from radarsim.world.planes import plates_of_each
from radarsim.world.scene import Scene


@dataclass(frozen=True)
class Flat(Table):
    """Flat convex quadrilaterals, each with a rectangle that represents it as a mirror of scatterers.

    Attributes:
        corners: in order around, m; two coincide for a triangle.
        center, normal, u, v: m and unit vectors; u, v lie along the rectangle's sides.
        half: half the rectangle's side lengths along u and v, m.
        two_sided: sheets without a volume reflect on both sides.
        horizontal: part of a floor or ceiling.
        layer: layer of the material (`media.layer`), and the fraction left uncovered by small objects.
        lag: additional delay of the echo at normal incidence, m (`media.lag`).
        finish: unevenness relative to plaster, see `unevenness.FINISHES`.
        plate, frame: moving plate that they belong to (`movingplates`), and the frame of that position; -1: at rest, in
            all frames.
    """

    corners: Float[np.ndarray, "facet 4 3"]
    center: Float[np.ndarray, "facet 3"]
    normal: Float[np.ndarray, "facet 3"]
    u: Float[np.ndarray, "facet 3"]
    v: Float[np.ndarray, "facet 3"]
    half: Float[np.ndarray, "facet 2"]
    two_sided: Bool[np.ndarray, "facet"]
    horizontal: Bool[np.ndarray, "facet"]
    layer: Complex[np.ndarray, "facet 5"]
    lag: Float[np.ndarray, "facet"]
    finish: Float[np.ndarray, "facet"]
    plate: Int[np.ndarray, "facet"]
    frame: Int[np.ndarray, "facet"]

    def present(self, frame: int) -> Bool[np.ndarray, "facet"]:
        """Mask of the reflectors that exist in a frame."""
        return (self.frame < 0) | (self.frame == frame)


@dataclass(frozen=True)
class Reflectors:
    """All specular reflectors of a scene.

    Attributes:
        flat: quadrilaterals that cover its flat regions.
        round: spheres and cylinders.
        smooth: pieces of other curved surfaces.
        inner: inner faces of hollow bodies, visible through outer ones: they reflect, but are not used as mirrors.
        heights: unevenness of the flat ones; None: none.
    """

    flat: Flat
    round: RoundBodies
    inner: Flat = Flat.zeros(0)
    smooth: Patches = Patches.of([])
    heights: Heights | None = None

    @cached_property
    def _grids(self) -> list[tuple[Flat, Grid]]:
        return [(some, Grid(some.corners.min(axis=1), some.corners.max(axis=1))) for some in (self.flat, self.inner)]

    def near(self, positions: Float[np.ndarray, "position 3"], distance: float) -> list[Flat]:
        """Flat reflectors, and inner faces, within a distance (m) of any of the positions, in constant order."""
        return [some[grid.near(positions, distance)[0]] for some, grid in self._grids]

    @classmethod
    def of(cls, scene: Scene, config: RadarConfig, heights: Heights | None = None) -> "Reflectors":
        """Build the reflectors of a scene."""
        flat, inner, bodies, smooth, rest = [], [], [], [], []
        tables: dict[Material, tuple[np.ndarray, float]] = {}
        left = np.sqrt(uncovered(scene, scene.triangles.mean(axis=1), scene.normals))
        smallest = config.wavelength**2  # physical optics is valid down to about a wavelength
        for number, item in enumerate(scene.objects):
            slab, _ = as_slab(item)
            if slab not in tables:
                tables[slab] = layer(slab, config), lag(slab, config)
            round_, is_round = recognise(item.mesh)
            curved, is_curved = pieces(item.mesh, ~is_round, smallest)
            # a body has one table, so that it scatters at most the power that falls on it
            least = left[scene.triangle_object == number].min(where=is_round | is_curved, initial=1.0)
            bent = covered(tables[slab][0], float(least))
            bodies += [(b.center, b.axis, b.radius, b.half, bent) for b in round_]
            smooth += [(piece, item.two_sided, bent) for piece in curved]
            rest.append((item.mesh, ~(is_round | is_curved)))
        for item, found in zip(scene.objects, plates_of_each(rest, smallest), strict=True):
            slab, whole = as_slab(item)
            deep = None if whole or item.two_sided else slab.thickness  # wall thickness of a hollow body, m
            finish = FINISHES.get(item.material.name, 0.0)
            middles = np.reshape([p.corners.mean(axis=0) for p in found], (-1, 3))
            lying = item.floors_and_ceilings(middles, np.reshape([p.normal for p in found], (-1, 3)))
            for p, horizontal in zip(found, lying, strict=True):
                more = (item.two_sided, horizontal, *tables[slab], finish, -1, -1)
                flat.append((p.corners, p.center, p.normal, p.u, p.v, p.half, *more))
                if deep is not None:
                    inwards = -deep * p.normal
                    place = p.corners[::-1] + inwards, p.center + inwards
                    inner.append((*place, -p.normal, p.u, -p.v, p.half, *more))
        outer = Flat.from_rows(flat)
        seen = np.sqrt(uncovered(scene, outer.corners.mean(axis=1), outer.normal))
        outer = replace(outer, layer=covered(outer.layer, seen))
        return cls(outer, RoundBodies.from_rows(bodies), Flat.from_rows(inner), Patches.of(smooth), heights)
