"""Images of the radar in the mirrors visible in one frame, and the mirrors over which a body may be illuminated."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from radarsim.propagation.apertures import STRIP_FAR
from radarsim.propagation.fields import along, dot, length, minus, vec, write


class Images(NamedTuple):
    """Images of the radar of one frame in visible mirrors.

    Attributes:
        mirror: index of each mirror.
        image: position of the radar's image, m.
        height: distance of the radar from the mirror's plane, m.
        away: normal on the radar's side.
        u, v, half: of the reflector (`reflectors.Flat`).
        foot: position of the image relative to the reflector's centre, along u and v, m.
        forward: component of `away` along the radar's forward direction.
    """

    mirror: Int[np.ndarray, "image"]
    image: Float[np.ndarray, "3 image"]
    height: Float[np.ndarray, "image"]
    away: Float[np.ndarray, "3 image"]
    u: Float[np.ndarray, "3 image"]
    v: Float[np.ndarray, "3 image"]
    half: Float[np.ndarray, "2 image"]
    foot: Float[np.ndarray, "2 image"]
    forward: Float[np.ndarray, "image"]


@njit(cache=True)
def images(observation, frame, flat, seen):
    """Images of the radar of a frame in visible mirrors (`seen`) that it does not touch."""
    p, rotation, count = vec(observation.position[frame]), observation.rotation[frame], 0
    n = len(seen)
    found = Images(
        np.empty(n, np.int64), np.empty((3, n)), np.empty(n), np.empty((3, n)), np.empty((3, n)), np.empty((3, n)),
        np.empty((2, n)), np.empty((2, n)), np.empty(n),
    )  # fmt: skip
    for m in seen:
        away, u, v = vec(flat.normal[m]), vec(flat.u[m]), vec(flat.v[m])
        height = dot(minus(p, vec(flat.center[m])), away)
        if abs(height) < 0.01:
            continue
        if height < 0:
            away, height = (-away[0], -away[1], -away[2]), -height
        image = along(p, -2 * height, away)
        foot = minus(image, vec(flat.center[m]))
        found.mirror[count], found.height[count] = m, height
        write(image, found.image[:, count])
        write(away, found.away[:, count])
        write(u, found.u[:, count])
        write(v, found.v[:, count])
        found.half[0, count], found.half[1, count] = flat.half[m]
        found.foot[0, count], found.foot[1, count] = dot(foot, u), dot(foot, v)
        found.forward[count] = dot(away, (rotation[0, 0], rotation[1, 0], rotation[2, 0]))
        count += 1
    found.mirror[count:] = -1
    return found


@njit(cache=True, error_model="numpy")
def look(observation, images, capsule, radar, worth):
    """Mark the mirrors over which a body (`segments.Capsule`) may be illuminated: a fast test of all of them.

    It applies the bounds of `segments` to the lit part of the body's axis one by one, with Fresnel zones as long as in
    the plane of incidence.

    Args:
        radar: its position, m, and forward direction.
    """
    center, axis, half, radius = capsule
    here, forward = radar
    reach = 2 * observation.range - length(minus(center, here)) + 2 * (half + radius)
    ahead, zone = dot(axis, forward), STRIP_FAR * STRIP_FAR * 0.5 * observation.wavelength
    x, y, z = images.image
    nx, ny, nz = images.away
    ux, uy, uz = images.u
    vx, vy, vz = images.v
    half_u, half_v = images.half
    foot_u, foot_v = images.foot
    for k in range(len(worth)):
        dx, dy, dz, height = center[0] - x[k], center[1] - y[k], center[2] - z[k], images.height[k]
        full, far = dx * nx[k] + dy * ny[k] + dz * nz[k], np.sqrt(dx * dx + dy * dy + dz * dz)
        rise = axis[0] * nx[k] + axis[1] * ny[k] + axis[2] * nz[k]
        ends = half * abs(rise) + radius
        farthest, nearest, longest = full + ends, max(full - ends, height), far + half + radius
        share = min(1 - height / farthest, 0.5)
        wide = longest * np.sqrt(zone * longest * share * (1 - share)) / nearest
        window_u, window_v = half_u[k] + wide, half_v[k] + wide
        aside_u, aside_v = dx * ux[k] + dy * uy[k] + dz * uz[k], dx * vx[k] + dy * vy[k] + dz * vz[k]
        turn_u = height * (axis[0] * ux[k] + axis[1] * uy[k] + axis[2] * uz[k])
        turn_v = height * (axis[0] * vx[k] + axis[1] * vy[k] + axis[2] * vz[k])
        off_u, off_v = foot_u[k] * full + height * aside_u, foot_v[k] * full + height * aside_v
        slack_u = radius * (height + abs(foot_u[k]) + window_u) + window_u * full
        slack_v = radius * (height + abs(foot_v[k]) + window_v) + window_v * full
        low_u, high_u = (foot_u[k] - window_u) * rise + turn_u, (foot_u[k] + window_u) * rise + turn_u
        low_v, high_v = (foot_v[k] - window_v) * rise + turn_v, (foot_v[k] + window_v) * rise + turn_v
        out = -2 * height * images.forward[k]
        begin = out * full + height * (dx * forward[0] + dy * forward[1] + dz * forward[2])
        worth[k] = (
            (farthest > height)
            & (far < reach)
            & (off_u - half * abs(low_u) < slack_u)
            & (-off_u - half * abs(high_u) < slack_u)
            & (off_v - half * abs(low_v) < slack_v)
            & (-off_v - half * abs(high_v) < slack_v)
            & (begin + half * abs(out * rise + height * ahead) + 3 * height * radius > 0)
        )
