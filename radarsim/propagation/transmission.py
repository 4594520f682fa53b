"""Transmission through walls, panes and doors: loss, phase and delay of thin slabs on a ray."""

from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float
from numba import njit

from radarize.radar.config import RadarConfig
from radarsim.propagation.clutter import uncovered
from radarsim.propagation.fields import cross, dot, unit, upright, vec
from radarsim.propagation.media import LAYER, as_slab, layer, sweep_share, window
from radarsim.world import shapes
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

#: Largest number of slabs on a ray: one stud wall with a board on either side, or two panes.
MOST_SLABS = 2


class Transmission:
    """Transmission through the thin objects of a scene (`media`).

    Args:
        scene: geometry for ray tests.
        config: radar configuration, for the frequency.
        margin: distance from both ends at which rays start and end, m.
    """

    def __init__(self, scene: Scene, config: RadarConfig, margin: float):
        self.scene, self.margin, self._wavelength = scene, margin, config.wavelength
        slabs, whole = zip(*map(as_slab, scene.objects), strict=True)
        number = {s: k for k, s in enumerate(dict.fromkeys(s for s in slabs if s.thickness is not None))}
        self._layer, self._body = np.array([number.get(slab, -1) for slab in slabs]), np.array(whole)
        self._layers = np.array([layer(slab, config) for slab in number]).reshape(-1, LAYER)
        self._share = sweep_share(config)
        #: amplitude factor by small objects on a face
        self._left = np.sqrt(uncovered(scene, scene.triangles.mean(axis=1), scene.normals))

    @cached_property
    def opaque(self) -> Scene | None:
        """Opaque geometry of the scene, as one object; None: there is none."""
        solid = [item for item, layer in zip(self.scene.objects, self._layer, strict=True) if layer < 0]
        if not solid or len(solid) == len(self._layer):
            return self.scene if solid else None
        mesh = shapes.joined(*(item.mesh for item in solid))
        return Scene(self.scene.name, [SceneObject("opaque", mesh, solid[0].material)])

    def passage(
        self, origins: Float[np.ndarray, "n 3"], targets: Float[np.ndarray, "n 3"], up: Float[np.ndarray, "n 3"]
    ) -> tuple[Complex[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """Factor and delay of vertically polarised waves from origins to targets.

        Returns:
            Factor on the beat signal's amplitude (0: opaque), and the delay by the slabs, m. The phase of the factor is
                relative to a path that is longer by the delay.
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
            struck = (at < lengths[w] - self.margin) & (triangle >= 0)  # the others have reached their target
            w, at, triangle = w[struck], at[struck], triangle[struck]
            item = self.scene.triangle_object[triangle]
            leaving = inside[w] == item  # the far face of a body whose slab has been counted
            slabs[w] += ~leaving
            passes = leaving | ((self._layer[item] >= 0) & (slabs[w] <= MOST_SLABS))
            factor[w[~passes]] = 0
            w, at, triangle, item, leaving = (x[passes] for x in (w, at, triangle, item, leaving))
            factor[w] *= self._left[triangle]
            n = ~leaving
            slab = self._layers[self._layer[item[n]]]
            gain, extra = _through(slab, way[w[n]], self.scene.normals[triangle[n]], up[w[n]], self._share)
            factor[w[n]] *= gain
            delay[w[n]] += extra * self._wavelength / (2 * np.pi)
            inside[w] = np.where(leaving | ~self._body[item], -1, item)
            start[w] = at + 1e-4
            under_way = w
        delay[factor == 0] = 0
        return factor * np.exp(-2j * np.pi * delay / self._wavelength), delay


@njit(cache=True)
def _through(layers, ways, normals, ups, share):
    """Factor and delay (in 1 / k) of one slab per ray: TE and TM parts of the vertical field."""
    factor, delay = np.empty(len(ways), np.complex128), np.empty(len(ways))
    for i in range(len(ways)):
        way, normal, up = vec(ways[i]), vec(normals[i]), vec(ups[i])
        te, tm, delay[i] = window(layers[i], min(abs(dot(way, normal)), 1.0), share)
        part = dot(upright(up, way), unit(cross(way, normal))) ** 2
        factor[i] = te * part + tm * (1 - part)
    return factor, delay
