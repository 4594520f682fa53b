"""Which scatterers can make an echo worth having in which frame, before any ray test: near, ahead, and facing."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.physics.amplitudes import dot, facing, gain_towards, minus
from radarsim.physics.amplitudes import vector as vec
from radarsim.physics.batch import Batch
from radarsim.physics.detail import FULL_DETAIL, detail, share
from radarsim.physics.lobes import scattering


@dataclass(frozen=True)
class Candidates:
    """Pairs of a frame and a scatterer, in ascending order of both.

    Attributes:
        frame, scatterer: indices.
        distance: from the sensor, m.
        leg: amplitude of the straight leg, 1/m (see `legs`).
        echo: amplitude of the echo straight there and back.
        size: amplitude of an echo over that of its legs, for a surface that scatters fully from one into the other.
        most: the same at most, whatever the surface's lobes.
    """

    frame: Int[np.ndarray, "candidate"]
    scatterer: Int[np.ndarray, "candidate"]
    distance: Float[np.ndarray, "candidate"]
    leg: Float[np.ndarray, "candidate"]
    echo: Float[np.ndarray, "candidate"]
    size: Float[np.ndarray, "candidate"]
    most: Float[np.ndarray, "candidate"]

    def __len__(self) -> int:
        return len(self.frame)

    @classmethod
    def of(
        cls, batch: Batch, reach: float, wavelength: float, weakest: float, tables: tuple[np.ndarray, np.ndarray]
    ) -> "Candidates":
        """Scatterers within reach whose straight echo is above the weakest, or that have echoes over mirrors.

        Args:
            batch: poses and scatterers.
            reach: m.
            wavelength: m.
            weakest: amplitude.
            tables: the antenna's gain tables.
        """
        s = batch.scatterers
        shape = len(batch), len(s)
        count, index, columns = np.zeros(len(batch), np.int64), np.empty(shape, np.int32), np.empty((*shape, 5))
        _look(
            s.position, s.normal, s.sigma, s.two_sided, s.lobe, s.rank, s.bounces, batch.owner, batch.position,
            batch.rotation, reach, wavelength / (4 * np.pi) ** 1.5, weakest, *tables, count, index, columns,
        )  # fmt: skip
        rows = np.concatenate([columns[k, :n] for k, n in enumerate(count)])
        return cls(
            np.repeat(np.arange(len(batch)), count),
            np.concatenate([index[k, :n] for k, n in enumerate(count)]),
            *np.ascontiguousarray(rows.T),
        )


@njit(parallel=True, cache=True)
def _look(
    place, normal, sigma, two_sided, lobe, rank, bounces, owner, positions, rotations, reach, scale, weakest,
    azimuth_table, elevation_table, count, index, columns,
):  # fmt: skip
    for frame in prange(len(positions)):
        position, rotation = vec(positions[frame]), rotations[frame]
        n = 0
        for i in range(len(place)):
            d = minus(vec(place[i]), position)
            square = dot(d, d)
            # First what needs no root: most scatterers are too low in rank for their distance.
            if square > reach * reach or square < 1e-4 or (owner[i] >= 0 and owner[i] != frame):
                continue
            if rank[i] > 0 and rank[i] * rank[i] * square >= (2 * FULL_DETAIL) ** 2:
                continue
            away = np.sqrt(square)
            cosine = facing(normal[i], (-d[0] / away, -d[1] / away, -d[2] / away), two_sided[i])
            if cosine <= 0 and bounces[i] == 0:
                continue
            gain = gain_towards(d, rotation, azimuth_table, elevation_table)
            if gain == 0 and bounces[i] == 0:
                continue
            shown = detail(rank[i], share(gain, away))
            if shown == 0:
                continue
            leg, echo = gain / away, 0.0
            size = scale * shown * np.sqrt(sigma[i])
            if cosine > 0 and gain > 0:
                echo = size * leg * leg * np.sqrt(scattering(cosine, cosine, 1.0, lobe[i]))
            if echo <= weakest and bounces[i] == 0:
                continue
            index[frame, n] = i
            row = columns[frame, n]
            row[0], row[1], row[2], row[3] = away, leg, echo, size
            row[4] = size * np.sqrt(lobe[i, 0] + lobe[i, 1] + lobe[i, 2])
            n += 1
        count[frame] = n
