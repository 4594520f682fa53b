"""Motions and measurements for the physics tests."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from radarize.radar.array import virtual_positions
from radarize.radar.config import RadarConfig
from radarsim.propagation.antenna import Antenna, gain_pattern
from radarsim.propagation.media import LAYER
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat
from radarsim.receiver.synthesis import Synthesizer

ISOTROPIC = (np.ones(181), np.ones(181), 1.0)
#: Antenna pattern of the presets' board.
ELEMENT = gain_pattern(Antenna.of("iwr1843boost"))


@dataclass
class Rig:
    """A body with constant velocity and yaw rate, and a sensor on a lever arm (body frame)."""

    velocity: tuple = (0.0, 0.0, 0.0)
    yaw_rate: float = 0.0
    yaw: float = 0.0
    lever: tuple = (0.0, 0.0, 0.0)

    def rotation(self, t):
        return Rotation.from_rotvec(np.outer(self.yaw + self.yaw_rate * np.asarray(t), [0, 0, 1]))

    def position(self, t):
        return np.outer(t, self.velocity) + self.rotation(t).apply(self.lever)


def layer(gamma=-1.0):
    """Return a half space with a reflection coefficient at normal incidence (TE); a conductor for -1."""
    eps = complex(1, -np.inf) if gamma == -1 else ((1 - gamma) / (1 + gamma)) ** 2
    return np.array([eps, 0, 0, gamma, 1], complex)


def conductors(*plates, gamma=-1.0):
    """Return conducting rectangles of (centre, side directions u and v, half sides); the normal is u x v."""
    center, u, v, half = (np.array(column, float) for column in zip(*plates, strict=True))
    none, n = np.zeros(len(plates), bool), len(plates)
    u_, v_ = half[:, :1] * u, half[:, 1:] * v
    corners = center[:, None] + np.stack([-u_ - v_, u_ - v_, u_ + v_, v_ - u_], axis=1)
    layers = np.broadcast_to(layer(gamma), (n, LAYER))
    still = np.full(n, -1)
    even = np.zeros(n), np.zeros(n)
    return Flat(corners, center, np.cross(u, v), u, v, half, none, none, layers.copy(), *even, still, still)


def polar(range_, azimuth_deg=0.0, elevation_deg=0.0):
    """Return the point at a range and direction from the origin."""
    a, e = np.deg2rad([azimuth_deg, elevation_deg])
    return range_ * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


def isotropic(position, wavelength, rotation=None, range_=100.0):
    """Return an observation with an isotropic antenna at a position, frame 0."""
    rotation = np.eye(3) if rotation is None else rotation
    place = np.asarray(position, float)[None]
    return Observation(place, rotation[None], np.zeros(1), range_, wavelength, 0.0, *ISOTROPIC)


def field(echoes, position, wavelength):
    """Return the sum of all echoes at one antenna at a position, at one frequency."""
    lengths = np.linalg.norm(echoes.apparent(position) - position, axis=2).sum(axis=1)
    return complex(np.sum(echoes.amplitude * np.exp(2j * np.pi * lengths / wavelength)))


def burst(config, echoes, motion, time=0.0):
    """Return the beat signal of echoes by the fast synthesis."""
    return Synthesizer(config)(echoes.lengths(config, motion, time), echoes.amplitude)


def locate(config: RadarConfig, signal, guess):
    """Estimate range, azimuth, elevation (rad), closing speed and amplitude of the strongest echo by a matched filter.

    Fails without a signal.

    The signal model (far field, constant velocity) is derived from the definitions, not from the synthesis: phase
    -2 pi / lambda (antenna . u) over antennas, closing echoes at exp(-j 4 pi v t / lambda), beat frequency from range
    and the Doppler shift within the ramp.
    """
    power = np.mean(np.abs(signal) ** 2)
    assert power > 0
    t = config.chirp_times - config.burst_center
    n = (np.arange(config.samples) - (config.samples - 1) / 2) / config.sample_rate
    k = 2 * np.pi / config.wavelength
    antennas = virtual_positions(config)

    def response(x):
        range_, azimuth, elevation, speed = x
        u = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        path = 2 * range_ - antennas @ u
        beat = (config.slope * path - 2 * config.center_frequency * speed) / 299792458.0
        slow = -2 * k * speed * t[:, :, None, None] + k * (path - 2 * range_)[None, :, :, None]
        phase = slow + 2 * np.pi * beat[None, :, :, None] * n
        return np.mean(signal * np.exp(-1j * phase))

    scale = np.array([0.01, 0.02, 0.02, 0.02])
    found = minimize(
        lambda x: -(abs(response(np.asarray(guess) + x * scale)) ** 2) / power,
        np.zeros(4),
        method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-14, "maxiter": 4000, "maxfev": 4000},
    )
    best = np.asarray(guess) + found.x * scale
    return *best, response(best)
