"""Echoes by flat and round bodies alone, as images of the radar: flashes, edges and corners, and chains of mirrors."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float, Int, UInt8

from radarsim.physics import imagemethod, plates
from radarsim.physics.curved import RoundBodies
from radarsim.physics.echoes import Provenance
from radarsim.physics.obstacles import Obstacles
from radarsim.physics.reflectors import Flat
from radarsim.physics.search import Search
from radarsim.physics.sight import Mirrors
from radarsim.physics.table import Table
from radarsim.physics.unevenness import Heights

#: Slabs are looked for in the way of echoes that are at least this much stronger than the threshold.
LEAST_LOSS = 4.0


@dataclass(frozen=True)
class Images(Table):
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
    def none(cls) -> "Images":
        """No image."""
        return cls(np.zeros(0, int), np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, np.uint8))


def flashes(
    search: Search, flat: Flat, round_bodies: RoundBodies, obstacles: Obstacles, heights: Heights | None = None
) -> Images:
    """Plates, as even as `heights` says, and round bodies that face the radar."""
    aims, found = [], []
    for frame in range(search.frames):
        parts = plates.parts(flat, search, frame)
        aim, isometry, amplitude = round_bodies.flashes(search, frame)
        cause = np.where(flat.horizontal[parts.facet], Provenance.FLOOR_CEILING, Provenance.DIRECT)
        cause = np.append(cause, np.full(len(aim), Provenance.DIRECT)).astype(np.uint8)
        if heights is not None:
            uneven = _uneven(search, frame, flat[parts.facet], parts.aim, heights)
            parts = replace(parts, amplitude=parts.amplitude * uneven)
        aims += [parts.aim, aim]
        isometry = np.concatenate([parts.isometry, isometry])
        found.append(Images(np.full(len(cause), frame), isometry, np.append(parts.amplitude, amplitude), cause))
    images, aim = Images.joined(found), np.concatenate(aims)
    worth = np.abs(images.amplitude) > LEAST_LOSS * search.threshold
    factor, delay = obstacles.passage(search, images.frame, search.position[images.frame], aim, worth)
    return _passed(search, images, factor**2, 2 * delay)  # there and back


def _uneven(
    search: Search, frame: int, flat: Flat, aim: Float[np.ndarray, "part 3"], heights: Heights
) -> Complex[np.ndarray, "part"]:
    """What unevenness makes of parts of plates: the factor at the foot, less and less of it away from there."""
    begin = search.position[frame]
    height = np.einsum("pd,pd->p", begin - flat.center, flat.normal)
    foot, away = begin - height[:, None] * flat.normal, np.abs(height)
    reach = heights.reach(away, flat.finish, search.wavelength)
    share = np.clip(2 * (1 - np.linalg.norm(aim - foot, axis=1) / np.maximum(reach, 1e-9)), 0, 1)
    factor, near = np.ones(len(aim), complex), np.flatnonzero((share > 0) & (flat.finish > 0))
    # Parts of one plate, and plates of one wall, share a foot.
    _, one, which = np.unique(foot[near].round(6), axis=0, return_index=True, return_inverse=True)
    some = near[one]
    found = heights.factors(np.broadcast_to(begin, (len(some), 3)), foot[some], flat.finish[some], search.wavelength)
    factor[near] += share[near] * (found[which.ravel()] - 1)
    return factor


def _passed(search: Search, images: Images, factor, delay) -> Images:
    """What is left of images on whose way obstacles leave a factor, and slabs a delay (m), which moves them away."""
    isometry, begin = images.isometry.copy(), search.position[images.frame]
    away = np.einsum("pij,pj->pi", isometry[:, :, :3], begin) + isometry[:, :, 3] - begin
    isometry[:, :, 3] += (delay / np.linalg.norm(away, axis=1))[:, None] * away
    cause = np.where(factor == 1, images.cause, np.uint8(Provenance.THROUGH_SLAB))
    amplitude = images.amplitude * factor
    return Images(images.frame, isometry, amplitude, cause)[np.abs(amplitude) > search.threshold]


def by_chains(search: Search, flat: Flat, mirrors: list[Mirrors], obstacles: Obstacles) -> Images:
    """Chains of mirrors, either way round.

    Args:
        search, flat, obstacles: the sensor, the mirrors, and what is in the way.
        mirrors: those of each frame.
    """
    found = [imagemethod.chains(flat, some.pairs, search, k) for k, some in enumerate(mirrors)]
    frame = np.repeat(np.arange(len(found)), [len(f) for f in found])
    chains = imagemethod.Chains.joined(found)
    two = chains.mirrors[:, 1] == chains.mirrors[:, 2]
    a, b, c = flat.normal[chains.mirrors].transpose(1, 0, 2)
    slant = np.abs(np.einsum("cd,cd->c", a, b)) + np.abs(np.einsum("cd,cd->c", a, c))
    slant += np.where(two, 0, np.abs(np.einsum("cd,cd->c", b, c)))
    cause = np.where(two, Provenance.GHOST_2, Provenance.GHOST_3).astype(np.uint8)
    cause[slant < 1e-3] = Provenance.DIRECT
    there = Images(frame, chains.isometry, chains.amplitude, cause)
    stops = np.concatenate([chains.stops, search.position[frame, None]], axis=1)
    worth = np.abs(chains.amplitude) > LEAST_LOSS * search.threshold
    factor, delay = obstacles.way(search, frame, stops, np.full(len(frame), 4), worth)
    back = replace(there, isometry=imagemethod.reverse(chains.isometry))
    two_ways = chains.mirrors[:, 0] != chains.mirrors[:, 2]
    return Images.joined([
        _passed(search, there, factor, delay), _passed(search, back[two_ways], factor[two_ways], delay[two_ways])
    ])  # fmt: skip
