"""Independent float64 references.

`beat`: beat signal of points in the world, sample by sample from the motion. `transfer_matrix`: layers.
`kirchhoff_mirror`: reflection by a mirror of any size. `past_pole`, `past_edge`: diffraction by poles and half planes.
"""

import numpy as np
from scipy.special import erfc

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.propagation.burst import BurstClock


def beat(config: RadarConfig, motion, time: float, points, amplitude) -> np.ndarray:
    """Sum over echoes with path length |tx - a| + |b - rx|, with the antenna positions at every sample.

    The transmitted phase at time t is theta(t) = 2 pi (f_c t + S t^2 / 2); that of a dechirped echo of delay tau is
    theta(t) - theta(t - tau).
    """
    loops, n_tx, n_rx, samples, _ = config.frame_shape
    on_ramp = (np.arange(samples) - (samples - 1) / 2) / config.sample_rate
    out = np.zeros((loops, n_tx, n_rx, samples), complex)

    def sent(t):
        return config.center_frequency * t + config.slope / 2 * t**2

    for loop in range(loops):
        for k in range(n_tx):
            at = time + config.chirp_times[loop, k] + on_ramp
            position, rotation = motion.position(at), motion.rotation(at).as_matrix()
            tx = position + np.einsum("nij,j->ni", rotation, tx_positions(config)[k])
            there = np.linalg.norm(points[:, None, 0] - tx, axis=2)
            for r in range(n_rx):
                rx = position + np.einsum("nij,j->ni", rotation, rx_positions(config)[r])
                back = np.linalg.norm(points[:, None, 1] - rx, axis=2)
                phase = sent(on_ramp) - sent(on_ramp - (there + back) / SPEED_OF_LIGHT)
                out[loop, k, r] = (amplitude[:, None] * np.exp(2j * np.pi * phase)).sum(axis=0)
    return out


def transfer_matrix(layers, cosine, frequency, tm):
    """Compute transmission and reflection of layers (permittivity, thickness) in air by 2 x 2 matrices, e^{+jwt}.

    Born and Wolf, 1.6; ratios of the fields along the layers.
    """
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT
    sine = 1 - cosine**2
    total = np.eye(2, dtype=complex)
    for permittivity, thickness in layers:
        root = np.sqrt(permittivity - sine)
        admittance = permittivity / root if tm else root
        delta = k * thickness * root
        total = total @ [
            [np.cos(delta), 1j * np.sin(delta) / admittance],
            [1j * admittance * np.sin(delta), np.cos(delta)],
        ]
    air = 1 / cosine if tm else cosine
    electric, magnetic = total[0] @ [1, air] * air, total[1] @ [1, air]
    return 2 * air / (electric + magnetic), (electric - magnetic) / (electric + magnetic)


