"""Nodes over a Fresnel zone and their weights, for one screen and for two (see `fresnelzone`).

The clear part of a node's cell is derived from the links between neighbouring nodes: half of each link belongs to
either node's cell, so the amplitude changes smoothly as a border moves across a link.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int
from numba import njit
from scipy.spatial import Delaunay
from scipy.special import erfc

#: Correlations of two screens in steps of 1 / `_RHOS`.
_RHOS = 10
#: Half the side of the lattice's square, Fresnel units.
HALF = 1.5
#: Cost of changes of the nodes' weights in their fit, relative to errors of half planes.
_STIFF = 0.4
#: Additional weight of errors of vertical and horizontal half planes in the fit.
_SQUARE = 8.0


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes over the first Fresnel zones, Fresnel units, and their weights."""

    nodes: Float[np.ndarray, "node 2"]
    weight: Complex[np.ndarray, "node"]

    @classmethod
    def fibonacci(cls, count: int, before: int) -> "Lattice":
        """Build a Fibonacci lattice; `count` and `before` are consecutive Fibonacci numbers.

        Weights are those of a square with smooth borders, corrected (least squares) so that half planes of any
        orientation give Fresnel's integral; otherwise the square's borders would diffract. Near the borders the effect
        of half planes fades, so that it does not start with a step.
        """
        k = np.arange(count)
        nodes = HALF * (2 * np.stack([(k + 0.5) / count, (k * before + 0.5) / count % 1], axis=1) - 1)
        weight = np.exp(0.5j * np.pi * np.sum(nodes**2, axis=1)) * np.cos(np.pi * nodes / (2 * HALF)).prod(axis=1)
        weight /= weight.sum()
        angle, edge = (x.ravel() for x in np.meshgrid(np.arange(24) * np.pi / 12, np.linspace(-1.5, 1.5, 31)))
        inside = edge[:, None] - np.cos(angle)[:, None] * nodes[:, 0] - np.sin(angle)[:, None] * nodes[:, 1]
        clear = _half_planes(inside, _neighbours(nodes))
        lit = edge > 0
        inner = np.clip((HALF - np.abs(edge)) / 0.45, 0, 1)
        truth = erfc(-edge * np.sqrt(np.pi / 2) * np.exp(-0.25j * np.pi)) / 2
        truth = lit + (truth - lit) * inner**2 * (3 - 2 * inner)
        # As accurate in the shadow as in the light, and more so for vertical and horizontal edges.
        share = np.where(np.abs(np.sin(2 * angle)) < 1e-9, _SQUARE, 1) / np.maximum(np.abs(truth), 0.1)
        off, keep = (truth - clear @ weight) * share, _STIFF * count * np.eye(count)
        rows = np.concatenate([clear * share[:, None], keep])
        weight += np.linalg.lstsq(rows, np.append(off, np.zeros(count)), rcond=None)[0]
        return cls(nodes, weight / weight.sum())

    @cached_property
    def links(self) -> Int[np.ndarray, "link 2"]:
        """Pairs of nodes whose cells touch."""
        return _neighbours(self.nodes)

    def degrees(self, inside: Bool[np.ndarray, "*n node"]) -> Float32[np.ndarray, "*n node"]:
        """Number of links of each node to nodes that are inside."""
        return inside.astype(np.float32) @ self._linked

    @cached_property
    def _linked(self) -> Float32[np.ndarray, "node node"]:
        linked = np.zeros((len(self.nodes), len(self.nodes)), np.float32)
        linked[tuple(np.concatenate([self.links, self.links[:, ::-1]]).T)] = 1
        return linked

    @cached_property
    def couplings(self) -> Complex[np.ndarray, "kind rho node node"]:
        """Weights of pairs of nodes for two screens of correlation 0, 1 / `_RHOS`, ... 1, along both axes (kind 0), or
        along the first one only (1)."""
        count = len(self.nodes)
        out = np.empty((2, _RHOS + 1, count, count), complex)
        out[:, 0], out[0, -1] = np.outer(self.weight, self.weight), np.diag(self.weight)
        taper = self.weight * np.exp(-0.5j * np.pi * np.sum(self.nodes**2, axis=1))
        # The kernel is averaged over cells, because it varies within them for rho near 1.
        cell = 2 * HALF / np.sqrt(count) * np.array([-0.25, 0.25])
        place = self.nodes[:, None] + np.stack(np.meshgrid(cell, cell), axis=-1).reshape(-1, 2)
        for kind, step in [(0, k) for k in range(1, _RHOS)] + [(1, k) for k in range(1, _RHOS + 1)]:
            rho = min(step / _RHOS, 0.95) * np.array([1, 1 - kind])
            scaled = place.reshape(-1, 2) / np.sqrt(1 - rho**2)
            own = np.exp(0.5j * np.pi * np.sum(scaled**2, axis=1)) * np.repeat(taper, 4)
            pair = np.exp(-1j * np.pi * (scaled * rho) @ scaled.T) * own[:, None] * own
            pair = pair.reshape(count, 4, count, 4).sum(axis=(1, 3))
            pair /= pair.sum()
            for _ in range(3):  # a clear second screen must have no effect
                scale = np.sqrt(self.weight / pair.sum(axis=1))
                pair *= scale[:, None] * scale
            out[kind, step] = pair / pair.sum()
        return out


