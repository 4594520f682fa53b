"""Specular reflections of plates and curved bodies, with the diffraction of their edges and corners."""

from dataclasses import replace

import numpy as np
from jaxtyping import Complex, Float, Int

from radarsim.propagation import fresnelzone, patches, plates
from radarsim.propagation.curved import LINE, SpecularPoints
from radarsim.propagation.environment import View
from radarsim.propagation.fresnelzone import AT_RADAR, PathSegments
from radarsim.propagation.isometry import image
from radarsim.propagation.observation import Observation
from radarsim.propagation.paths import Kind, Paths
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.unevenness import Heights

#: See `_merged`.
_APART = 0.6


def find(view: View) -> Paths:
    """Find the specular reflections of all frames above the threshold."""
    observation, flat, reflectors = view.observation, view.facing, view.environment.reflectors
    if reflectors is None:
        return Paths.zeros(0)
    found, bodies = [], []
    for frame in range(observation.frames):
        some = plates.specular_points(flat, observation, frame)
        some = some[flat.present(frame)[some.facet]]
        if reflectors.heights is not None:
            uneven = _uneven(observation, frame, flat[some.facet], some.aim, reflectors.heights)
            some = replace(some, amplitude=some.amplitude * uneven)
        found.append(some)
        bodies += [
            reflectors.round.specular_points(observation, frame),
            patches.specular_points(observation, frame, reflectors.smooth),
        ]
    parts, curved = SpecularPoints.joined(found), SpecularPoints.joined(bodies)
    frames = np.arange(observation.frames)
    of_part, parts = _merged(observation, np.repeat(frames, [len(some) for some in found]), flat, parts)
    of_curved = np.repeat(np.repeat(frames, 2), [len(some) for some in bodies])
    mirrors = np.full((len(parts), 4), -1)
    mirrors[:, 0] = parts.facet
    paths = Paths.joined([
        Paths.of(Kind.IMAGE, parts.isometry, parts.amplitude, frame=of_part, level=flat.horizontal[parts.facet],
                 mirrors=mirrors),
        Paths.of(Kind.CURVED, curved.geometry, curved.amplitude, frame=of_curved),
    ])  # fmt: skip
    ways = [_to_parts(observation, of_part, flat, parts), _to_bodies(observation, of_curved, curved)]
    segments = replace(PathSegments.joined(ways), path=np.arange(len(paths)))
    passed = fresnelzone.passage(observation, flat, view.obstacles, segments, np.abs(paths.amplitude))
    lag = np.append(flat.lag, 0.0)[paths.mirrors[:, 0]]  # amplitudes include it at the centre of the sweep
    paths = replace(paths, amplitude=paths.amplitude * np.exp(-2j * np.pi * lag / observation.wavelength))
    return paths.behind(observation, replace(passed, delay=passed.delay + lag))


def _merged(
    observation: Observation, frame: Int[np.ndarray, "part"], flat: Flat, parts: SpecularPoints
) -> tuple[Int[np.ndarray, "merged"], SpecularPoints]:
    """Merge the parts across a strip that is narrower than a zone into one, at its middle line.

    Edges on both sides of a strip nearly cancel: their amplitudes go as 1 / s, s from the specular point, which changes
    as the radar moves by a fraction of s. That of the whole strip changes less while s times its width is below about
    `_APART` squared Fresnel units.
    """
    some = flat[parts.facet]
    here, axes = observation.position[frame] - some.center, np.stack([some.u, some.v, some.normal], axis=1)
    aside = np.einsum("pad,pd->pa", axes, here)
    square = observation.wavelength * np.abs(aside[:, 2:]) / 4  # of a Fresnel unit
    corners = np.einsum("pad,pkd->pka", axes[:, :2], some.corners - some.center[:, None])
    rectangle = (np.abs(np.abs(corners) - some.half[:, None]) < 1e-6).all(axis=(1, 2))
    width = 2 * some.half
    narrow = rectangle[:, None] & (width**2 < square) & (width * np.abs(aside[:, :2]) < _APART * square)
    rows = np.flatnonzero(narrow.any(axis=1))
    if not len(rows):
        return frame, parts
    narrow, axes, center, place = narrow[rows], axes[rows], some.center[rows], observation.position[frame[rows]]
    # along u and v a part does not mirror, or only about a line so far from the middle
    turned = np.einsum("pad,pde,pae->pa", axes, parts.isometry[rows, :, :3], axes)[:, :2] < 0
    line = np.einsum("pad,pd->pa", axes[:, :2], image(parts.isometry[rows], center) - center) / 2
    side = np.where(narrow, 2, np.where(turned, np.sign(line), 0)).astype(int)
    key = np.column_stack([frame[rows], parts.facet[rows], side])
    _, first, which = np.unique(key, axis=0, return_index=True, return_inverse=True)
    sign = np.column_stack([np.where(narrow | turned, -1, 1), np.full(len(rows), -1)])
    isometry = np.empty((len(rows), 3, 4))
    isometry[..., :3] = np.einsum("pad,pa,pae->pde", axes, sign, axes)
    isometry[..., 3] = center - np.einsum("pde,pe->pd", isometry[..., :3], center)
    isometry[..., 3] += 2 * np.einsum("pa,pad->pd", np.where(narrow | ~turned, 0, line), axes[:, :2])
    path, new = (np.linalg.norm(image(each, place) - place, axis=1) for each in (parts.isometry[rows], isometry))
    amplitude = np.zeros(len(first), complex)
    turn = np.exp(2j * np.pi / observation.wavelength * (path - new))
    np.add.at(amplitude, which.ravel(), parts.amplitude[rows] * turn)
    one, across = rows[first], np.where(narrow[..., None], axes[:, :2], 0)[first]
    aim = parts.aim[one]
    aim = aim - np.einsum("pad,pae,pe->pd", across, across, aim - center[first])
    geometry = parts.geometry[one]
    geometry[:, :12] = isometry[first].reshape(-1, 12)
    strips = SpecularPoints(parts.facet[one], aim, geometry, amplitude)
    rest = np.setdiff1d(np.arange(len(parts)), rows, assume_unique=True)
    return np.append(frame[rest], frame[one]), SpecularPoints.joined([parts[rest], strips])


