"""How objects reflect and transmit: coefficients tabled over the cosine of the angle of incidence.

A sheet is a slab of its material's thickness, and so is each face of a thick closed body of such a material (hollow: a
cabinet of boards, a stud wall); its inner faces lie that much further in. A thin closed body is one slab as thick as
itself. All else is an opaque half space. What a slab reflects and what it lets through are of one formula (ITU-R
P.2040-4, eqs. 42, 43), which is Airy's sum over the waves between its faces, at the centre of the sweep. How it turns
over the sweep is a delay, that of the group.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Complex, Float

from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.world.materials import Material
from radarsim.world.objects import SceneObject

#: Entries of the tables.
TABLE = 65
#: From the centre of the sweep to where delays are measured, Hz.
_STEP = 0.25e9
#: Closed bodies up to this mean thickness (m) are one homogeneous slab: door leaves, table tops.
THICKEST_BODY = 0.05


def as_slab(item: SceneObject) -> tuple[Material, bool]:
    """An object's material, as thick as it acts (None: opaque), and whether the slab is the whole of a closed body."""
    if item.material.conductor:
        return replace(item.material, thickness=None), False
    if item.mesh.is_watertight:
        normals = np.unique(item.mesh.face_normals.round(6), axis=0)
        width = float(np.ptp(item.mesh.vertices @ normals.T, axis=0).min())
        if width <= THICKEST_BODY:
            return replace(item.material, thickness=round(width, 4)), True
    return item.material, False


def reflection(material: Material, config: RadarConfig) -> Complex[np.ndarray, "2 cosine"]:
    """Coefficients for TE and TM with the factor that roughness leaves, as in the beat signal (conjugate)."""
    cosine, frequency = np.linspace(0, 1, TABLE), config.center_frequency
    return np.conj(material.slab(cosine, frequency)[0]) * material.coherent_factor(cosine, frequency)


def lag(material: Material, config: RadarConfig) -> float:
    """How much later than its front face's a material's head-on echo comes, m; before it (< 0) where the waves from
    both faces nearly cancel."""

    def head_on(frequency):
        return material.slab(np.ones(1), frequency)[0]

    return float(_delay(head_on, config)[0]) if material.thickness is not None else 0.0


def transmission(
    material: Material, config: RadarConfig
) -> tuple[Complex[np.ndarray, "2 cosine"], Float[np.ndarray, "cosine"]]:
    """Coefficients for TE and TM, relative to free space and as in the beat signal (conjugate), and delay (m).

    tau counts from face to face, in which a plane wave in air turns by k d cos(theta). The delay is that of the group,
    -d arg(tau) / dk over the sweep.
    """
    cosine = np.linspace(0, 1, TABLE)

    def excess(frequency):
        wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT
        return material.slab(cosine, frequency)[1] * np.exp(1j * wavenumber * material.thickness * cosine)

    delay = _delay(excess, config)
    return np.conj(excess(config.center_frequency)), np.maximum(delay, 0)


def _delay(coefficients, config):
    """-d arg / dk at the centre of the sweep, m, of the mean over polarisations (rows)."""
    low, high = (coefficients(config.center_frequency + s * _STEP) for s in (-1, 1))
    turn = np.angle(np.mean(high * low.conj(), axis=0) + 1e-300)
    return -turn / (2 * np.pi * 2 * _STEP / SPEED_OF_LIGHT)
