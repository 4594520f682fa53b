"""Moving targets of a scene: scatterers carried by rigid parts, which also obstruct other paths.

Over a burst a scatterer's path length is a parabola through three nodes. Limbs accelerate strongly: compared with exact
positions in every chirp, a walker's echoes have an error of -40 to -60 dB for most of the step cycle and of -25 dB
where shins swing (measured over one cycle). Ghosts of movers have at most one mirror out and one back; paths over two
are left out.

Parts with a material scatter like surfaces of it, and are plates besides (`movingplates`).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit, prange

from radarsim.propagation.media import LAMBERT, weights
from radarsim.propagation.scatterers import BOUNCE_STRIDE, Scatterers
from radarsim.world.crossing import crossing
from radarsim.world.movers import Mover, poses


class MovingTargets:
    """All moving targets of a scene: their scatterers at any time, and occlusion by them.

    Args:
        movers: movers of the scene.
        rng: random generator of the scatterers' positions and phases.
        density: scatterers per square metre of surface.

    Attributes:
        parts: rigid parts of all movers.
        opaque: indices of opaque parts.
        part: (scatterer,) index of the part that carries it.
        sigma: (scatterer,) radar cross sections, m^2.
    """

    def __init__(self, movers: list[Mover], rng: np.random.Generator, density: float = 150.0):
        self.movers = movers
        own = [mover.parts() for mover in movers]
        self.parts = [part for parts in own for part in parts]
        self.opaque = np.array([k for k, part in enumerate(self.parts) if part.material is None], int)
        found = [Scatterers.zeros(0)]
        for mover, parts in zip(movers, own, strict=True):
            area = sum(each.area for each in parts)
            for each in parts:
                if each.material is None:
                    # Half of an upright round body faces the radar, and the mean of Lambert's squared cosine there is
                    # 1/2.
                    per_area = 4 * getattr(mover, "cross_section", 0.0) / area
                else:
                    per_area = each.material.sigma0
                count = max(int(round(density * each.area)), 4) if per_area else 0
                points, normals = each.sample(count, rng)
                some = Scatterers.points(points, per_area * each.area / max(count, 1))
                lobe = np.tile(LAMBERT if each.material is None else weights(each.material), (count, 1))
                found.append(replace(some, normal=normals, lobe=lobe))
        self.part = np.repeat(np.arange(len(self.parts)), np.array([len(some) for some in found[1:]], int))
        once, twice = (np.where(np.arange(len(self.part)) % n == 0, float(n), 0.0)
                       for n in (BOUNCE_STRIDE, BOUNCE_STRIDE**2))  # fmt: skip
        phase = rng.uniform(0, 2 * np.pi, len(self.part))
        self._own = replace(Scatterers.joined(found), phase=phase, bounces=once, bounces_twice=twice)
        self.sigma = self._own.sigma
        self._half = np.array([p.half for p in self.parts]).reshape(-1, 3)
        self._capsule = np.array([p.capsule for p in self.parts], bool)

    def __len__(self) -> int:
        return len(self.part)

    def poses(self, t: Float[np.ndarray, "n"]) -> tuple[Float[np.ndarray, "n part 3 3"], Float[np.ndarray, "n part 3"]]:
        """Rotation and centre of every part of every mover."""
        return poses(self.movers, t)

    def positions(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n scatterer 3"]:
        """Positions of the scatterers at times t (s), m."""
        turn, center = self.poses(t)
        return np.einsum("nsij,sj->nsi", turn[:, self.part], self._own.position) + center[:, self.part]

    def scatterers(self, t: float) -> Scatterers:
        """Scatterers at time t, s."""
        now = np.array([t])
        normal = np.einsum("sij,sj->si", self.poses(now)[0][0, self.part], self._own.normal)
        return replace(self._own, position=self.positions(now)[0], normal=normal)

    def occluded(
        self, origins: Float[np.ndarray, "n 3"], targets: Float[np.ndarray, "n 3"], t: float | Float[np.ndarray, "n"],
        margin: float = 0.01, parts: Int[np.ndarray, "some"] | None = None,
    ) -> Bool[np.ndarray, "n"]:  # fmt: skip
        """Whether a part, of some or of all, obstructs a segment at its time t, s; ends are shortened by `margin`,
        m."""
        origins, targets = np.broadcast_arrays(np.asarray(origins, float), np.asarray(targets, float))
        some = np.arange(len(self.parts)) if parts is None else parts
        if not len(some):
            return np.zeros(len(origins), bool)
        times, which = np.unique(np.broadcast_to(t, len(origins)), return_inverse=True)
        turn, center = self.poses(times)
        bodies = turn[:, some], center[:, some], self._half[some], self._capsule[some]
        return _hidden(origins, targets, which, *bodies, margin)


@njit(parallel=True, cache=True)
def _hidden(origins, targets, which, turn, center, half, capsule, margin):
    """Whether segments, shortened at both ends, intersect a part in its pose at their time, of index `which`."""
    hidden = np.zeros(len(origins), np.bool_)
    for i in prange(len(origins)):
        way = targets[i] - origins[i]
        length = np.sqrt(np.dot(way, way))
        if length <= 2 * margin:
            continue
        way, k = way / length, which[i]
        for p in range(len(half)):
            enters, leaves = crossing(origins[i], way, turn[k, p], center[k, p], half[p], capsule[p])
            if enters <= length - margin and leaves >= margin:
                hidden[i] = True
                break
    return hidden