def _to_parts(
    observation: Observation, frame: Int[np.ndarray, "part"], flat: Flat, parts: SpecularPoints
) -> PathSegments:
    """Path segments to parts of plates: a face mirrors, an edge mirrors along its line, a corner scatters like a point.

    An edge that is near the specular point, in Fresnel units, is part of the same zone; the transition is smooth.
    """
    here, n = observation.position[frame], len(parts)
    way = parts.aim - here
    turn = parts.isometry[:, :, :3]
    kind = np.trace(turn, axis1=1, axis2=2).round().astype(int)  # 1: reflection, -1: half turn, -3: inversion
    unit = np.sqrt(observation.wavelength * np.linalg.norm(way, axis=1) / 4)
    u, normal = flat.u[parts.facet], flat.normal[parts.facet]
    # (M + 1) / 2 of a half turn projects onto its axis
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
    mirrors = np.where(np.arange(3) == 0, np.where(kind == -3, -1, parts.facet)[:, None], -1)
    stops = np.repeat(parts.aim[:, None], 3, axis=1), np.repeat(after[:, None], 3, axis=1)
    span = np.tile([0.0, 0.5], (n, 1))
    return PathSegments(
        np.zeros(n, int), frame, here, parts.aim, before, after, mirrors, *stops, span, mirroring
    )  # fmt: skip


def _spread(mirroring, axes):
    """Shift of both ends of a segment per Fresnel unit: to a mirror, and to a point, which is the tip of a cone."""
    mirroring = mirroring[..., None]
    return (1 - (1 - AT_RADAR) * mirroring) * axes, mirroring * axes


def _to_bodies(observation: Observation, frame: Int[np.ndarray, "point"], curved: SpecularPoints) -> PathSegments:
    """Path segments to round bodies, which scatter like points, and to cylinders, which mirror along their axis."""
    begin, n = observation.position[frame], len(curved)
    way = curved.aim - begin
    size = np.linalg.norm(way, axis=1, keepdims=True)
    line = curved.geometry[:, :1] == LINE
    aside = np.where(line, curved.geometry[:, 4:7], np.cross(way / size, observation.rotation[frame, :, 2]))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axes = np.sqrt(observation.wavelength * size / 4)[..., None] * np.stack(
        [aside, np.cross(way / size, aside)], axis=1
    )
    mirroring = np.column_stack([line, np.zeros(n)]).astype(float)
    before, after = _spread(mirroring, axes)
    none, span = (np.full((n, 3), -1), np.zeros((n, 3, 3)), np.zeros((n, 3, 2, 3))), np.tile([0.0, 0.5], (n, 1))
    return PathSegments(
        np.zeros(n, int), frame, begin, curved.aim, before, after, *none, span, mirroring
    )  # fmt: skip


def _uneven(
    observation: Observation, frame: int, flat: Flat, aim: Float[np.ndarray, "part 3"], heights: Heights
) -> Complex[np.ndarray, "part"]:
    """Factor of unevenness on parts of plates: that of the foot of the perpendicular, fading with the distance from
    it."""
    begin = observation.position[frame]
    height = np.einsum("pd,pd->p", begin - flat.center, flat.normal)
    foot, away = begin - height[:, None] * flat.normal, np.abs(height)
    reach = heights.reach(away, flat.finish, observation.wavelength)
    share = np.clip(2 * (1 - np.linalg.norm(aim - foot, axis=1) / np.maximum(reach, 1e-9)), 0, 1)
    factor, near = np.ones(len(aim), complex), np.flatnonzero((share > 0) & (flat.finish > 0))
    # Parts of one plate, and plates of one wall, share a foot point.
    _, one, which = np.unique(foot[near].round(6), axis=0, return_index=True, return_inverse=True)
    some = near[one]
    found = heights.factors(
        np.broadcast_to(begin, (len(some), 3)), foot[some], flat.finish[some], observation.wavelength
    )
    factor[near] += share[near] * (found[which.ravel()] - 1)
    return factor
