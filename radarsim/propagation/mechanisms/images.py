"""Echoes by flat and round bodies alone, as images of the radar: flashes, edges and corners, and chains of mirrors."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float, Int, UInt8

from radarsim.propagation import fresnelzone, patches, plates
from radarsim.propagation.curved import LINE, SHAPE, Arcs
from radarsim.propagation.echoes import Provenance
from radarsim.propagation.fresnelzone import AT_RADAR, Stretches
from radarsim.propagation.isometry import inverse
from radarsim.propagation.mechanisms import image_chains
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.table import Table
from radarsim.propagation.unevenness import Heights
from radarsim.propagation.visible_mirrors import Mirrors


@dataclass(frozen=True)
class Images(Table):
    """Images of the receiver.

    Attributes:
        frame: index.
        isometry: matrix | offset, world.
        amplitude: square root of received over transmitted power, with phase.
        cause: a `Provenance` each.
        mirrors: the flat reflector that it is a part of, or those that it is seen in, in order; -1: none.
        shape: of the round body that it is a part of, see `curved.Arcs`, and the delay by slabs, m; else nought.
    """

    frame: Int[np.ndarray, "image"]
    isometry: Float[np.ndarray, "image 3 4"]
    amplitude: Complex[np.ndarray, "image"]
    cause: UInt8[np.ndarray, "image"]
    mirrors: Int[np.ndarray, "image 3"]
    shape: Float[np.ndarray, "image 14"]

    @classmethod
    def none(cls) -> "Images":
        """No image."""
        none = np.zeros(0, int), np.zeros((0, 3, 4)), np.zeros(0, complex), np.zeros(0, np.uint8)
        return cls(*none, np.zeros((0, 3), int), np.zeros((0, SHAPE + 1)))


def flashes(observation: Observation, flat: Flat, reflectors: Reflectors, obstacles: Obstacles) -> Images:
    """Plates, as even as they are, and curved reflectors that face the radar.

    Args:
        observation, obstacles: the frames, and what is in the way.
        flat: those in range, and those that move.
        reflectors: of the scene; its curved ones and its unevenness count.
    """
    found, ways = [], []
    for frame in range(observation.frames):
        parts = plates.parts(flat, observation, frame)
        parts = parts[flat.present(frame)[parts.facet]]
        arcs = Arcs.joined(
            [reflectors.round.flashes(observation, frame), patches.flashes(observation, frame, reflectors.smooth)]
        )
        cause = np.where(flat.horizontal[parts.facet], Provenance.FLOOR_CEILING, Provenance.DIRECT)
        cause = np.append(cause, np.full(len(arcs), Provenance.DIRECT)).astype(np.uint8)
        if reflectors.heights is not None:
            uneven = _uneven(observation, frame, flat[parts.facet], parts.aim, reflectors.heights)
            parts = replace(parts, amplitude=parts.amplitude * uneven)
        ways += [_to_parts(observation, frame, flat, parts), _to_bodies(observation, frame, arcs)]
        isometry = np.concatenate([parts.isometry, arcs.isometry])
        mirrors, shape = np.full((len(cause), 3), -1), np.zeros((len(cause), SHAPE + 1))
        mirrors[: len(parts), 0], shape[len(parts) :, :SHAPE] = parts.facet, arcs.shape
        amplitude = np.append(parts.amplitude, arcs.amplitude)
        found.append(Images(np.full(len(cause), frame), isometry, amplitude, cause, mirrors, shape))
    images, ways = Images.joined(found), Stretches.joined(ways)
    ways = replace(ways, path=np.arange(len(ways)))
    factor, delay = fresnelzone.passage(observation, flat, obstacles, ways, np.abs(images.amplitude))
    lag = np.append(flat.lag, 0.0)[images.mirrors[:, 0]]  # at the centre of the sweep, amplitudes know it
    images = replace(images, amplitude=images.amplitude * np.exp(-2j * np.pi * lag / observation.wavelength))
    return _passed(observation, images, factor, delay + lag)


def _to_parts(observation: Observation, frame: int, flat: Flat, parts: plates.Parts) -> Stretches:
    """The ways to parts of plates: a flash mirrors, an edge mirrors along its line, a corner echoes like a point.

    Across an edge that is near the flash, in Fresnel units, it is a part of the same zone and goes over into it.
    """
    here, n = observation.position[frame], len(parts)
    way = parts.aim - here
    turn = parts.isometry[:, :, :3]
    kind = np.trace(turn, axis1=1, axis2=2).round().astype(int)  # 1: reflection, -1: half turn, -3: inversion
    unit = np.sqrt(observation.wavelength * np.linalg.norm(way, axis=1) / 4)
    u, normal = flat.u[parts.facet], flat.normal[parts.facet]
    # (M + 1) / 2 of a half turn projects on its axis
    line = np.einsum("pii->pi", turn).argmax(axis=1)
    u = np.where((kind == -1)[:, None], (turn + np.eye(3))[np.arange(n), line], u)
    u = u / np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(normal, u)
    beside = np.abs(np.einsum("pd,pd->p", way, v)) / unit
    mirroring = np.ones((n, 2))
    mirroring[:, 1] = np.where(kind == -1, 1 / (1 + beside**2), 1)
    mirroring[kind == -3] = 0
    axes = unit[:, None, None] * np.stack([u, v], axis=1)
    before, after = _spread(mirroring, axes)
    mirrors = np.stack([np.full(n, -1), np.where(kind == -3, -1, parts.facet)], axis=1)
    span = np.tile([0.0, 0.5], (n, 1))
    begin = np.broadcast_to(here, parts.aim.shape)
    return Stretches(
        np.zeros(n, int), np.full(n, frame), begin, parts.aim, before, after, mirrors, span, mirroring
    )  # fmt: skip


def _spread(mirroring, axes):
    """How far a Fresnel unit moves both ends of ways: to a mirror, and to a point, which is the tip of a cone."""
    mirroring = mirroring[..., None]
    return (1 - (1 - AT_RADAR) * mirroring) * axes, mirroring * axes


def _to_bodies(observation: Observation, frame: int, arcs: Arcs) -> Stretches:
    """The ways to round bodies, which echo like points, and cylinders along their axis like mirrors."""
    begin, n = np.broadcast_to(observation.position[frame], arcs.aim.shape), len(arcs)
    way = arcs.aim - begin
    size = np.linalg.norm(way, axis=1, keepdims=True)
    line = arcs.shape[:, :1] == LINE
    aside = np.where(line, arcs.shape[:, 4:7], np.cross(way / size, observation.rotation[frame, :, 2]))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axes = np.sqrt(observation.wavelength * size / 4)[..., None] * np.stack(
        [aside, np.cross(way / size, aside)], axis=1
    )
    mirroring = np.column_stack([line, np.zeros(n)]).astype(float)
    before, after = _spread(mirroring, axes)
    none, span = np.full((n, 2), -1), np.tile([0.0, 0.5], (n, 1))
    return Stretches(
        np.zeros(n, int), np.full(n, frame), begin, arcs.aim, before, after, none, span, mirroring
    )  # fmt: skip


def _uneven(
    observation: Observation, frame: int, flat: Flat, aim: Float[np.ndarray, "part 3"], heights: Heights
) -> Complex[np.ndarray, "part"]:
    """What unevenness makes of parts of plates: the factor at the foot, less and less of it away from there."""
    begin = observation.position[frame]
    height = np.einsum("pd,pd->p", begin - flat.center, flat.normal)
    foot, away = begin - height[:, None] * flat.normal, np.abs(height)
    reach = heights.reach(away, flat.finish, observation.wavelength)
    share = np.clip(2 * (1 - np.linalg.norm(aim - foot, axis=1) / np.maximum(reach, 1e-9)), 0, 1)
    factor, near = np.ones(len(aim), complex), np.flatnonzero((share > 0) & (flat.finish > 0))
    # Parts of one plate, and plates of one wall, share a foot.
    _, one, which = np.unique(foot[near].round(6), axis=0, return_index=True, return_inverse=True)
    some = near[one]
    found = heights.factors(
        np.broadcast_to(begin, (len(some), 3)), foot[some], flat.finish[some], observation.wavelength
    )
    factor[near] += share[near] * (found[which.ravel()] - 1)
    return factor


def _passed(observation: Observation, images: Images, factor, delay) -> Images:
    """What is left of images on whose way obstacles leave a factor, and slabs a delay (m), which moves them away."""
    amplitude = images.amplitude * factor
    kept = np.abs(amplitude) > observation.threshold
    images, amplitude, factor, delay = images[kept], amplitude[kept], factor[kept], delay[kept]
    isometry, begin = images.isometry.copy(), observation.position[images.frame]
    away = np.einsum("pij,pj->pi", isometry[:, :, :3], begin) + isometry[:, :, 3] - begin
    isometry[:, :, 3] += (delay / np.linalg.norm(away, axis=1))[:, None] * away
    cause = np.where(factor == 1, images.cause, np.uint8(Provenance.THROUGH_SLAB))
    shape = images.shape.copy()
    shape[:, SHAPE] = delay
    return replace(images, isometry=isometry, amplitude=amplitude, cause=cause, shape=shape)


def _along(
    observation: Observation, flat: Flat, frame: Int[np.ndarray, "chain"], chains: image_chains.Chains
) -> Stretches:
    """The four stretches of each chain, of two mirrors one of no length."""
    here = observation.position[frame, None]
    stops = np.concatenate([here, chains.stops, here], axis=1)
    way = np.diff(stops, axis=1)
    size = np.linalg.norm(way, axis=2)
    there, whole = np.cumsum(size, axis=1)[:, :3], size.sum(axis=1)[:, None]
    unit = np.sqrt(observation.wavelength * there * (whole - there) / (2 * whole))
    now = way[:, 0] / size[:, 0, None]
    aside = np.cross(now, observation.rotation[frame, :, 2])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axes = np.stack([aside, np.cross(now, aside)], axis=1)
    apart = np.empty((len(frame), 5, 2, 3))  # of a unit aside, by stop
    apart[:, 0] = AT_RADAR * unit[:, 0, None, None] * axes
    for k in range(3):
        normal = flat.normal[chains.mirrors[:, k]]
        lift = np.einsum("cad,cd->ca", axes, normal)[..., None]
        slope = np.einsum("cd,cd->c", now, normal)[:, None]
        apart[:, k + 1] = unit[:, k, None, None] * (axes - lift * (now / slope)[:, None])  # in the mirror's plane
        last = (chains.mirrors[:, k] == chains.mirrors[:, min(k + 1, 2)]) & (k < 2)  # twice: it reflects once
        axes = np.where(last[:, None, None], axes, axes - 2 * lift * normal[:, None])
        now = np.where(last[:, None], now, now - 2 * slope * normal)
    apart[:, 4] = AT_RADAR * unit[:, 2, None, None] * axes
    none = np.full((len(frame), 1), -1)
    mirrors = np.concatenate([none, chains.mirrors, none], axis=1)
    along = np.concatenate([np.zeros_like(whole), there, whole], axis=1) / whole
    return Stretches(
        np.repeat(np.arange(len(frame)), 4), np.repeat(frame, 4),
        stops[:, :-1].reshape(-1, 3), stops[:, 1:].reshape(-1, 3),
        apart[:, :-1].reshape(-1, 2, 3), apart[:, 1:].reshape(-1, 2, 3),
        np.stack([mirrors[:, :-1], mirrors[:, 1:]], axis=2).reshape(-1, 2),
        np.stack([along[:, :-1], along[:, 1:]], axis=2).reshape(-1, 2), np.ones((4 * len(frame), 2)),
    )  # fmt: skip


def by_chains(observation: Observation, flat: Flat, mirrors: list[Mirrors], obstacles: Obstacles) -> Images:
    """Chains of mirrors, either way round.

    Args:
        observation, flat, obstacles: the sensor, the mirrors, and what is in the way.
        mirrors: those of each frame.
    """
    found = [image_chains.chains(flat, some.pairs, observation, k) for k, some in enumerate(mirrors)]
    frame = np.repeat(np.arange(len(found)), [len(f) for f in found])
    chains = image_chains.Chains.joined(found)
    two = chains.mirrors[:, 1] == chains.mirrors[:, 2]
    a, b, c = flat.normal[chains.mirrors].transpose(1, 0, 2)
    slant = np.abs(np.einsum("cd,cd->c", a, b)) + np.abs(np.einsum("cd,cd->c", a, c))
    slant += np.where(two, 0, np.abs(np.einsum("cd,cd->c", b, c)))
    cause = np.where(two, Provenance.GHOST_2, Provenance.GHOST_3).astype(np.uint8)
    cause[slant < 1e-3] = Provenance.DIRECT
    order = np.where(two[:, None], chains.mirrors * [1, 1, 0] - [0, 0, 1], chains.mirrors)
    there = Images(frame, chains.isometry, chains.amplitude, cause, order, np.zeros((len(frame), SHAPE + 1)))
    ways = _along(observation, flat, frame, chains)
    factor, delay = fresnelzone.passage(observation, flat, obstacles, ways, np.abs(chains.amplitude))
    order = np.where(two[:, None], order[:, [1, 0, 2]], order[:, ::-1])
    back = replace(there, isometry=inverse(chains.isometry), mirrors=order)
    two_ways = chains.mirrors[:, 0] != chains.mirrors[:, 2]
    return Images.joined([
        _passed(observation, there, factor, delay),
        _passed(observation, back[two_ways], factor[two_ways], delay[two_ways]),
    ])  # fmt: skip
