"""Specular reflections of plates and curved bodies that face the radar, with the echoes of their edges and corners."""

from dataclasses import replace

import numpy as np
from jaxtyping import Complex, Float

from radarsim.propagation import fresnelzone, patches, plates
from radarsim.propagation.curved import Arcs
from radarsim.propagation.environment import View
from radarsim.propagation.fresnelzone import AT_RADAR, Stretches
from radarsim.propagation.observation import Observation
from radarsim.propagation.paths import GEOMETRY, Kind, Paths
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.unevenness import Heights


def find(view: View) -> Paths:
    """Those of all frames above the threshold."""
    observation, flat, reflectors = view.observation, view.facing, view.environment.reflectors
    if reflectors is None:
        return Paths.none()
    found, ways = [], []
    for frame in range(observation.frames):
        parts = plates.parts(flat, observation, frame)
        parts = parts[flat.present(frame)[parts.facet]]
        bodies = reflectors.round.flashes(observation, frame), patches.flashes(observation, frame, reflectors.smooth)
        arcs = Arcs.joined(list(bodies))
        if reflectors.heights is not None:
            uneven = _uneven(observation, frame, flat[parts.facet], parts.aim, reflectors.heights)
            parts = replace(parts, amplitude=parts.amplitude * uneven)
        ways += [_to_parts(observation, frame, flat, parts), _to_bodies(observation, frame, arcs.aim)]
        mirrors = np.full((len(parts), 4), -1)
        mirrors[:, 0] = parts.facet
        shape = np.pad(arcs.shape, ((0, 0), (0, GEOMETRY - arcs.shape.shape[1])))
        found += [
            Paths.of(
                Kind.IMAGE, parts.isometry, parts.amplitude, frame=frame, level=flat.horizontal[parts.facet],
                mirrors=mirrors,
            ),
            Paths.of(Kind.CURVED, shape, arcs.amplitude, frame=frame),
        ]  # fmt: skip
    paths = Paths.joined(found)
    passed = fresnelzone.passage(observation, flat, view.obstacles, Stretches.joined(ways), np.abs(paths.amplitude))
    lag = np.append(flat.lag, 0.0)[paths.mirrors[:, 0]]  # at the centre of the sweep, amplitudes know it
    paths = replace(paths, amplitude=paths.amplitude * np.exp(-2j * np.pi * lag / observation.wavelength))
    twice = replace(passed, factor=passed.factor**2, delay=2 * passed.delay + lag)  # there and back
    return paths.behind(observation, twice)


def _to_parts(observation: Observation, frame: int, flat: Flat, parts: plates.Parts) -> Stretches:
    """The ways to parts of plates; edges and corners are seen by one ray."""
    here = observation.position[frame]
    flash = np.trace(parts.isometry[:, :, :3], axis1=1, axis2=2) > 0  # a reflection, no half turn or inversion
    unit = np.sqrt(observation.wavelength * np.linalg.norm(parts.aim - here, axis=1) / 4) * flash
    after = unit[:, None, None] * np.stack([flat.u[parts.facet], flat.v[parts.facet]], axis=1)
    mirrors = np.where(np.arange(3) == 0, np.where(flash, parts.facet, -1)[:, None], -1)
    begin, stops = np.broadcast_to(here, parts.aim.shape), np.repeat(parts.aim[:, None], 3, axis=1)
    ends = begin, parts.aim, AT_RADAR * after, after
    return Stretches(np.full(len(parts), frame), *ends, mirrors, stops, np.repeat(after[:, None], 3, axis=1))


def _to_bodies(observation: Observation, frame: int, aim: Float[np.ndarray, "part 3"]) -> Stretches:
    """The ways to round bodies, whose zones end in a point, or nearly so: a cone, as wide as they are half way."""
    begin = np.broadcast_to(observation.position[frame], aim.shape)
    way = aim - begin
    size = np.linalg.norm(way, axis=1, keepdims=True)
    aside = np.cross(way / size, observation.rotation[frame, :, 2])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    before = np.sqrt(observation.wavelength * size / 8)[:, None] * np.stack(
        [aside, np.cross(way / size, aside)], axis=1
    )
    none = np.full((len(aim), 3), -1), np.zeros((len(aim), 3, 3)), np.zeros((len(aim), 3, 2, 3))
    return Stretches(np.full(len(aim), frame), begin, aim, before, 0 * before, *none)


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
