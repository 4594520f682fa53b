"""Materials against Fresnel's formulas in closed form and the ITU's numbers."""

import pickle

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from radarsim.propagation.media import layer, mirror, window
from radarsim.world.materials import MATERIALS, Material, constant, itu_permittivity, material, skin

FREQUENCY = 77e9


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("concrete", 0.39),
        ("glass", 0.43),
        ("floorboard", 0.32),
        ("plasterboard", 0.25),
        ("chipboard", 0.23),
        ("wood", 0.17),
        ("ceiling board", 0.10),
        ("metal", 1.0),
    ],
)
def test_reflection_at_normal_incidence(name, expected):
    te, tm = MATERIALS[name].fresnel(np.array([1.0]), FREQUENCY)
    assert abs(te[0]) == pytest.approx(expected, abs=0.006)
    assert te[0] == pytest.approx(-tm[0])


def test_permittivity_follows_the_recommendation():
    # P.2040: concrete 5.24, sigma = 0.0462 f^0.7822 S/m; e^{+jwt} puts losses below the real axis.
    eps = material("concrete").permittivity_at(FREQUENCY)
    assert eps.real == pytest.approx(5.24)
    assert eps.imag == pytest.approx(-0.0462 * 77**0.7822 / (2 * np.pi * FREQUENCY * 8.8541878e-12), rel=1e-6)


@pytest.mark.parametrize(("name", "edges"), [("brick", (40, 110)), ("plywood", (40, 100)), ("marble", (60, 100))])
def test_gap_between_bands_is_bridged_without_a_step(name, edges):
    ghz = np.array([edges[0], edges[0] + 1e-6, *np.linspace(*edges, 9)[1:-1], edges[1] - 1e-6, edges[1]])
    eps = np.array([itu_permittivity(name, f * 1e9) for f in ghz])
    sigma = -eps.imag * ghz
    for values in (eps.real, sigma):
        steps = np.diff(values)
        assert np.all(steps >= -1e-9) or np.all(steps <= 1e-9)
        assert abs(steps[0]) < 1e-6 and abs(steps[-1]) < 1e-6


def test_every_material_is_lossy_and_reflects_less_than_all():
    cosines = np.linspace(0.01, 1, 50)
    for item in MATERIALS.values():
        if item.conductor:
            continue
        assert item.permittivity_at(FREQUENCY).imag < 0
        for gamma in item.fresnel(cosines, FREQUENCY):
            assert np.all(np.abs(gamma) < 1)


def test_brewster_angle_and_snell():
    # Lossless eps = 4: TM vanishes at tan(theta) = 2; TE there is (1 - 4) / (1 + 4).
    item = Material("test", constant(4.0, 0.0), 0.0, 0.0)
    te, tm = item.fresnel(np.cos([np.arctan(2.0)]), FREQUENCY)
    assert abs(tm[0]) < 1e-12
    assert te[0] == pytest.approx(-0.6)


def test_conductor():
    te, tm = MATERIALS["metal"].fresnel(np.linspace(0, 1, 5), FREQUENCY)
    assert np.all(te == -1) and np.all(tm == 1)


def test_slab_conserves_energy_and_resonates():
    config = PRESETS["radarize"]
    half_wave = constant(4.0, 0.0), config.wavelength / 4  # half a wave inside, n = 2
    for (law, thickness), cosines in ((half_wave, [1.0]), ((constant(4.0, 0.0), 1.234e-3), np.linspace(0.1, 1, 20))):
        slab = layer(Material("test", law, 0.0, 0.0, thickness=thickness), config)
        gamma, tau = np.array([(mirror(slab, c), window(slab, c, 0.01)[:2]) for c in cosines]).transpose(1, 0, 2)
        assert np.abs(gamma) ** 2 + np.abs(tau) ** 2 == pytest.approx(1.0)
        assert thickness != half_wave[1] or np.all(np.abs(gamma) < 1e-12)


def test_skin_meets_published_values():
    # Gabriel's dry skin at 60 GHz: 7.98 - 10.9j.
    assert skin(60e9) == pytest.approx(7.98 - 10.9j, abs=0.05)


def test_names():
    assert material("itu_ceiling_board") is MATERIALS["ceiling board"]
    with pytest.raises(InputError, match="'unobtainium'.*concrete.*wood"):
        material("unobtainium")


def test_a_scaled_material():
    """eps' and conductivity are multiplied at every frequency; diffuse power follows the reflected power."""
    for name in ("concrete", "fabric", "plasterboard"):
        plain, other = material(name), material(name).scaled(permittivity=1.2, conductivity=0.5)
        for frequency in (60e9, 77e9, 81e9):
            eps, scaled = (each.permittivity_at(frequency) for each in (plain, other))
            assert scaled == pytest.approx(complex(1.2 * eps.real, 0.5 * eps.imag))
        power = [abs((1 - np.sqrt(m.permittivity_at(77e9))) / (1 + np.sqrt(m.permittivity_at(77e9)))) ** 2
                 for m in (plain, other)]  # fmt: skip
        assert other.sigma0 / plain.sigma0 == pytest.approx(power[1] / power[0])
        assert (other.roughness, other.thickness, other.name) == (plain.roughness, plain.thickness, plain.name)
    assert material("ceiling board").scaled(permittivity=0.5).permittivity_at(77e9).real == 1.0
    assert material("metal").scaled(permittivity=2.0) is material("metal")
    whole = material("wood").scaled()
    assert (
        whole.permittivity_at(77e9) == material("wood").permittivity_at(77e9)
        and whole.sigma0 == material("wood").sigma0
    )
    again = pickle.loads(pickle.dumps(material("wood").scaled(1.1)))
    assert again.permittivity_at(77e9) == material("wood").scaled(1.1).permittivity_at(77e9)