def shares(open_: Float[np.ndarray, "link"]) -> tuple[Float[np.ndarray, "link"], Float[np.ndarray, "link"]]:
    """Open fraction of both halves of each link, that of the open node first, if the border is at `open_` from
    there."""
    return np.minimum(2 * open_, 1), np.maximum(2 * open_ - 1, 0)


def _neighbours(nodes: Float[np.ndarray, "node 2"]) -> Int[np.ndarray, "link 2"]:
    corners = Delaunay(nodes).simplices
    return np.unique(np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])), axis=0)


def _half_planes(inside: Float[np.ndarray, "plane node"], links: Int[np.ndarray, "link 2"]) -> np.ndarray:
    """Fraction of each node's cell within half planes, from the nodes' depth inside."""
    total, degree = np.zeros_like(inside), np.bincount(links.ravel(), minlength=inside.shape[1])
    for one, two in links:
        i, j = inside[:, one], inside[:, two]
        swap = i < j
        high, low = np.where(swap, j, i), np.where(swap, i, j)
        near, far = shares(np.where(high <= 0, 0, np.where(low > 0, 1, high / np.maximum(high - low, 1e-12))))
        total[:, one] += np.where(swap, far, near)
        total[:, two] += np.where(swap, near, far)
    return total / degree


FEW, MANY = Lattice.fibonacci(21, 13), Lattice.fibonacci(55, 34)


def coupled(
    one: Complex[np.ndarray, "pair 2 node"], two: Complex[np.ndarray, "pair 2 node"], rho: Float[np.ndarray, "pair"],
    mirroring: Float[np.ndarray, "pair 2"], couplings: Complex[np.ndarray, "kind rho node node"],
) -> Complex[np.ndarray, "pair"]:  # fmt: skip
    """Amplitude behind two screens with correlation rho along mirroring axes; nan: too little is within the
    outlines."""
    out = np.empty(len(rho), complex)
    _couple(np.ascontiguousarray(one), np.ascontiguousarray(two), rho, mirroring, couplings, out)
    return out


@njit(cache=True)
def _couple(one, two, rho, mirroring, couplings, out):
    steps, count = couplings.shape[1] - 1, couplings.shape[2]
    for p in range(len(out)):
        k = min(int(rho[p] * steps), steps - 1)
        t = rho[p] * steps - k
        along, across = mirroring[p]
        passed, clear = 0j, 0j
        for i in range(count):
            if one[p, 1, i] == 0:
                continue
            for j in range(count):
                if two[p, 1, j] == 0:
                    continue
                full = (1 - t) * couplings[0, k, i, j] + t * couplings[0, k + 1, i, j]
                line = (1 - t) * couplings[1, k, i, j] + t * couplings[1, k + 1, i, j]
                weight = along * (across * full + (1 - across) * line) + (1 - along) * couplings[0, 0, i, j]
                passed += weight * one[p, 0, i] * two[p, 0, j]
                clear += weight
        out[p] = passed / clear if abs(clear) > 0.05 else np.nan
