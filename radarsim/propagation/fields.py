"""Fields along a ray: the antenna's gain, mirrors with edges and polarisation, scattering surfaces.

Vectors are tuples of three numbers, which compiled code keeps in registers.
"""

import numpy as np
from numba import njit

from radarsim.propagation.antenna import amplitude_gain
from radarsim.propagation.media import mirror


@njit
def vec(array):
    """The three numbers of an array."""
    return array[0], array[1], array[2]


@njit
def dot(a, b):
    """Scalar product, without conjugation."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit
def minus(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@njit
def along(a, t, b):
    """a + t b."""
    return a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]


@njit
def cross(a, b):
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def length(a):
    """Euclidean norm."""
    return np.sqrt(dot(a, a))


@njit
def unit(a):
    """The direction of a vector."""
    size = length(a) + 1e-12
    return a[0] / size, a[1] / size, a[2] / size


@njit
def mirrored(p, center, normal):
    """A point mirrored in a plane."""
    return along(p, -2 * dot(minus(p, center), normal), normal)


@njit
def write(a, out):
    """Write a vector to the first three elements of an array."""
    out[0], out[1], out[2] = a


@njit
def gain_towards(direction, rotation, pattern):
    """Amplitude gain of the antenna towards a direction in the world."""
    return amplitude_gain(
        rotation[0, 0] * direction[0] + rotation[1, 0] * direction[1] + rotation[2, 0] * direction[2],
        rotation[0, 1] * direction[0] + rotation[1, 1] * direction[1] + rotation[2, 1] * direction[2],
        rotation[0, 2] * direction[0] + rotation[1, 2] * direction[1] + rotation[2, 2] * direction[2],
        pattern,
    )


@njit
def facing(normal, towards, two_sided):
    """Cosine between a normal and the unit vector away from the surface; 1 for an isotropic scatterer."""
    if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
        return 1.0
    cosine = normal[0] * towards[0] + normal[1] * towards[1] + normal[2] * towards[2]
    return abs(cosine) if two_sided else cosine


@njit
def upright(up, direction):
    """Electric field that the board's patches transmit or receive along a unit direction: vertical and transverse to
    it."""
    return unit(along(up, -dot(up, direction), direction))


@njit
def upwards(rotation):
    """Direction of the board's upper edge in the world for a rotated sensor.

    A negligible tilt forward defines the field straight up and down: along boresight, as in the limit of nearby
    directions.
    """
    lean = 1e-6
    return (
        rotation[0, 2] + lean * rotation[0, 0], rotation[1, 2] + lean * rotation[1, 0],
        rotation[2, 2] + lean * rotation[2, 0],
    )  # fmt: skip


@njit
def sent(up, direction):
    """Transmitted field as a complex vector."""
    x, y, z = upright(up, direction)
    return x + 0j, y + 0j, z + 0j


@njit
def reflected(field, arriving, leaving, normal, layer):
    """Transverse field after reflection: TE and TM parts times their Fresnel coefficients.

    Args:
        field: complex vector.
        arriving, leaving: unit directions of propagation.
        normal: of the mirror, on either side.
        layer: material of the mirror (`media.layer`).
    """
    te, tm = mirror(layer, min(abs(dot(arriving, normal)), 1.0))
    across = cross(arriving, normal)
    size = length(across)
    if size < 1e-6:
        return te * field[0], te * field[1], te * field[2]
    across = (across[0] / size, across[1] / size, across[2] / size)
    there, back = cross(across, arriving), cross(across, leaving)
    a, b = te * dot(field, across), tm * dot(field, there)
    return a * across[0] + b * back[0], a * across[1] + b * back[1], a * across[2] + b * back[2]
