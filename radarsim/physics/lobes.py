"""How a rough surface scatters: Lambertian floor, lobe about the mirror direction, lobe back to the source.

Effective roughness (Degli-Esposti, Fuschini, Vitucci, Falciasecca, IEEE TAP 55(1), 2007): of the diffuse power one
share is scattered as Lambert has it, one into a directive lobe ((1 + cos psi_r) / 2)^alpha about the specular
direction, one into a lobe ((1 + cos psi_i) / 2)^alpha back towards the source. The paper normalises each lobe by its
integral over the hemisphere, which depends on the angle of incidence and so breaks reciprocity. Here the lobes
multiply Lambert's cos(in) cos(out) instead, and are normalised at normal incidence, where that integral is largest:

    sigma(in, out) = sigma0 cos(in) cos(out) (w_l + w_d ((1 + cos psi_r) / 2)^alpha + w_b ((1 + cos psi_i) / 2)^alpha),

so swapping the ways in and out changes nothing, and no surface scatters more than its share at any angle. The weights
add up to 1: sigma0 is the backscatter coefficient at normal incidence whatever the lobes.
"""

import numpy as np
from jaxtyping import Float
from numba import njit

from radarsim.scene.materials import Material

#: No lobes: Lambert's law, or an isotropic scatterer.
LAMBERT = (0.0, 0.0, 1.0)


def concentration(exponent: float) -> float:
    """Peak of a lobe over the Lambertian of the same power, at normal incidence: pi over the lobe's integral.

    The integral over the hemisphere of cos(theta) ((1 + cos theta) / 2)^alpha is closed with t = (1 + cos theta) / 2.
    """

    def primitive(t: float) -> float:
        return 2 * t ** (exponent + 2) / (exponent + 2) - t ** (exponent + 1) / (exponent + 1)

    return 1 / (4 * (primitive(1.0) - primitive(0.5)))


def weights(material: Material) -> Float[np.ndarray, "3"]:
    """Directive weight, backscatter weight and exponent of a material, as `scattering` takes them."""
    peak = concentration(material.lobe_exponent)
    directive, backscatter = material.directive * peak, material.backscatter * peak
    total = 1 - material.directive - material.backscatter + directive + backscatter
    return np.array([directive / total, backscatter / total, material.lobe_exponent])


@njit(inline="always")
def scattering(cos_in, cos_out, cos_between, lobe):
    """Bistatic radar cross section over that at normal incidence.

    Args:
        cos_in, cos_out: cosines of both ways with the normal, positive (1 for an isotropic scatterer).
        cos_between: cosine of the angle between the directions to source and receiver, 1 for backscatter. The angle to
            the specular direction follows: cos psi_r = 2 cos_in cos_out - cos_between.
        lobe: directive weight, backscatter weight, exponent.
    """
    shape = 1.0 - lobe[0] - lobe[1]
    if lobe[0] > 0.0:
        shape += lobe[0] * max(0.5 + cos_in * cos_out - 0.5 * cos_between, 0.0) ** lobe[2]
    if lobe[1] > 0.0:
        shape += lobe[1] * (0.5 + 0.5 * cos_between) ** lobe[2]
    return cos_in * cos_out * shape
