"""Dihedral and trihedral corner reflectors, and their radar cross sections."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import fresnel

from benchmarks.references.rigs import conductors, isotropic
from radarize.radar.presets import PRESETS
from radarsim.propagation import visible_mirrors
from radarsim.propagation.isometry import inverse
from radarsim.propagation.mechanisms import image_chains

LAMBDA = PRESETS["radarize"].wavelength


def corner(count, a, b, triangles=False):
    """Return two or three plates at right angles that meet in the origin, open towards (1, 1, 1); b: length of the
    edge."""
    x, y, z = np.eye(3)
    lift = b / 2 if count == 3 else 0.0
    plates = [(a / 2 * y + lift * z, y, z, (a / 2, b / 2)), (a / 2 * x + lift * z, z, x, (b / 2, a / 2)),
              (a / 2 * (x + y), x, y, (a / 2, a / 2))]  # fmt: skip
    mirrors = conductors(*plates[:count])
    if triangles:
        sides = [(y, z), (z, x), (x, y)]
        shape = np.array([[0 * p, a * p, a * q, 0 * p] for p, q in sides])
        mirrors = replace(mirrors, corners=shape)
    return mirrors


def out_of_square(angle, size=6.0):
    """Return two walls of a width, 4 m high, that meet in the z axis at 90 deg plus an angle (rad), open towards x."""
    half, z = np.pi / 4 + angle / 2, np.array([0.0, 0.0, 1.0])
    one, two = (np.array([np.cos(half), side * np.sin(half), 0.0]) for side in (1, -1))
    return conductors((size / 2 * one, one, z, (size / 2, 2.0)), (size / 2 * two, z, two, (2.0, size / 2)))


def image_out_of_square(angle, distance):
    """Return path length (m) and amplitude of the image of a radar on x by two walls in either order: it is rotated by
    twice the angle, its path passes the edge at distance sin(angle), and the half plane leaves 1/2 plus Fresnel's
    integral up to the edge (Born and Wolf, 8.7.3)."""
    path = 2 * distance * np.cos(angle)
    s, c = fresnel(-distance * np.sin(angle) / np.sqrt(LAMBDA * path / 8))
    return path, LAMBDA / (4 * np.pi * path) * (0.5 + (c + 1j * s) / (1 + 1j))


def looking(direction, roll=0.0):
    """Return the rotation matrix of a sensor with a boresight direction."""
    yaw, pitch = np.arctan2(direction[1], direction[0]), -np.arcsin(direction[2])
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def cross_section(mirrors, direction, distance=6.0, roll=0.0):
    """Return the RCS of all chains of mirrors from a unit direction, |a|^2 (4 pi)^3 R^4 / lambda^2, m^2."""
    position = distance * np.asarray(direction)
    chain, isometry, amplitude = both_ways(mirrors, isotropic(position, LAMBDA, looking(-position / distance, roll)))
    path = np.linalg.norm(position - isometry[:, :, :3] @ position - isometry[:, :, 3], axis=1)
    field = np.sum(amplitude * np.exp(2j * np.pi * path / LAMBDA))
    return abs(field) ** 2 * (4 * np.pi) ** 3 * distance**4 / LAMBDA**2


def chains(mirrors, observation):
    """Return the chains over flat reflectors in free space."""
    return image_chains.chains(
        mirrors, visible_mirrors.couples(observation, 0, mirrors, np.arange(len(mirrors))), observation, 0
    )


def both_ways(mirrors, observation):
    """Return mirrors, isometry and amplitude of all chains, in both directions."""
    found = chains(mirrors, observation)
    both = found.mirrors[:, 0] != found.mirrors[:, 2]
    return (
        np.concatenate([found.mirrors, found.mirrors[both]]),
        np.concatenate([found.isometry, inverse(found.isometry[both])]),
        np.concatenate([found.amplitude, found.amplitude[both]]),
    )


def direction(azimuth, elevation):
    return np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


def seen_by_both(a, b, azimuth):
    """Return the effective area of a dihedral at an azimuth, m^2."""
    return 2 * a * b * min(np.sin(azimuth), np.cos(azimuth))


def seen_by_all(a, towards):
    """Return the effective area of a trihedral of triangles from a unit direction (Robertson, BSTJ 26, 1947), m^2."""
    low, middle, high = np.sort(towards)
    total = low + middle + high
    return a**2 * (total - 2 / total if low + middle >= high else 4 * low * middle / total)
