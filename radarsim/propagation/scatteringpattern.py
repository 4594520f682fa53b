"""How a rough surface scatters: Lambertian floor, lobe about the mirror direction, lobe back to the source.

Effective roughness (Degli-Esposti, Fuschini, Vitucci, Falciasecca, IEEE TAP 55(1), 2007): of the diffuse power one
share is scattered as Lambert has it, one into a directive lobe ((1 + cos psi_r) / 2)^alpha about the specular
direction, one into a lobe ((1 + cos psi_i) / 2)^alpha back towards the source. The paper normalises
each lobe by its integral over the hemisphere, which depends on the angle of incidence and so breaks reciprocity. Here
the lobes multiply Lambert's cos(in) cos(out) instead, and are normalised at normal incidence, where that integral is
largest:

    sigma(in, out) = sigma0 cos(in) cos(out) (w + w_r ((1 + cos psi_r) / 2)^alpha + w_i ((1 + cos psi_i) / 2)^alpha),

so swapping the ways in and out changes nothing, and at no angle does a surface scatter more than the share sigma0 / 4
of the power that falls on it (at normal incidence, all of that share).
"""

import numpy as np
from jaxtyping import Float
from numba import njit

from radarsim.world.materials import Material

#: No lobes: Lambert's law, or an isotropic scatterer.
LAMBERT = (1.0, 0.0, 0.0, 1.0)


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
        cos_in, cos_out: cosines of both ways with the normal, positive (1 for an isotropic scatterer).
        cos_between: cosine of the angle between the directions to source and receiver, 1 for backscatter. The angle to
            the specular direction follows: cos psi_r = 2 cos_in cos_out - cos_between.
        lobe: as `weights` gives it.
    """
    shape = lobe[0]
    if lobe[1] > 0.0:
        shape += lobe[1] * max(0.5 + cos_in * cos_out - 0.5 * cos_between, 0.0) ** lobe[3]
    if lobe[2] > 0.0:
        shape += lobe[2] * (0.5 + 0.5 * cos_between) ** lobe[3]
    return cos_in * cos_out * shape
