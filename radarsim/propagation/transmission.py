"""What passes through walls, panes and doors: loss, phase and delay of thin slabs on a ray's way."""

from functools import cached_property

import numpy as np
import trimesh
from jaxtyping import Complex, Float

from radarize.radar.config import RadarConfig
from radarsim.propagation.coefficients import TABLE, as_slab, transmission
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

#: A ray is given up behind this many slabs: one stud wall with a board on either side, or two panes.
MOST_SLABS = 2


class Transmission:
    """The thin objects of a scene (`coefficients`).

    Args:
        scene: ray tests run on its geometry.
        config: gives the frequency.
        margin: rays start and end this far from their ends, m.
    """

    def __init__(self, scene: Scene, config: RadarConfig, margin: float):
        self.scene, self.margin, self._wavelength = scene, margin, config.wavelength
        tables, self._table, self._body = {}, [], []
        for item in scene.objects:
            slab, whole = as_slab(item)
            if slab.thickness is not None and slab not in tables:
                tables[slab] = (len(tables), transmission(slab, config))
            self._table.append(-1 if slab.thickness is None else tables[slab][0])
            self._body.append(whole)
        self._table, self._body = np.array(self._table), np.array(self._body)
        self._factor = np.array([t for _, (t, _) in tables.values()]).reshape(-1, 2, TABLE)
        self._delay = np.array([d for _, (_, d) in tables.values()]).reshape(-1, TABLE)

    @cached_property
    def opaque(self) -> Scene | None:
        """What of the scene nothing passes, as one object; None: nothing."""
        solid = [item for item, table in zip(self.scene.objects, self._table, strict=True) if table < 0]
        if not solid or len(solid) == len(self._table):
            return self.scene if solid else None
        mesh = trimesh.util.concatenate([item.mesh for item in solid])
        return Scene(self.scene.name, [SceneObject("opaque", mesh, solid[0].material)])

    def passage(
        self, origins: Float[np.ndarray, "n 3"], targets: Float[np.ndarray, "n 3"], up: Float[np.ndarray, "n 3"]
    ) -> tuple[Complex[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """What is left of waves with an upright field on their way from origins to targets.

        Returns:
            factor on the beat signal's amplitude (0: opaque), and the length by which the slabs delay it, m. The phase
            of the factor is relative to a path that is longer by the delay.
        """
        way = targets - origins
        lengths = np.linalg.norm(way, axis=1)
        way = way / np.maximum(lengths, 1e-9)[:, None]
        factor, delay = np.ones(len(way), complex), np.zeros(len(way))
        start, slabs = np.full(len(way), self.margin), np.zeros(len(way), int)
        inside = np.full(len(way), -1)
        under_way = np.arange(len(way))
        while len(under_way):
            w = under_way
            distance, triangle = self.scene.hit(origins[w] + start[w, None] * way[w], way[w])
            at = start[w] + distance
            struck = (at < lengths[w] - self.margin) & (triangle >= 0)  # the others have arrived
            w, at, triangle = w[struck], at[struck], triangle[struck]
            item = self.scene.triangle_object[triangle]
            leaving = inside[w] == item  # the far face of a body whose slab has been counted
            slabs[w] += ~leaving
            passes = leaving | ((self._table[item] >= 0) & (slabs[w] <= MOST_SLABS))
            factor[w[~passes]] = 0
            w, at, triangle, item, leaving = (x[passes] for x in (w, at, triangle, item, leaving))
            n = ~leaving
            gain, extra = self._through(self._table[item[n]], way[w[n]], self.scene.normals[triangle[n]], up[w[n]])
            factor[w[n]] *= gain
            delay[w[n]] += extra
            inside[w] = np.where(leaving | ~self._body[item], -1, item)
            start[w] = at + 1e-4
            under_way = w
        delay[factor == 0] = 0
        return factor * np.exp(-2j * np.pi * delay / self._wavelength), delay

    def _through(self, table, way, normal, up):
        """Factor and delay of one slab each: TE and TM parts of the upright field."""
        at = np.minimum(np.abs(np.einsum("nd,nd->n", way, normal)), 1) * (TABLE - 1)
        j = np.minimum(at.astype(int), TABLE - 2)
        t = at - j
        te, tm = ((1 - t) * self._factor[table, p, j] + t * self._factor[table, p, j + 1] for p in (0, 1))
        across = np.cross(way, normal)
        across /= np.linalg.norm(across, axis=1, keepdims=True) + 1e-9
        field = up - np.einsum("nd,nd->n", up, way)[:, None] * way
        field /= np.linalg.norm(field, axis=1, keepdims=True) + 1e-9
        share = np.einsum("nd,nd->n", field, across) ** 2
        return te * share + tm * (1 - share), (1 - t) * self._delay[table, j] + t * self._delay[table, j + 1]
