"""Echoes by flat and round bodies alone, as images of the radar: flashes, edges and corners, and chains of mirrors."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int, UInt8

from radarsim.physics import chains, plates
from radarsim.physics.batch import Batch
from radarsim.physics.curved import Curved
from radarsim.physics.echoes import Provenance
from radarsim.physics.facets import Facets
from radarsim.physics.mirrors import Mirrors
from radarsim.physics.obstacles import Obstacles
from radarsim.physics.unevenness import Heights
from radarsim.physics.view import View

#: Slabs are looked for in the way of echoes that are at least this much stronger than the weakest of interest.
LEAST_LOSS = 4.0


@dataclass(frozen=True)
class Images:
    """Images of the receiver.

    Attributes:
        frame: index.
        isometry: matrix | offset, world.
        amplitude: square root of received over transmitted power, with phase.
        cause: a `Provenance` each.
    """

    frame: Int[np.ndarray, "image"]
    isometry: Float[np.ndarray, "image 3 4"]
    amplitude: Complex[np.ndarray, "image"]
    cause: UInt8[np.ndarray, "image"]

    @classmethod
    def of(cls, batch: Batch, facets: Facets, curved: Curved | None, mirrors: Mirrors, near: list[np.ndarray],
           obstacles: Obstacles, views: list[View], heights: Heights | None = None) -> "Images":  # fmt: skip
        """All images in a batch, sorted by frame.

        Args:
            batch: sensor poses.
            facets, curved: flat and round bodies.
            mirrors, near: and which of them can be first and last of a chain in each frame.
            obstacles: what is in the way.
            views: of each frame.
            heights: how uneven walls are; None: flat.
        """
        parts = [flashes(batch, facets, curved, obstacles, views, heights)]
        parts.append(by_chains(batch, mirrors, near, obstacles, views))
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        order = np.argsort(columns[0], kind="stable")
        return cls(*(column[order] for column in columns))


def flashes(
    batch: Batch, facets: Facets, curved: Curved | None, obstacles: Obstacles, views: list[View],
    heights: Heights | None = None,
) -> tuple:  # fmt: skip
    """Plates and round bodies: columns of `Images`."""
    facets, found = facets.near(batch.position, views[0].reach), []
    for view in views:
        facet, *flat = plates.parts(facets, view)
        cause = np.where(facets.horizontal[facet], Provenance.FLOOR_CEILING, Provenance.DIRECT)
        found.append((facet, *flat, cause))
        if curved is not None:
            round_ = curved.parts(view)
            bent = (np.full(len(round_[0]), -1), *round_, np.full(len(round_[0]), Provenance.DIRECT))
            found[-1] = tuple(np.concatenate(pair) for pair in zip(found[-1], bent, strict=True))
    frame = np.repeat(np.arange(len(found)), [len(f[0]) for f in found])
    facet, aim, isometry, amplitude, cause = (np.concatenate(column) for column in zip(*found, strict=True))
    begin, weakest = batch.position[frame], views[0].weakest
    worth = np.abs(amplitude) > LEAST_LOSS * weakest
    factor, delay = obstacles.passage(batch, frame, begin, aim, worth)
    cause[factor != 1] = Provenance.THROUGH_SLAB
    amplitude = amplitude * factor**2  # there and back
    # A delay moves the receiver's image away.
    away = np.einsum("pij,pj->pi", isometry[:, :, :3], begin) + isometry[:, :, 3] - begin
    isometry[:, :, 3] += (2 * delay / np.linalg.norm(away, axis=1))[:, None] * away
    keep = np.abs(amplitude) > weakest
    if heights is not None:
        uneven = np.flatnonzero(keep & (facet >= 0))
        amplitude[uneven] *= _uneven(heights, facets, facet[uneven], begin[uneven], aim[uneven], views[0].wavelength)
    return frame[keep], isometry[keep], amplitude[keep], cause[keep].astype(np.uint8)


def _uneven(
    heights: Heights, facets: Facets, facet: Int[np.ndarray, "part"], begin: Float[np.ndarray, "part 3"],
    aim: Float[np.ndarray, "part 3"], wavelength: float,
) -> Complex[np.ndarray, "part"]:  # fmt: skip
    """What unevenness makes of parts of plates: the factor at the foot, less and less of it away from there."""
    normal, finish = facets.normal[facet], facets.finish[facet]
    height = np.einsum("pd,pd->p", begin - facets.center[facet], normal)
    foot, away = begin - height[:, None] * normal, np.abs(height)
    reach = heights.reach(away, finish, wavelength)
    share = np.clip(2 * (1 - np.linalg.norm(aim - foot, axis=1) / np.maximum(reach, 1e-9)), 0, 1)
    factor, near = np.ones(len(facet), complex), np.flatnonzero((share > 0) & (finish > 0))
    # Parts of one plate, and plates of one wall, share a foot.
    _, one, which = np.unique(np.hstack([begin, foot])[near].round(6), axis=0, return_index=True, return_inverse=True)
    some = near[one]
    found = heights.factors(begin[some], foot[some], finish[some], wavelength)
    factor[near] += share[near] * (found[which.ravel()] - 1)
    return factor


def by_chains(batch: Batch, mirrors: Mirrors, near: list[np.ndarray], obstacles: Obstacles, views: list[View]) -> tuple:
    """Chains of mirrors, either way round: columns of `Images`."""
    found = [chains.images(mirrors, n, view) for n, view in zip(near, views, strict=True)]
    frame = np.repeat(np.arange(len(found)), [len(f[0]) for f in found])
    chain, isometry, amplitude, stops = (np.concatenate(column) for column in zip(*found, strict=True))
    place = [batch.position[frame], *stops.transpose(1, 0, 2), batch.position[frame]]
    blocked = obstacles.between(batch, np.tile(frame, 4), np.concatenate(place[:-1]), np.concatenate(place[1:]))
    free = np.flatnonzero(~blocked.reshape(4, -1).any(axis=0))
    both = free[chain[free, 0] != chain[free, 2]]
    two = chain[:, 1] == chain[:, 2]
    a, b, c = mirrors.normal[chain].transpose(1, 0, 2)
    slant = np.abs(np.einsum("cd,cd->c", a, b)) + np.abs(np.einsum("cd,cd->c", a, c))
    slant += np.where(two, 0, np.abs(np.einsum("cd,cd->c", b, c)))
    cause = np.where(two, Provenance.GHOST_2, Provenance.GHOST_3).astype(np.uint8)
    cause[slant < 1e-3] = Provenance.DIRECT
    isometry = np.concatenate([isometry[free], chains.reverse(isometry[both])])
    free = np.concatenate([free, both])
    return frame[free], isometry, amplitude[free], cause[free]
