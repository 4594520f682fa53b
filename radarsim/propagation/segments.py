"""Path segments between the radar and a curved body, direct or over a mirror, and pairs of them that may make an echo.

A ghost has one segment out and another back. Of tens of thousands of pairs hardly any is significant, so each
segment has bounds: the part of the body's axis visible in the mirror's aperture, and the largest amplitude it passes.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from radarsim.propagation.apertures import SLIT, STRIP_FAR
from radarsim.propagation.fields import along, dot, gain_towards, length, minus, mirrored, unit, vec, write
from radarsim.propagation.mirror_images import look

#: m: smallest distance of the end point of visibility rays from the ends of the lit part of an axis.
INSIDE = 0.01
#: Distance in radii from which a body is thin, and length relative to distance below which the gain is nearly constant.
_THIN, _SHORT = 20.0, 0.3
#: Largest distance, in Fresnel units, at which the ends of a cylinder have an effect.
_ZONES = 1.2 * STRIP_FAR
#: Factor for changes of the gain along a short body, and for all neglected effects on an amplitude.
_GAIN, _SAFE = 1.3, 2.0


class Capsule(NamedTuple):
    """Bounding cylinder of a curved body: centre, axis, half length and radius, m."""

    center: tuple[float, float, float]
    axis: tuple[float, float, float]
    half: float
    radius: float


class Segments(NamedTuple):
    """Segments to a body; one row per visible mirror, plus one for the direct segment.

    Attributes:
        mirror: index of the mirror; -1: direct.
        image: image of the radar in the mirror, m.
        span: largest part of the axis, relative to its centre, that the segment reaches, m.
        place: position of the image relative to the body's centre along its axis, and distance from the axis, m.
        aside: unit vector from the axis to the image.
        ends: limits of the part of the axis in front of the mirror: smallest and largest lower end, and upper end, m.
        most: upper bound of gain times aperture factor.
    """

    mirror: Int[np.ndarray, "segment"]
    image: Float[np.ndarray, "segment 3"]
    span: Float[np.ndarray, "segment 2"]
    place: Float[np.ndarray, "segment 2"]
    aside: Float[np.ndarray, "segment 3"]
    ends: Float[np.ndarray, "segment 4"]
    most: Float[np.ndarray, "segment"]


@njit
def empty_segments(count):
    """Allocate segments for `fill`."""
    return Segments(
        np.empty(count, np.int64), np.empty((count, 3)), np.empty((count, 2)), np.empty((count, 2)),
        np.empty((count, 3)), np.empty((count, 4)), np.empty(count),
    )  # fmt: skip


@njit(cache=True)
def fill(observation, frame, flat, images, capsule, segments):
    """Write the segments of a frame that may reach a body, the direct one first, then over visible mirrors; return
    their number, 0 if the body is out of range."""
    center, axis, half, radius = capsule
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    forward = rotation[0, 0], rotation[1, 0], rotation[2, 0]
    if length(minus(center, p)) - radius - half > observation.range:
        return 0
    span = clip((-half, half), -dot(minus(center, p), forward), -dot(axis, forward), radius)
    _write(segments, 0, -1, p, capsule, span)
    segments.most[0] = _gain(observation, frame, p, (p, (0.0, 0.0, 0.0)), span, capsule)
    segments.ends[0] = -half, -half, half, half
    count, worth = 1, np.empty(len(images.mirror), np.bool_)
    look(observation, images, capsule, (p, forward), worth)
    for k in range(len(worth)):
        m = images.mirror[k]
        if not worth[k] or m < 0:
            continue
        image, height, away = vec(images.image[:, k]), images.height[k], vec(images.away[:, k])
        level, rise = dot(minus(center, image), away) - height, dot(axis, away)
        span = _span(observation, flat, m, (image, height, level, rise), capsule, (forward, images.forward[k]))
        if span[0] > span[1]:
            continue
        _write(segments, count, m, image, capsule, span)
        around = radius * np.sqrt(max(1 - rise * rise, 0.0))  # largest distance of a line on the body towards the image
        segments.ends[count] = -half, -half, half, half
        for end in range(2):
            low, high = clip((-half, half), -level, -rise, (1 - 2 * end) * around)
            if rise > 1e-9:
                segments.ends[count, end] = low
            elif rise < -1e-9:
                segments.ends[count, 3 - end] = high
        passed = _passed(observation, flat, m, (height, level, rise), capsule, segments.place[count])
        mirror = vec(flat.center[m]), vec(flat.normal[m])
        segments.most[count] = passed * _gain(observation, frame, p, mirror, span, capsule)
        count += 1
    return count


@njit
def _write(segments, k, mirror, image, capsule, span):
    segments.mirror[k] = mirror
    write(image, segments.image[k])
    segments.span[k, 0], segments.span[k, 1] = span
    offset = minus(image, capsule.center)
    z = dot(offset, capsule.axis)
    offset = along(offset, -z, capsule.axis)
    segments.place[k, 0], segments.place[k, 1] = z, length(offset)
    write(unit(offset), segments.aside[k])


@njit
def _span(observation, flat, m, radar, capsule, ahead):
    """Part of an axis, with everything within a radius, that a mirror illuminates with waves sent forward by the radar.

    A point at z is in front of the mirror by L + R z, so a wave to it meets the mirror at the fraction
    H / (H + L + R z) of the path from the image: this position is linear in z over the same denominator.

    Args:
        radar: its image, distance of the image from the mirror (H), and L and R.
        ahead: forward direction of the radar, and its part along the mirror's normal.
    """
    (image, height, level, rise), (center, axis, half, radius), (forward, off) = radar, capsule, ahead
    span, full = clip((-half, half), -level, -rise, radius), height + level
    foot, way = minus(image, vec(flat.center[m])), minus(center, image)
    farthest, nearest = level + half * abs(rise) + radius, max(level - half * abs(rise) - radius, 0.0)
    longest = length(way) + half + radius
    share = min(farthest / (height + farthest), 0.5)  # largest fraction of the path beyond the mirror
    zone = STRIP_FAR * np.sqrt(0.5 * observation.wavelength * longest * share * (1 - share))
    # It is longer in the plane of incidence, by how directions differ from that to the middle (`aperture_diffraction`).
    far, cosine = length(way), (height + nearest) / longest
    turned, spread = abs(dot(way, vec(flat.u[m]))) / far, (half + radius) / max(far - half - radius, 1e-9)
    zones = (
        zone / max(np.sqrt(max(1 - (turned + spread) ** 2, 0.0)), cosine),
        zone * np.sqrt(1 - max(turned - spread, 0.0) ** 2) / cosine,
    )
    for k in range(2):
        side, window = vec(flat.u[m]) if k == 0 else vec(flat.v[m]), flat.half[m, k] + zones[k]
        x, aside, turn = dot(foot, side), dot(way, side), dot(axis, side)
        slack = radius * (height + abs(x) + window)
        for sign in (-1.0, 1.0):
            over = sign * x - window
            span = clip(span, over * full + sign * height * aside, over * rise + sign * height * turn, slack)
    out = -2 * height * off
    begin, slope = out * full + height * dot(way, forward), out * rise + height * dot(axis, forward)
    return clip(span, -begin, -slope, 3 * height * radius)


@njit
def clip(span, begin, slope, slack):
    """Part of a span where begin + slope z <= slack."""
    low, high = span
    if abs(slope) < 1e-9:
        return span if begin <= slack else (1.0, 0.0)
    edge = (slack - begin) / slope
    return (low, min(high, edge)) if slope > 0 else (max(low, edge), high)


@njit
def _passed(observation, flat, m, radar, capsule, place):
    """Upper bound of a mirror's aperture factor: a slit that is narrow in Fresnel units passes its width / sqrt(2)."""
    height, level, rise = radar
    farthest = level + capsule.half * abs(rise) + capsule.radius
    nearest = level - capsule.half * abs(rise) - capsule.radius
    if nearest <= 0:
        return SLIT * SLIT
    way = max(np.hypot(place[1], max(abs(place[0]) - capsule.half, 0.0)) - capsule.radius, 0.0)
    square = 0.5 * observation.wavelength * way * height / (height + farthest) * nearest / (height + nearest)
    width = 2 / np.sqrt(2 * square + 1e-12)
    return min(width * flat.half[m, 0], SLIT) * min(width * flat.half[m, 1], SLIT)