def direct_sum(config: RadarConfig, lengths: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Compute the beat signal (loop, tx, rx, sample) of path-length parabolas directly: float64, one matrix of phases
    per trace."""
    loops, tx, rx, samples, _ = config.frame_shape
    clock = BurstClock.of(config)
    n = (np.arange(samples) - (samples - 1) / 2) / config.sample_rate
    out = np.empty((loops, tx, rx, samples), complex)
    for loop in range(loops):
        for k in range(tx):
            s = (config.chirp_times[loop, k] - clock.middle) / clock.half
            for r in range(rx):
                c0, c1, c2 = lengths[:, k * rx + r].T
                length, rate = c0 + s * (c1 + s * c2), (c1 + 2 * s * c2) / clock.half
                delay, closing = length / SPEED_OF_LIGHT, rate / SPEED_OF_LIGHT
                beat = config.slope * delay + config.center_frequency * closing
                cycles = (config.center_frequency * delay - config.slope / 2 * delay**2)[:, None] + beat[:, None] * n
                out[loop, k, r] = amplitudes @ np.exp(2j * np.pi * cycles)
    return out


def kirchhoff_mirror(half, place, wavelength, across=1601):
    """Sum the amplitude (1/m) of the path from the origin over a mirror at (1.5, 1, 0), facing -y, to a point.

    (1 / (j lambda)) int cos exp(jk (r1 + r2)) / (r1 r2) dA, Kirchhoff's approximation with the mean of both cosines,
    relative to the image's phase.
    """
    x, z = (((np.arange(across) + 0.5) / across * 2 - 1) * h for h in half)
    x = x[:, None] + 1.5
    there = np.sqrt(x**2 + 1 + z**2)
    back = np.sqrt((x - place[0]) ** 2 + (1 - place[1]) ** 2 + (z - place[2]) ** 2)
    cosine = (1 / there + (1 - place[1]) / back) / 2
    image = np.linalg.norm(place * [1, -1, 1] + [0, 2, 0])
    field = np.sum(cosine * np.exp(2j * np.pi * (there + back - image) / wavelength) / (there * back))
    return field * np.prod(2 * np.array(half) / across) / (1j * wavelength)


def past_pole(offset, width, places, path, wavelength, nodes=200):
    """Return the relative amplitude of a wave past an opaque strip that crosses a path twice, by Kirchhoff's integral.

    Babinet's principle: the free wave, minus the fields through either strip, plus the field through both; float64.

    Args:
        offset, width: offset from the axis and width of the strip, m.
        places: distances of the crossings from one end of the path, m.
        path: length of the path, m.
    """
    x = offset + ((np.arange(nodes) + 0.5) / nodes - 0.5) * width
    gaps, wavenumber, step = np.diff([0.0, *places, path]), 2 * np.pi / wavelength, width / nodes
    value = 1.0 + 0j
    for d in places:
        unit = 1 / d + 1 / (path - d)
        value -= np.sum(np.exp(0.5j * wavenumber * x * x * unit)) * step * np.sqrt(unit / (1j * wavelength))
    there, between, back = gaps
    turn = x[:, None] ** 2 / there + (x[:, None] - x) ** 2 / between + x**2 / back
    both = np.sum(np.exp(0.5j * wavenumber * turn)) * step**2
    return value + both * np.sqrt(path / gaps.prod()) / (1j * wavelength)


def past_edge(offset, places, path, wavelength, nodes=400):
    """Return the relative amplitude of a wave past an opaque half plane that a path meets twice, by Kirchhoff's
    integral.

    The double Fresnel integral over u_1, u_2 < a is a complex normal distribution with correlation: the inner integral
    is in closed form, the outer one along a contour rotated by 45 deg at the edge, on which the integrand decays;
    float64.

    Args:
        offset: distance of the edge from the path, m; negative in its shadow.
        places: distances of the crossings from one end of the path, m.
        path: length of the path, m.
    """
    one, two = places
    a, b = (offset / np.sqrt(wavelength * d * (path - d) / (2 * path)) for d in places)
    rho = np.sqrt(one * (path - two) / (two * (path - one)))
    y, weight = np.polynomial.legendre.leggauss(nodes)
    last, turn = 6 + 3 * abs(a), np.exp(0.25j * np.pi)
    x = a - last * (y + 1) / 2 * turn
    inner = erfc(-(b - rho * x) / np.sqrt(1 - rho**2) * np.sqrt(np.pi / 2) / turn) / 2
    return np.sum(weight * np.exp(0.5j * np.pi * x * x) * inner) * last / 2 * turn / (1 + 1j)


def bounced(scene, position, up, axis, spread, bounces, wavelength, across=700):
    """Return the echo amplitude of a fan of rays after a number of reflections, with an isotropic antenna.

    Shooting and bouncing rays (Ling, Chou and Lee, IEEE TAP 37(2), 1989): geometric optics to the last surface, then
    physical optics back to the radar, if it is visible. The fan is tapered, see `fan`.

    Args:
        scene: scene, all of whose surfaces are perfect conductors.
        position, up: position (m) and polarisation (unit vector) of the antenna.
        axis, spread: axis of the fan (unit vector), and tangent of its half width.
        bounces: number of reflections.
        wavelength: m.
        across: number of rays along one side of the fan.
    """
    aside = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.7 else [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    tangent = ((np.arange(across) + 0.5) / across * 2 - 1) * spread
    x, y = (grid.ravel() for grid in np.meshgrid(tangent, tangent))
    weight = fan(np.hypot(x, y), spread) * (2 * spread / across) ** 2 / (1 + x * x + y * y) ** 1.5
    x, y, weight = x[weight > 0], y[weight > 0], weight[weight > 0]
    way = axis + x[:, None] * aside + y[:, None] * np.cross(axis, aside)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    place, field, there = np.broadcast_to(position, way.shape), _across(up, way), np.zeros(len(way))
    for _ in range(bounces):
        triangle = scene.hit(place + 1e-4 * way, way)[1]
        way, place, field, there, weight = (a[triangle >= 0] for a in (way, place, field, there, weight))
        triangle = triangle[triangle >= 0]
        normal = scene.normals[triangle]
        slope = _dot(way, normal)
        step = _dot(scene.triangles[triangle, 0] - place, normal) / slope
        place, there = place + step[:, None] * way, there + step
        field, way = 2 * _dot(field, normal)[:, None] * normal - field, way - 2 * slope[:, None] * normal
    normal = -np.sign(slope)[:, None] * normal
    arriving, leaving, back = np.abs(slope), _dot(position - place, normal), np.linalg.norm(position - place, axis=1)
    seen = (leaving > 0) & ~scene.occluded(place + 1e-4 * normal, np.broadcast_to(position, place.shape), margin=1e-4)
    taken = _dot(field, _across(up, (position - place) / back[:, None]))
    size = weight * there / back * (arriving + leaving / back) / (2 * arriving) * taken
    return np.sum((size * np.exp(2j * np.pi * (there + back) / wavelength))[seen]) / (4 * np.pi)


def fan(tangent, spread):
    """Return the taper of a fan of rays: 1 in the inner half, decreasing to 0 at the edge."""
    return np.cos(np.pi / 2 * np.clip(2 * tangent / spread - 1, 0, 1)) ** 2


def _dot(a, b):
    return np.einsum("...d,...d->...", a, b)


def _across(up, way):
    field = up - _dot(way, up)[:, None] * way
    return field / np.linalg.norm(field, axis=1, keepdims=True)
