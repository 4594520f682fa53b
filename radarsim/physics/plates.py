"""The coherent echo of flat rectangles: physical optics, from near field to far field, on and off the normal.

The physical-optics integral of a rectangle under a point source is, near the normal, a product of two Fresnel
integrals, one per side. Each splits into the interior (the wall's flash, if the foot of the perpendicular lies between
the edges) and one term per edge that decays away from it:

    F = [G(u)] from u_1 to u_2,  G(u) = (C(u) + j S(u)) / (1 + j) = sign(u) (1/2 - E(|u|)),
    u = +-2 sqrt((L_edge - L_plane) / lambda), L the round trip.

The product of (interior, edge, edge) x (interior, edge, edge) gives nine parts: the mirror image of the radar in the
plane, four half turns about edges, four inversions in corners. Every part has its own exact path length |tx - M rx|, so
Doppler, angle and range of edges and corners come out right, and the parts of adjoining coplanar plates cancel along
their seam. Away from the normal the end-point contributions of the exact integral (1/lambda) I = (1/lambda) int cos
exp(j 2 k rho) / rho^2 dA replace the paraxial ones.
"""

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit
from scipy.special import fresnel

from radarsim.physics.antenna import amplitude_gain
from radarsim.physics.facets import Facets

#: Above the antenna's gain both ways, as an amplitude: for a first sieve.
PEAK_GAIN = 12.0


def parts(
    facets: Facets,
    position: Float[np.ndarray, "3"],
    rotation: Float[np.ndarray, "3 3"],
    reach: float,
    wavelength: float,
    weakest: float,
    tables: tuple[np.ndarray, np.ndarray],
) -> tuple[
    Int[np.ndarray, "part"],
    Float[np.ndarray, "part 3"],
    Float[np.ndarray, "part 3 4"],
    Complex[np.ndarray, "part"],
]:
    """Flashes, edges and corners of all facets for a sensor pose.

    Args:
        facets: rectangles.
        position, rotation: sensor pose, rotation from sensor to world.
        reach: largest one-way range, m.
        wavelength: m.
        weakest: parts below this amplitude are left out.
        tables: the antenna's gain tables.

    Returns:
        facet of each part, point that it comes from (m), isometry of the receiver, amplitude.
    """
    h = np.einsum("fd,fd->f", position - facets.center, facets.normal)
    near = np.flatnonzero((np.abs(h) > 0.01) & (np.abs(h) < reach) & (facets.two_sided | (h > 0)))
    if not len(near):
        return near, np.zeros((0, 3)), np.zeros((0, 3, 4)), np.zeros(0, complex)
    side = np.sign(h[near])
    h = np.abs(h[near])
    center, u, v, half = facets.center[near], facets.u[near], facets.v[near], facets.half[near]
    normal = facets.normal[near] * side[:, None]
    foot = np.stack([np.einsum("fd,fd->f", position - center, u), np.einsum("fd,fd->f", position - center, v)], axis=1)
    # distance from the foot to the part along u and along v, by (facet, part of that side: interior, edge -, edge +)
    across = np.stack([np.zeros_like(foot), -half - foot, half - foot], axis=-1)
    slant = np.hypot(h[:, None, None], across)
    size = side_terms(across, slant, h, wavelength)
    amplitude = size[:, 0, :, None] * size[:, 1, None, :]
    distance = np.sqrt(h[:, None, None] ** 2 + across[:, 0, :, None] ** 2 + across[:, 1, None, :] ** 2)
    amplitude = amplitude * wavelength / (8 * np.pi * h[:, None, None]) * _oblique(h, slant, distance)
    amplitude = amplitude * facets.reflection[near, 0, -1][:, None, None]
    f, i, j = np.nonzero((distance < reach) & (np.abs(amplitude) * PEAK_GAIN > weakest))
    amplitude = amplitude[f, i, j]
    along_u, along_v = (foot[f, 0] + across[f, 0, i])[:, None], (foot[f, 1] + across[f, 1, j])[:, None]
    point = center[f] + along_u * u[f] + along_v * v[f]
    towards = (point - position) @ rotation
    amplitude = amplitude * gains(towards, *tables) ** 2
    keep = np.abs(amplitude) > weakest
    f, i, j, point, amplitude = f[keep], i[keep], j[keep], point[keep], amplitude[keep]
    # The part's isometry flips the normal and each side direction on whose edge it lies.
    flips = np.stack([normal[f], u[f] * (i > 0)[:, None], v[f] * (j > 0)[:, None]], axis=1)
    matrix = np.eye(3) - 2 * np.einsum("pkd,pke->pde", flips, flips)
    offset = point - np.einsum("pde,pe->pd", matrix, point)
    # Rays aim a little inside the facet, where its neighbours do not hide it.
    edge_u = np.array([0, 1, -1])[i][:, None] * u[f]
    edge_v = np.array([0, 1, -1])[j][:, None] * v[f]
    aim = point + 0.01 * (edge_u + edge_v) + 0.002 * normal[f]
    return near[f], aim, np.concatenate([matrix, offset[:, :, None]], axis=2), amplitude


def side_terms(across, slant, h, wavelength) -> Complex[np.ndarray, "facet side part"]:
    """Interior and edge terms of the Fresnel integral along each side, phases referred to the part's own path."""
    u = 2 * np.sqrt(2 * np.maximum(slant - h[:, None, None], 0) / wavelength)
    sine, cosine = fresnel(u)
    edge = 0.5 - (cosine + 1j * sine) / (1 + 1j)
    edge = edge * np.exp(-0.5j * np.pi * u**2)
    terms = np.empty(across.shape, complex)
    sign = np.where(across >= 0, 1, -1)  # +1 on the edge itself, for both of two abutting plates
    terms[..., 0] = (sign[..., 2] - sign[..., 1]) / 2
    terms[..., 1] = sign[..., 1] * edge[..., 1]
    terms[..., 2] = -sign[..., 2] * edge[..., 2]
    return terms


def _oblique(h, slant, distance) -> Float[np.ndarray, "facet part part"]:
    """End-point contributions of the exact integral over those of the paraxial one; 1 near the normal."""
    h = h[:, None, None]
    factor = np.ones(distance.shape)
    du, dv = slant[:, 0, :, None], slant[:, 1, None, :]
    edge = np.sqrt(2) * h**2 / (distance**1.5 * np.sqrt(distance + h))
    corner = 2 * h**2 / (distance * np.sqrt((du + h) * (dv + h)))
    factor[:, 1:, 0] = edge[:, 1:, 0]
    factor[:, 0, 1:] = edge[:, 0, 1:]
    factor[:, 1:, 1:] = corner[:, 1:, 1:]
    return factor


@njit(cache=True)
def gains(directions, azimuth_table, elevation_table):
    out = np.empty(len(directions))
    for i in range(len(directions)):
        out[i] = amplitude_gain(directions[i, 0], directions[i, 1], directions[i, 2], azimuth_table, elevation_table)
    return out