@njit
def _gain(observation, frame, p, mirror, span, capsule):
    """Upper bound of the gain towards a part of an axis seen in a mirror (place, normal)."""
    center, axis, _, _ = capsule
    low, high = span
    middle = mirrored(along(center, (low + high) / 2, axis), mirror[0], mirror[1])
    far = length(minus(middle, p))
    if high - low > _SHORT * far or _THIN * capsule.radius > far:
        return observation.peak_gain
    most = 0.0
    for z in (low, (low + high) / 2, high):
        place = mirrored(along(center, z, axis), mirror[0], mirror[1])
        most = max(most, gain_towards(minus(place, p), observation.rotation[frame], observation))
    return min(_GAIN * most, observation.peak_gain)


@njit
def matched(observation, capsule, segments, i, j):
    """Whether a body may echo over two segments: a part of it is lit on both, its specular point is near there, and the
    echo is not below the threshold whatever the effect of its ends.

    The path's second derivative is C over a plane and C + B over a body of that radius: the spreading factor is at most
    1 / (1 + B / C).
    """
    half, radius = capsule.half, capsule.radius
    low, high = max(segments.span[i, 0], segments.span[j, 0]), min(segments.span[i, 1], segments.span[j, 1])
    if low > high:
        return False
    d1, d2, z, spread = segments.place[i, 1], segments.place[j, 1], 0.0, 0.0
    one, two = segments.ends[i], segments.ends[j]
    ends = max(one[0], two[0]), max(one[1], two[1]), min(one[2], two[2]), min(one[3], two[3])
    if half > 0:
        slope = (segments.place[j, 0] - segments.place[i, 0]) / (d1 + d2)
        z, spread = segments.place[i, 0] + slope * d1, abs(slope) * radius
        if aim(z + spread, ends[1], ends[3]) < low or aim(z - spread, ends[0], ends[2]) > high:
            return False
    if min(d1, d2) < _THIN * radius:
        return True
    r1, r2 = np.hypot(d1, segments.place[i, 0] - z), np.hypot(d2, segments.place[j, 0] - z)
    slant, path = min(d1 / r1, d2 / r2), r1 + r2
    zone = np.sqrt(observation.wavelength * r1 * r2 / (2 * path)) / slant
    if path - 2 * radius > 2 * observation.range or max(ends[0] - z, z - ends[3]) > _ZONES * zone + spread:
        return False
    between = dot(vec(segments.aside[i]), vec(segments.aside[j]))
    cosine = np.sqrt(max(1 + between, 0.0) / 2) * slant
    growth = max(cosine - 1 / _THIN, 0.0) * 2 / radius * r1 * r2 / path
    most = segments.most[i] * segments.most[j] * observation.wavelength / (4 * np.pi * path)
    return _SAFE * most > observation.threshold * np.sqrt(1 + growth)


@njit
def aim(z, low, high):
    """End point of visibility rays on the lit part of an axis with the specular point at z; increases with all
    three."""
    middle = (low + high) / 2
    return min(max(z, min(low + INSIDE, middle)), max(high - INSIDE, middle))
