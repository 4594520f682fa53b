"""Materials of surfaces: permittivity, roughness and backscatter at millimetre waves.

Permittivity follows e^{+jwt}: eps = eps' - j sigma / (w eps0), losses have a negative imaginary part. ITU-R P.2040-4
gives eps' = a f^b and sigma = c f^d (f in GHz) with bands of validity, read from Sionna RT's own table; where 77 GHz
lies outside every band (brick, plywood, marble, vinyl, carpet, asphalt, acrylic) see `itu_permittivity`.

Reflection and the diffuse floor share one energy budget. Roughness takes the factor
rho = exp(-8 (pi sigma_h cos(theta) / lambda)^2) from the coherent amplitude, and what it takes comes back as diffuse
scattering, sigma0 = 4 (1 - rho^2) |Gamma|^2: the backscatter coefficient at normal incidence were it all Lambertian
(effective roughness, Degli-Esposti et al., IEEE TAP 55(1), 2007). `materials.yaml` has these values rounded, and a few
dB less for coarse or porous surfaces (carpet, fabric, mineral fibre, asphalt), which absorb part of what they take.
RMS heights are estimates for common finishes; expect sigma0 within some 5 dB of a given real wall.

Lobes share out the same power (`radarsim.propagation.media`). Plain surfaces, whose roughness is gentle,
scatter about the specular direction; the paper's measured walls ask for such a lobe, of exponent 4. Masonry and
aggregate have joints and pits that face the source and throw more back; cloth, fibre and foam are volumes and follow
Lambert. The shares are estimates; against Lambert they raise backscatter by 1.5 dB at normal incidence and
lower it by as much at grazing.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Annotated, Any

import numpy as np
from jaxtyping import Complex, Float
from pydantic import WithJsonSchema

from radarize.io.errors import InputError
from radarize.io.yamlfile import read_beside
from radarize.radar.config import SPEED_OF_LIGHT

EPS0 = 8.8541878128e-12
_BAND = 77e9  # Hz, at which diffuse scattering is balanced with reflection


@dataclass(frozen=True)
class Material:
    """A homogeneous surface material.

    Attributes:
        name: as used in scene files.
        permittivity: relative permittivity: a name in ITU-R P.2040, a function of the frequency in Hz that returns it
            (e^{+jwt}: negative imaginary part), or None for a perfect conductor.
        roughness: RMS height sigma_h of the surface, m.
        sigma0: four times the share of power scattered diffusely, linear m^2/m^2: without lobes the backscatter cross
            section per area at normal incidence, falling off as cos^2 of the incidence angle (Lambert).
        thickness: of a thin slab that waves pass (a pane, one board of a drywall), m; None: opaque half space.
        color: RGB in 0...1 for pictures.
        source: where the numbers come from.
        directive, backscatter: shares of the diffuse power in the lobes about the specular direction and back to the
            source; the rest is Lambertian.
        lobe_exponent: alpha of both lobes.
        clear: transparent to light: cameras and lidars see through it.
    """

    name: str
    permittivity: str | Callable[[float], complex] | None
    roughness: float
    sigma0: float
    thickness: float | None = None
    color: tuple[float, float, float] = (0.6, 0.6, 0.6)
    source: str = ""
    directive: float = 0.0
    backscatter: float = 0.0
    lobe_exponent: float = 4.0
    clear: bool = False

    @property
    def conductor(self) -> bool:
        """Whether this is a perfect electric conductor."""
        return self.permittivity is None

    def permittivity_at(self, frequency: float) -> complex:
        """Complex relative permittivity at `frequency` (Hz), negative imaginary part; -inf j for a conductor."""
        if self.permittivity is None:
            return complex(1.0, -np.inf)
        if isinstance(self.permittivity, str):
            return itu_permittivity(self.permittivity, frequency)
        return complex(self.permittivity(frequency))

    def scaled(self, permittivity: float = 1.0, conductivity: float = 1.0) -> "Material":
        """Scale eps' (which stays at least 1) and conductivity by factors; a conductor is not changed.

        Roughness stays, so sigma0 follows the power reflected at normal incidence.
        """
        if self.conductor:
            return self
        made = replace(self, permittivity=partial(_scaled, self, permittivity, conductivity))
        before, after = (abs(each.fresnel(np.array(1.0), _BAND)[0]) for each in (self, made))
        return replace(made, sigma0=float(self.sigma0 * (after / before) ** 2))

    def fresnel(
        self, cos_theta: Float[np.ndarray, "*n"], frequency: float
    ) -> tuple[Complex[np.ndarray, "*n"], Complex[np.ndarray, "*n"]]:
        """Reflection coefficients of the half space for incidence from air (ITU-R P.2040-4, eqs. 31a, 31b).

        Args:
            cos_theta: cosine of the angle between ray and normal, 0...1.
            frequency: Hz.

        Returns:
            (gamma_te, gamma_tm). Electric-field convention: at normal incidence TE = -TM; a conductor has TE = -1,
            TM = +1.
        """
        cos = np.abs(np.asarray(cos_theta, float))
        if self.conductor:
            return np.full(cos.shape, -1.0 + 0j), np.full(cos.shape, 1.0 + 0j)
        eps = self.permittivity_at(frequency)
        root = np.sqrt(eps - (1.0 - cos**2))  # principal branch: decays into the medium under e^{+jwt}
        return np.asarray((cos - root) / (cos + root)), np.asarray((eps * cos - root) / (eps * cos + root))

    def coherent_factor(self, cos_theta: Float[np.ndarray, "*n"], frequency: float) -> Float[np.ndarray, "*n"]:
        """Amplitude factor exp(-8 (pi sigma_h cos / lambda)^2) that roughness leaves to specular reflection."""
        wavelength = SPEED_OF_LIGHT / frequency
        return np.asarray(np.exp(-8 * (np.pi * self.roughness * np.asarray(cos_theta) / wavelength) ** 2))


def itu_permittivity(name: str, frequency: float) -> complex:
    """Relative permittivity of an ITU-R P.2040-4 material, interpolated between and extrapolated beyond its bands.

    Inside a band: the recommendation. Between two bands: eps' and log(sigma) linear in log(f) between the facing edges.
    Beyond the last band: the nearest band's power law carried on (eps' is constant in all of these). That is
    an assumption; it is smooth, and for acrylic it meets the eps' = 2.6 measured at 90 GHz (Lamb 1996).

    Args:
        name: ITU name, e.g. ``concrete``.
        frequency: Hz.

    Raises:
        KeyError: the table has no such material.
    """
    ghz = frequency / 1e9
    bands = _itu_table()[name]
    law = next((law for (low, high), law in bands.items() if low <= ghz <= high), None)
    if law is None:
        below = max((b for b in bands if b[1] < ghz), key=lambda b: b[1], default=None)
        above = min((b for b in bands if b[0] > ghz), key=lambda b: b[0], default=None)
        if below and above:
            (e0, s0), (e1, s1) = _power_law(bands[below], below[1]), _power_law(bands[above], above[0])
            weight = np.log(ghz / below[1]) / np.log(above[0] / below[1])
            real, sigma = e0 + weight * (e1 - e0), s0 ** (1 - weight) * s1**weight
            return complex(real, -sigma / (2 * np.pi * frequency * EPS0))
        law = bands[below or above]
    real, sigma = _power_law(law, ghz)
    return complex(real, -sigma / (2 * np.pi * frequency * EPS0))


def _power_law(law: tuple[float, float, float, float], ghz: float) -> tuple[float, float]:
    a, b, c, d = law
    return a * ghz**b, c * ghz**d


@cache
def _itu_table() -> dict:
    from radarsim.machine import llvm

    llvm.require()
    from sionna.rt.radio_materials.itu import ITU_MATERIALS_PROPERTIES

    return ITU_MATERIALS_PROPERTIES


def skin(frequency: float) -> complex:
    """Dry human skin: four-term Cole-Cole model reduced to its two non-zero terms (Gabriel et al., PMB 41, 1996)."""
    w = 2 * np.pi * frequency
    fast = 32.0 / (1 + 1j * w * 7.234e-12)
    slow = 1100.0 / (1 + (1j * w * 32.481e-9) ** 0.8)
    return complex(4.0 + fast + slow + 0.0002 / (1j * w * EPS0))


def constant(permittivity: float, conductivity: float) -> Callable[[float], complex]:
    """Permittivity function of a material with constant eps' and conductivity (S/m)."""
    return partial(_constant, permittivity, conductivity)


