"""Interaction of waves with surfaces: Fresnel coefficients, slabs, roughness, scattering.

A sheet is a slab of its material's thickness, and so is each face of a thick closed body of such a material (hollow: a
cabinet of boards, a stud wall), with inner faces at that depth. A thin closed body is one slab of its own thickness.
All else is an opaque half space. Reflection and transmission of a slab follow from one formula (ITU-R P.2040-4, eqs.
42, 43), Airy's sum over the waves between its faces, at the centre of the sweep. Its phase slope over the middle half
of the sweep is a group delay.

With p = exp(-j k d root), root = sqrt(eps - sin^2), a slab of half-space coefficient g has

    gamma = g (1 - p^2) / (1 - g^2 p^2),        tau = (1 - g^2) p / (1 - g^2 p^2).

Both are computed anew for every ray: between the faces of a door leaf of 40 mm, fringes are some degrees apart, too
close for a table. Their phase slopes over the sweep need no unwrapping: that of p is k d Re(root), and the
brackets have positive real parts.

A rough surface has a Lambertian part, a lobe about the specular direction, and a lobe back to the source: effective
roughness (Degli-Esposti, Fuschini, Vitucci, Falciasecca, IEEE TAP 55(1), 2007). Of the diffuse power one fraction is
Lambertian, one is in a directive lobe ((1 + cos psi_r) / 2)^alpha about the specular direction, one in a lobe ((1 + cos
psi_i) / 2)^alpha back towards the source. The paper normalises each lobe by its integral over the hemisphere, which
depends on the angle of incidence and so breaks reciprocity. Here the lobes multiply Lambert's cos(in) cos(out) instead,
and are normalised at normal incidence, where that integral is largest:

    sigma(in, out) = sigma0 cos(in) cos(out) (w + w_r ((1 + cos psi_r) / 2)^alpha + w_i ((1 + cos psi_i) / 2)^alpha),

so it is reciprocal, and at no angle does a surface scatter more than the fraction sigma0 / 4 of the power on it (at
normal incidence, exactly that fraction).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Complex, Float
from numba import njit

from radarize.radar.config import RadarConfig
from radarsim.world.materials import Material
from radarsim.world.objects import SceneObject

#: Columns of a layer: permittivity (-inf j: conductor), electric thickness k d (0: opaque half space), the exponent of
#: the loss by roughness at normal incidence, the reflection coefficient at normal incidence as in the beat signal, and
#: the factor on the amplitude by small objects in front (`clutter.uncovered`).
LAYER, HEAD_ON, UNCOVERED = 5, 3, 4
#: Largest mean thickness (m) of closed bodies that are one homogeneous slab: door leaves, table tops.
THICKEST_BODY = 0.05
#: No lobes: Lambertian, or an isotropic scatterer.
LAMBERT = (1.0, 0.0, 0.0, 1.0)


def as_slab(item: SceneObject) -> tuple[Material, bool]:
    """Return a material with its effective thickness (None: opaque), and whether the slab is a whole closed body."""
    if item.material.conductor:
        return replace(item.material, thickness=None), False
    if item.mesh.is_watertight:
        normals = np.unique(item.mesh.face_normals.round(6), axis=0)
        width = float(np.ptp(item.mesh.vertices @ normals.T, axis=0).min())
        if width <= THICKEST_BODY:
            return replace(item.material, thickness=round(width, 4)), True
    return item.material, False


def layer(material: Material, config: RadarConfig) -> Complex[np.ndarray, "5"]:
    """Columns of a layer, for `mirror` and `window`, from a material with its effective thickness."""
    frequency, wavenumber = config.center_frequency, 2 * np.pi / config.wavelength
    found = np.empty(LAYER, complex)
    found[0], found[1] = material.permittivity_at(frequency), wavenumber * (material.thickness or 0.0)
    found[2] = -np.log(material.coherent_factor(np.ones(1), frequency)[0])
    found[UNCOVERED] = 1.0
    found[HEAD_ON] = mirror(found, 1.0)[0]
    return found


def covered(layers: Complex[np.ndarray, "*n 5"], left: Float[np.ndarray, "*n"] | float) -> Complex[np.ndarray, "*n 5"]:
    """Layers whose reflection is reduced to a fraction of the amplitude by small objects in front."""
    found = layers.copy()
    found[..., HEAD_ON:] = layers[..., HEAD_ON:] * np.asarray(left)[..., None]
    return found


@njit(cache=True)
def mirror(layer, cosine):
    """Reflection coefficients for TE and TM at a cosine of incidence, roughness included, as in the beat signal."""
    left = layer[UNCOVERED].real * np.exp(-layer[2].real * cosine * cosine)
    if np.isinf(layer[0].imag):
        return -left + 0j, left + 0j
    te, tm, root = _half_space(layer[0], cosine)
    if layer[1].real > 0:
        square = np.exp(-2j * layer[1].real * root)
        te = te * (1 - square) / (1 - te * te * square)
        tm = tm * (1 - square) / (1 - tm * tm * square)
    return left * te.conjugate(), left * tm.conjugate()


@njit(cache=True)
def window(layer, cosine, share):
    """Transmission coefficients of a slab for TE and TM, relative to the air in its place and as in the beat signal,
    and the delay of their mean, in units of 1 / k.

    Args:
        layer, cosine: see `mirror`.
        share: fraction of the frequency over which the delay is taken.
    """
    turn, (te, tm, root) = layer[1].real, _half_space(layer[0], cosine)
    once = np.exp(-1j * turn * root)
    loops = 1 - te * te * once * once, 1 - tm * tm * once * once
    air = once * np.exp(1j * turn * cosine)
    through = (1 - te * te) * air / loops[0], (1 - tm * tm) * air / loops[1]
    low, high = np.exp(-2j * turn * (1 - share / 2) * root), np.exp(-2j * turn * (1 + share / 2) * root)
    rest = np.angle(1 - te * te * high) - np.angle(1 - te * te * low)
    rest += np.angle(1 - tm * tm * high) - np.angle(1 - tm * tm * low)
    return through[0].conjugate(), through[1].conjugate(), turn * (root.real - cosine) + rest / 2 / share


@njit(cache=True)
def _half_space(permittivity, cosine):
    """Fresnel coefficients of a half space for TE and TM (`Material.fresnel`), and sqrt(eps - sin^2)."""
    root = np.sqrt(permittivity - (1 - cosine * cosine))
    return (cosine - root) / (cosine + root), (permittivity * cosine - root) / (permittivity * cosine + root), root


def lag(material: Material, config: RadarConfig) -> float:
    """Additional delay of a material's echo at normal incidence relative to its front face, m; negative where the waves
    from both faces nearly cancel."""
    eps, turn = layer(material, config)[:2]
    if turn == 0 or np.isinf(eps.imag):
        return 0.0
    te, _, root = _half_space(eps, 1.0)
    share = sweep_share(config)
    low, high = (np.exp(-2j * turn.real * (1 + s * share / 2) * root) for s in (-1, 1))
    rest = np.angle(1 - te * te * high) - np.angle(1 - te * te * low) - np.angle(1 - high) + np.angle(1 - low)
    return float(rest / share) * config.wavelength / (2 * np.pi)


def sweep_share(config: RadarConfig) -> float:
    """Middle half of the sweep, over which delays are taken, as a fraction of its centre frequency."""
    return config.bandwidth / 2 / config.center_frequency


def concentration(exponent: float) -> float:
    """Peak of a lobe over the Lambertian of the same power, at normal incidence: pi over the lobe's integral.

    The integral over the hemisphere of cos(theta) ((1 + cos theta) / 2)^alpha is closed with t = (1 + cos theta) / 2.
    """

    def primitive(t: float) -> float:
        return 2 * t ** (exponent + 2) / (exponent + 2) - t ** (exponent + 1) / (exponent + 1)

    return 1 / (4 * (primitive(1.0) - primitive(0.5)))


def weights(material: Material) -> Float[np.ndarray, "4"]:
    """Weights of the Lambertian, the directive and the backscatter part and the lobes' exponent of a material."""
    peak = concentration(material.lobe_exponent)
    lambert = 1 - material.directive - material.backscatter
    return np.array([lambert, material.directive * peak, material.backscatter * peak, material.lobe_exponent])


@njit(inline="always")
def scattering(cos_in, cos_out, cos_between, lobe):
    """Bistatic radar cross section over sigma0 times the area.

    Args:
        cos_in, cos_out: cosines of both directions with the normal, positive (1 for an isotropic scatterer).
        cos_between: cosine of the angle between the directions to source and receiver, 1 for backscatter. The angle to
            the specular direction follows: cos psi_r = 2 cos_in cos_out - cos_between.
        lobe: see `weights`.
    """
    shape = lobe[0]
    if lobe[1] > 0.0:
        shape += lobe[1] * max(0.5 + cos_in * cos_out - 0.5 * cos_between, 0.0) ** lobe[3]
    if lobe[2] > 0.0:
        shape += lobe[2] * (0.5 + 0.5 * cos_between) ** lobe[3]
    return cos_in * cos_out * shape
