"""Selection of scatterers that may have a significant echo in a frame, before any ray test: near, ahead, and facing."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.propagation.fields import dot, facing, gain_towards, minus, vec
from radarsim.propagation.level_of_detail import FULL_DETAIL, detail, share
from radarsim.propagation.media import scattering
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table
from radarsim.propagation.targets import Targets


@dataclass(frozen=True)
class Candidates(Table):
    """Pairs of a frame and a scatterer, in ascending order of both.

    Attributes:
        frame, scatterer: indices.
        distance: from the sensor, m.
        straight: amplitude of the direct one-way path, 1/m (see `paths`).
        echo: amplitude of the direct echo.
        size: amplitude of an echo relative to its one-way paths, for a surface that scatters fully from one into the
            other.
        most: upper bound of `size` over all scattering patterns.
    """

    frame: Int[np.ndarray, "candidate"]
    scatterer: Int[np.ndarray, "candidate"]
    distance: Float[np.ndarray, "candidate"]
    straight: Float[np.ndarray, "candidate"]
    echo: Float[np.ndarray, "candidate"]
    size: Float[np.ndarray, "candidate"]
    most: Float[np.ndarray, "candidate"]

    @classmethod
    def of(cls, observation: Observation, targets: Targets) -> "Candidates":
        """Select scatterers in range whose direct echo exceeds the threshold, or that have echoes over mirrors."""
        shape = observation.frames, len(targets.scatterers)
        count, index, columns = np.zeros(shape[0], np.int64), np.empty(shape, np.int32), np.empty((*shape, 5))
        _look(targets.scatterers.columns, targets.owner, observation, count, index, columns)
        rows = np.concatenate([columns[k, :n] for k, n in enumerate(count)])
        return cls(
            np.repeat(np.arange(observation.frames), count),
            np.concatenate([index[k, :n] for k, n in enumerate(count)]),
            *np.ascontiguousarray(rows.T),
        )


@njit(parallel=True, cache=True)
def _look(scatterers, owner, observation, count, index, columns):
    """Per frame: number of candidates, their indices, and rows of the last five columns."""
    scale = observation.wavelength / (4 * np.pi) ** 1.5
    for frame in prange(len(observation.position)):
        position, rotation = vec(observation.position[frame]), observation.rotation[frame]
        forward, n = (rotation[0, 0], rotation[1, 0], rotation[2, 0]), 0
        for i in range(len(scatterers.position)):
            d = minus(vec(scatterers.position[i]), position)
            square = dot(d, d)
            # First the test without a root: most scatterers have a rank too high for their distance.
            if square > observation.range**2 or square < 1e-4 or (owner[i] >= 0 and owner[i] != frame):
                continue
            rank, mirrored = scatterers.rank[i], scatterers.bounces[i] > 0
            if rank > 0 and rank * rank * square >= (2 * FULL_DETAIL) ** 2:
                continue
            # the sign of the cosine, and whether it is behind the board
            turned = facing(scatterers.normal[i], (-d[0], -d[1], -d[2]), scatterers.two_sided[i])
            if not mirrored and (turned <= 0 or dot(d, forward) <= 0):
                continue
            away = np.sqrt(square)
            cosine = facing(scatterers.normal[i], (-d[0] / away, -d[1] / away, -d[2] / away), scatterers.two_sided[i])
            gain = gain_towards(d, rotation, observation)
            shown = detail(rank, share(gain / observation.peak_gain, away))
            if shown == 0:
                continue
            straight, echo = gain / away, 0.0
            size = scale * shown * np.sqrt(scatterers.sigma[i])
            lobe = scatterers.lobe[i]
            if cosine > 0 and gain > 0:
                echo = size * straight * straight * np.sqrt(scattering(cosine, cosine, 1.0, lobe))
            if echo <= observation.threshold and not mirrored:
                continue
            index[frame, n] = i
            row = columns[frame, n]
            row[0], row[1], row[2], row[3] = away, straight, echo, size
            row[4] = size * np.sqrt(lobe[0] + lobe[1] + lobe[2])
            n += 1
        count[frame] = n