def _constant(permittivity: float, conductivity: float, frequency: float) -> complex:
    return complex(permittivity, -conductivity / (2 * np.pi * frequency * EPS0))


def _scaled(material: Material, permittivity: float, conductivity: float, frequency: float) -> complex:
    eps = material.permittivity_at(frequency)
    return complex(max(1.0, permittivity * eps.real), conductivity * eps.imag)


def decibel(value: float) -> float:
    """Power ratio of `value` dB."""
    return 10.0 ** (value / 10.0)


def _registered(
    name: str, permittivity: str | list[float] | None, sigma0_db: float, color: list[float], **about: Any
) -> Material:
    law = (
        skin if permittivity == "skin" else constant(*permittivity) if isinstance(permittivity, list) else permittivity
    )
    red, green, blue = color
    return Material(name, law, sigma0=decibel(sigma0_db), color=(red, green, blue), **about)


MATERIALS = {name: _registered(name, **about) for name, about in read_beside(__file__).items()}
#: Names of those that have a permittivity.
DIELECTRICS = tuple(name for name, each in MATERIALS.items() if not each.conductor)


#: A name that `material` accepts; editors suggest the registry's.
MaterialName = Annotated[
    str,
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": sorted(MATERIALS)},
                {"pattern": f"^(itu[ _-])?({'|'.join(name.replace(' ', '[ _-]') for name in sorted(MATERIALS))})$"},
            ]
        }
    ),
]


def material(name: str) -> Material:
    """A material of the registry; ``_`` and a leading ``itu`` are accepted (``itu_ceiling_board``).

    Raises:
        InputError: unknown name, with the known ones.
    """
    plain = name.strip().lower().replace("_", " ").replace("-", " ").removeprefix("itu ")
    if plain not in MATERIALS:
        raise InputError(f"unknown material {name!r}, expected one of: {', '.join(sorted(MATERIALS))}")
    return MATERIALS[plain]
