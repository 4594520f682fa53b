"""Scattering lobes: their energy by integration over the hemisphere, reciprocity, Lambert as the plain case."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarsim.propagation.media import LAMBERT, concentration, scattering, weights
from radarsim.world.materials import MATERIALS


def direction(theta, phi):
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def pattern(lobe, source, receiver):
    return scattering(source[2], receiver[2], source @ receiver, lobe)


def scattered_share(lobe, theta_in, steps=200):
    """Scattered over incident power, in units of sigma0 / 4: integral of sigma / (4 pi cos_in) over the hemisphere."""
    theta = (np.arange(steps) + 0.5) / steps * np.pi / 2
    phi = (np.arange(2 * steps) + 0.5) / (2 * steps) * 2 * np.pi
    source = direction(theta_in, 0.0)
    total = 0.0
    for t in theta:
        row = sum(pattern(lobe, source, direction(t, p)) for p in phi)
        total += row * np.sin(t) * (np.pi / 2 / steps) * (np.pi / steps)
    return 4 * total / (4 * np.pi * np.cos(theta_in))


def lobe(directive, backscatter, exponent):
    return weights(SimpleNamespace(directive=directive, backscatter=backscatter, lobe_exponent=exponent))


@pytest.mark.parametrize("theta", [0.0, 0.7, 1.4])
def test_lambert_scatters_its_share_at_any_angle(theta):
    assert scattered_share(np.array(LAMBERT), theta) == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("shape", [(1.0, 0.0, 4.0), (0.5, 0.2, 4.0), (0.0, 1.0, 10.0), (0.4, 0.1, 1.0)])
def test_energy_is_bounded(shape):
    """All of the power fraction at normal incidence, and never more at other angles."""
    shares = [scattered_share(lobe(*shape), theta, 60) for theta in (0.0, 0.3, 0.7, 1.1, 1.5)]
    assert shares[0] == pytest.approx(1, abs=2e-3)
    assert max(shares) < 1.002


def test_lobes_point_where_they_should():
    """At 40 deg incidence: the directive lobe peaks towards the mirror direction, the other one back."""
    theta = np.deg2rad(40)
    angles = np.deg2rad(np.arange(-85, 86))
    source = direction(theta, np.pi)
    for shape, towards in (((1.0, 0.0, 20.0), theta), ((0.0, 1.0, 20.0), -theta)):
        values = [pattern(lobe(*shape), source, direction(a, 0.0)) for a in angles]
        assert angles[int(np.argmax(values))] == pytest.approx(towards, abs=np.deg2rad(5))


def test_reciprocity():
    rng = np.random.default_rng(0)
    shape = lobe(0.5, 0.2, 4.0)
    for _ in range(50):
        a, b = (direction(rng.uniform(0, 1.5), rng.uniform(0, 6.3)) for _ in range(2))
        assert pattern(shape, a, b) == pytest.approx(pattern(shape, b, a), rel=1e-12)


def test_monostatic_lambert_is_cosine_squared():
    cosine = 0.6
    assert scattering(cosine, cosine, 1.0, np.array(LAMBERT)) == pytest.approx(cosine**2)


def test_concentration_of_no_lobe_is_lambert():
    assert concentration(0.0) == pytest.approx(1)


@pytest.mark.parametrize("name", sorted(MATERIALS))
def test_materials_share_out_no_more_than_there_is(name):
    """Diffuse and specular power together stay below the incident power."""
    item = MATERIALS[name]
    assert 0 <= item.directive and 0 <= item.backscatter and item.directive + item.backscatter <= 1
    gamma = abs(complex(item.fresnel(np.array(1.0), 77e9)[0]))
    assert item.sigma0 / 4 + (gamma * float(item.coherent_factor(np.array(1.0), 77e9))) ** 2 <= 1.0
