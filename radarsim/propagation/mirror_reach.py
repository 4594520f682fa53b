"""Fast test of which scatterers may be reached over mirrors, for millions of chains of mirrors and scatterers.

It excludes scatterers outside of the last mirror's aperture (`apertures.outside_aperture`), too far, turned away or too
weak.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numba import njit, prange

from radarsim.propagation.apertures import SLIT, STRIP_FAR, aperture
from radarsim.propagation.candidates import Candidates
from radarsim.propagation.fields import dot, minus, mirrored, vec
from radarsim.propagation.media import UNCOVERED
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.targets import Targets

#: Largest amplitude factor of a rectangular aperture.
MOST = SLIT**2
#: Added to cosines at scatterers, so that single precision excludes none of them; the cosine where there is no normal.
_ROUNDING, _ISOTROPIC = 1e-5, 1.0


class Trials(NamedTuple):
    """Paths over mirrors to try in one frame.

    Attributes:
        frame: index.
        chains: mirrors in order from the sensor on; the second one -1: there is none.
        candidates: rows of the scatterers that each chain may reach.
        longest, weakest: bounds, by candidate, on a path's length (m) and on its amplitude times the root of the cosine
            at the scatterer (1/m).
    """

    frame: int
    chains: Int[np.ndarray, "chain 2"]
    candidates: Int[np.ndarray, "n"]
    longest: Float[np.ndarray, "n"]
    weakest: Float[np.ndarray, "n"]


class Chains(NamedTuple):
    """Mirrors, frame, and the range of aims of each chain; those within reach are marked in `lit` from an index on,
    padded to groups of eight."""

    mirrors: Int[np.ndarray, "chain 2"]
    frame: Int[np.ndarray, "chain"]
    aims: Int[np.ndarray, "chain 2"]
    begin: Int[np.ndarray, "chain+1"]
    lit: Bool[np.ndarray, "place"]


class Aims(NamedTuple):
    """Candidates of all trials: positions, normals (`least` is added to cosines with these), and bounds as in
    `Trials`."""

    candidate: Int[np.ndarray, "aim"]
    scatterer: Int[np.ndarray, "aim"]
    place: Float32[np.ndarray, "3 aim"]
    normal: Float32[np.ndarray, "3 aim"]
    two_sided: Bool[np.ndarray, "aim"]
    least: Float32[np.ndarray, "aim"]
    longest: Float32[np.ndarray, "aim"]
    weakest: Float32[np.ndarray, "aim"]


def lit(
    observation: Observation, targets: Targets, candidates: Candidates, flat: Flat, trials: list[Trials]
) -> tuple[Chains, Aims, Int[np.ndarray, "chain"]]:
    """All chains of some trials, their aims, and the number that each may reach."""
    rows, longest, weakest = (np.concatenate(column) for column in list(zip(*trials, strict=True))[2:])
    scatterer, table = candidates.scatterer[rows], targets.scatterers
    place, normal = (
        np.ascontiguousarray(np.take(v, scatterer, axis=0).T, np.float32) for v in (table.position, table.normal)
    )
    owner = np.repeat(np.arange(len(trials)), [len(each.chains) for each in trials])
    edges = from_zero(np.array([len(each.candidates) for each in trials]))
    aims = Aims(
        rows, scatterer, place, normal, table.two_sided[scatterer],
        np.where(np.any(normal, axis=0), _ROUNDING, _ISOTROPIC).astype(np.float32), longest.astype(np.float32),
        weakest.astype(np.float32),
    )  # fmt: skip
    span = np.stack([edges[owner], edges[owner + 1]], axis=1)
    begin = 8 * from_zero(-(-(span[:, 1] - span[:, 0]) // 8))
    mirrors, frame = np.concatenate([each.chains for each in trials]), np.array([each.frame for each in trials])[owner]
    chains = Chains(mirrors, frame, span, begin, np.zeros(begin[-1], bool))
    count = np.zeros(len(mirrors), np.int64)
    _reaches(observation, flat.columns, chains, aims, count)
    return chains, aims, count


def from_zero(counts: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n+1"]:
    """Start of each of some ranges, and the end of the last one."""
    return np.concatenate([[0], np.cumsum(counts)])


@njit
def image_in(p, flat, mirrors):
    """Last of some mirrors; image of the sensor in all but the last, and in all; and the height of the former over the
    last mirror, zero if its back is turned."""
    one, two = mirrors
    last = one if two < 0 else two
    source = mirrored(p, vec(flat.center[one]), vec(flat.normal[one]))
    image = source
    if two >= 0:
        image = mirrored(source, vec(flat.center[last]), vec(flat.normal[last]))
    h = -dot(minus(image, vec(flat.center[last])), vec(flat.normal[last]))
    if h < 0 and not flat.two_sided[last]:
        h = 0.0
    return last, source, image, h


@njit(parallel=True, cache=True)
def _reaches(observation, flat, chains, aims, count):
    """Mark the aims within reach, and count them."""
    for k in prange(len(count)):
        one, two = chains.mirrors[k]
        last, _, image, h = image_in(vec(observation.position[chains.frame[k]]), flat, chains.mirrors[k])
        if abs(h) < 0.01:
            continue
        most = observation.peak_gain * MOST * flat.layer[one, UNCOVERED].real
        if two >= 0:
            most *= MOST * flat.layer[two, UNCOVERED].real
        lit, zone = chains.lit[chains.begin[k] : chains.begin[k + 1]], 0.5 * observation.wavelength * STRIP_FAR**2
        _reach(image, h, most, aperture(flat, last), zone, aims, chains.aims[k], lit)
        count[k] = len(lit_ones(lit))


@njit(cache=True)
def lit_ones(lit):
    """Indices of the true elements of a mask of aims."""
    found, n = np.empty(len(lit), np.int64), 0
    for eight, some in enumerate(lit.view(np.uint64)):
        if some != 0:  # few are
            for i in range(8 * eight, 8 * eight + 8):
                if lit[i]:
                    found[n] = i
                    n += 1
    return found[:n]


@njit(cache=True, error_model="numpy")
def _reach(image, h, most, window, zone, aims, which, lit):
    """Aims that may be reached from an image through its mirror, at height h over the image; `most`: bound over
    distance.

    A fast test in single precision that excludes aims outside of the aperture, too far, turned away or too weak; zone:
    square of the widest Fresnel zone, over the part of the path, m.
    """
    begin, end = which
    f = np.float32
    center, normal, u, v, half_u, half_v = window
    x, y, z = aims.place[0][begin:end], aims.place[1][begin:end], aims.place[2][begin:end]
    facing_x, facing_y, facing_z = aims.normal[0][begin:end], aims.normal[1][begin:end], aims.normal[2][begin:end]
    longest, weakest = aims.longest[begin:end], aims.weakest[begin:end]
    two_sided, least = aims.two_sided[begin:end], aims.least[begin:end]
    side, height = (f(1.0), f(h)) if h > 0 else (f(-1.0), f(-h))
    ox, oy, oz = f(image[0]), f(image[1]), f(image[2])
    nx, ny, nz = side * f(normal[0]), side * f(normal[1]), side * f(normal[2])
    ux, uy, uz, vx, vy, vz = f(u[0]), f(u[1]), f(u[2]), f(v[0]), f(v[1]), f(v[2])
    begin_u, begin_v = f(dot(minus(image, center), u)), f(dot(minus(image, center), v))
    half_u, half_v = f(half_u), f(half_v)
    zone, over = f(zone), f(1 / most)
    for i in range(len(x)):
        dx, dy, dz = x[i] - ox, y[i] - oy, z[i] - oz
        square = dx * dx + dy * dy + dz * dz
        full = np.sqrt(square)
        rise = dx * nx + dy * ny + dz * nz
        part = height / rise
        aside = dx * ux + dy * uy + dz * uz
        off_u = abs(begin_u + part * aside) - half_u
        off_v = abs(begin_v + part * (dx * vx + dy * vy + dz * vz)) - half_v
        face = dx * facing_x[i] + dy * facing_y[i] + dz * facing_z[i]
        turned = abs(face) if two_sided[i] else -face
        weak = weakest[i] * full * over
        across, farthest = square - aside * aside, zone * full * part * (f(1) - part)
        lit[i] = (
            (rise > height + f(0.01))
            & (full < longest[i])
            & (weak * weak < turned / full + least[i])
            & ((off_u <= f(0)) | (off_u * off_u * across < farthest * square))
            & ((off_v <= f(0)) | (off_v * off_v * rise * rise < farthest * across))
        )
