"""How strong the echo of a scatterer is, straight and over a mirror: the radar equation, each leg by itself."""

import numpy as np
from numba import njit, prange

from radarsim.physics.antenna import amplitude_gain
from radarsim.physics.detail import FULL_DETAIL, detail, share
from radarsim.physics.facets import TABLE
from radarsim.physics.lobes import scattering


@njit(parallel=True, cache=True)
def direct_amplitudes(
    place, normal, sigma, two_sided, lobe, rank, position, rotation, reach, wavelength, azimuth_table, elevation_table,
    out,
):  # fmt: skip
    """Radar equation, |a|^2 = G^2 lambda^2 sigma / ((4 pi)^3 R^4), sigma by `scattering` and level of `detail`."""
    scale = wavelength / (4 * np.pi) ** 1.5
    for i in prange(len(place)):
        dx, dy, dz = place[i, 0] - position[0], place[i, 1] - position[1], place[i, 2] - position[2]
        square = dx * dx + dy * dy + dz * dz
        if square > reach * reach or square < 1e-4:
            continue
        x = rotation[0, 0] * dx + rotation[1, 0] * dy + rotation[2, 0] * dz
        if x <= 0:
            continue
        distance = np.sqrt(square)
        cosine = _facing(normal[i], -dx, -dy, -dz, distance, two_sided[i])
        if cosine <= 0:
            continue
        if rank[i] * distance >= 2 * FULL_DETAIL:
            continue
        y = rotation[0, 1] * dx + rotation[1, 1] * dy + rotation[2, 1] * dz
        z = rotation[0, 2] * dx + rotation[1, 2] * dy + rotation[2, 2] * dz
        gain = amplitude_gain(x, y, z, azimuth_table, elevation_table)
        leg = gain / distance
        weight = detail(rank[i], share(gain, distance))
        out[i] = scale * leg * leg * weight * np.sqrt(sigma[i] * scattering(cosine, cosine, 1.0, lobe[i]))


@njit(inline="always")
def _facing(normal, dx, dy, dz, length, two_sided):
    """Cosine between a normal and the direction away from the surface; 1 for an isotropic scatterer."""
    if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
        return 1.0
    cosine = (normal[0] * dx + normal[1] * dy + normal[2] * dz) / length
    return abs(cosine) if two_sided else cosine


@njit(parallel=True, cache=True)
def ghost_amplitudes(
    place, normal, sigma, two_sided, lobe, rank, center, plane, u, v, half, sheet, reflection, position, rotation,
    reach, wavelength, weakest, azimuth_table, elevation_table, out,
):  # fmt: skip
    """Sensor -> scatterer -> mirror -> sensor, for every mirror and scatterer; the way back has the same value."""
    scale = wavelength / (4 * np.pi) ** 1.5
    up = rotation[:, 2].copy()  # polarisation: the board's patches radiate an upright electric field
    for m in prange(len(center)):
        n = plane[m]
        h = np.dot(position - center[m], n)
        if h < 0 and not sheet[m]:
            continue
        if h < 0:
            n, h = -n, -h
        image = position - 2 * h * n
        for i in range(len(place)):
            s = place[i]
            hs = np.dot(s - center[m], n)
            if hs < 0.01:
                continue
            d1 = np.sqrt((s[0] - position[0]) ** 2 + (s[1] - position[1]) ** 2 + (s[2] - position[2]) ** 2)
            d2 = np.sqrt((s[0] - image[0]) ** 2 + (s[1] - image[1]) ** 2 + (s[2] - image[2]) ** 2)
            if d1 + d2 > 2 * reach:
                continue
            bounce = image + (s - image) * (h / (h + hs))
            first = d2 * h / (h + hs)
            last = d2 - first
            # The mirror's edge acts over about half a Fresnel zone, not at a point.
            zone = 0.5 * np.sqrt(wavelength * first * last / d2)
            offset = bounce - center[m]
            edge = _ramp(half[m, 0] - abs(np.dot(offset, u[m])), zone) * _ramp(
                half[m, 1] - abs(np.dot(offset, v[m])), zone
            )
            if edge == 0:
                continue
            arriving, leaving = (bounce - position) / first, (s - bounce) / last
            face_direct = _facing(
                normal[i], position[0] - s[0], position[1] - s[1], position[2] - s[2], d1, two_sided[i]
            )
            face_mirror = _facing(normal[i], -leaving[0], -leaving[1], -leaving[2], 1.0, two_sided[i])
            if face_direct <= 0 or face_mirror <= 0:
                continue
            gain = 1.0
            for target in (s, bounce):
                d = target - position
                gain *= amplitude_gain(
                    rotation[0, 0] * d[0] + rotation[1, 0] * d[1] + rotation[2, 0] * d[2],
                    rotation[0, 1] * d[0] + rotation[1, 1] * d[1] + rotation[2, 1] * d[2],
                    rotation[0, 2] * d[0] + rotation[1, 2] * d[1] + rotation[2, 2] * d[2],
                    azimuth_table, elevation_table,
                )  # fmt: skip
            between = np.dot(s - position, leaving) / d1
            pattern = scattering(face_direct, face_mirror, between, lobe[i])
            weight = detail(rank[i], share(np.sqrt(gain), np.sqrt(d1 * d2)))
            size = scale * gain * edge * weight * np.sqrt(sigma[i] * pattern) / (d1 * d2)
            if size <= weakest:
                continue
            value = size * _copolar(reflection[m], arriving, leaving, n, up)
            if abs(value) > weakest:
                out[m, i] = value


@njit(inline="always")
def _ramp(inside, zone):
    """0 ... 1 as a point moves from `zone` outside an edge to `zone` inside; two abutting mirrors add up to one."""
    x = inside / zone
    if x <= -1:
        return 0.0
    if x >= 1:
        return 1.0
    return 0.5 + 0.25 * x * (3 - x * x)


@njit(cache=True)
def _copolar(reflection, arriving, leaving, normal, up):
    """Reflection coefficient from upright to upright polarisation: parts across and in the plane of incidence."""
    cosine = min(abs(np.dot(arriving, normal)), 1.0)
    at = cosine * (TABLE - 1)
    j = min(int(at), TABLE - 2)
    te = reflection[0, j] + (at - j) * (reflection[0, j + 1] - reflection[0, j])
    tm = reflection[1, j] + (at - j) * (reflection[1, j + 1] - reflection[1, j])
    across = np.cross(arriving, normal)
    size = np.sqrt(np.dot(across, across))
    if size < 1e-6:
        return te
    across /= size
    sent = up - np.dot(up, arriving) * arriving
    sent /= np.sqrt(np.dot(sent, sent)) + 1e-12
    taken = up - np.dot(up, leaving) * leaving
    taken /= np.sqrt(np.dot(taken, taken)) + 1e-12
    inside = np.dot(sent, np.cross(across, arriving)) * np.dot(taken, np.cross(across, leaving))
    return te * np.dot(sent, across) * np.dot(taken, across) + tm * inside
