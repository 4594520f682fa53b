"""Scans from synthetic power maps with known echoes."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarize.scans import echoes
from radarize.scans.extraction import METHODS, Maps, ScanConfig
from radarize.signal.bearings import BEARINGS

RANGES = 0.0446 * np.arange(96)
AZIMUTHS = np.radians(np.arange(-60.0, 61.0))
RNG = np.random.default_rng(4)


def noise(frames=1):
    return RNG.exponential(1.0, (32, frames, len(RANGES), len(AZIMUTHS))).mean(axis=0)


def echo(distance, azimuth, power, width=0.14):
    """An echo one range bin and one beam wide (Gaussian in range: parabolic in log power)."""
    along = np.exp(-(((RANGES - distance) / 0.0446) ** 2))
    across = np.exp(-(((AZIMUTHS - azimuth) / width) ** 2) / 2)
    return power * along[:, None] * across


def make_scans(power, ranges, azimuths, aware=None, *, method="elevation-aware"):
    """Scans from maps on given axes."""
    axes = SimpleNamespace(ranges=ranges, azimuths=azimuths)
    return Maps.of(axes, ScanConfig(), [power] if aware is None else [power, aware, power]).scans(method)


def at(scan, degrees):
    return scan[np.argmin(np.abs(BEARINGS - np.radians(degrees)))]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bearing", [-30.0, 0.0, 25.0])
def test_one_echo_is_found_where_it_is(method, bearing):
    power = noise() + echo(2.031, np.radians(bearing), 1e4, width=np.radians(4.0))
    scan = make_scans(power, RANGES, AZIMUTHS, power, method=method)[0]
    assert scan.shape == (88,)
    assert at(scan, bearing) == pytest.approx(2.031, abs=0.004)  # a tenth of a bin
    seen = BEARINGS[np.isfinite(scan)]
    # Near the edge of the field CFAR has neighbours on one side only.
    assert abs(np.degrees(seen.mean()) - bearing) < (2 if method == "cfar" else 1.5)
    assert np.ptp(np.degrees(seen)) < 30


def test_only_the_first_echo_survives():
    power = noise() + echo(1.5, 0, 1e3) + echo(3.5, 0, 4e3)
    assert at(make_scans(power, RANGES, AZIMUTHS, method="first-echo")[0], 0) == pytest.approx(1.5, abs=0.005)
    assert at(make_scans(power, RANGES, AZIMUTHS, method="threshold")[0], 0) == pytest.approx(3.5, abs=0.005)


def test_ceiling_is_suppressed_by_the_elevation_aware_map():
    wall = echo(3.0, 0, 1e4)
    ceiling = echo(1.2, 0, 1e4)
    power, aware = noise() + wall + ceiling, 0.25 * noise() + wall + 0.004 * ceiling
    assert at(make_scans(power, RANGES, AZIMUTHS, aware)[0], 0) == pytest.approx(3.0, abs=0.005)
    assert at(make_scans(power, RANGES, AZIMUTHS, method="first-echo")[0], 0) == pytest.approx(1.2, abs=0.005)


def test_noise_alone_leakage_and_zero_frames_give_nothing():
    leak = noise() + echo(0.05, 0, 1e6, width=10)
    assert not np.isfinite(make_scans(leak, RANGES, AZIMUTHS, method="first-echo")).any()
    assert not np.isfinite(make_scans(0 * leak, RANGES, AZIMUTHS, method="first-echo")).any()
    assert not np.isfinite(make_scans(np.nan * leak, RANGES, AZIMUTHS, method="first-echo")).any()


def test_sidelobes_at_the_same_range_are_not_echoes():
    lobe = np.maximum(np.exp(-((AZIMUTHS / np.radians(6)) ** 2)), 10**-2.2)
    power = noise() + 1e6 * np.exp(-(((RANGES - 2.0) / 0.0446) ** 2))[:, None] * lobe
    scan = make_scans(power, RANGES, AZIMUTHS, method="first-echo")[0]
    assert np.isfinite(at(scan, 0)) and not np.isfinite(at(scan, 30)) and not np.isfinite(at(scan, -30))


def test_narrow_maps_leave_outer_bearings_empty():
    inner = np.abs(AZIMUTHS) < np.radians(20.5)
    power = noise() + echo(2.0, 0, 1e4, width=10)
    scan = make_scans(power[..., inner], RANGES, AZIMUTHS[inner], method="first-echo")[0]
    assert np.isfinite(scan[np.abs(BEARINGS) < np.radians(20)]).all()
    assert not np.isfinite(scan[np.abs(BEARINGS) > np.radians(21)]).any()


def test_cfar_returns_the_strongest_cell_above_its_neighbours_both_ways():
    """Compared with loops over cells; and an echo as wide as the field of view is rejected by the CFAR over
    bearings."""
    inside = np.abs(AZIMUTHS[:, None] - BEARINGS).argmin(axis=0)
    power = noise() * 10 ** RNG.uniform(0, 2, (1, len(RANGES), len(AZIMUTHS)))
    config, level = ScanConfig(), 10 * np.log10(power[0][:, inside])
    cfar = config.cfar

    def around(values, k):
        near, far = cfar.guard + 1, cfar.guard + cfar.window
        below, above = values[max(0, k - far) : max(0, k - near + 1)], values[k + near : k + far + 1]
        whole = [np.mean(side) for side in (below, above) if len(side) == cfar.window]
        return np.mean(whole)

    scan = make_scans(power, RANGES, AZIMUTHS, method="cfar")[0]
    for b in range(len(BEARINGS)):
        found = [
            k
            for k in range(len(RANGES))
            if RANGES[k] >= config.min_range
            and level[k, b] > around(level[:, b], k) + cfar.threshold
            and level[k, b] > around(level[k], b) + cfar.threshold
        ]
        if found:
            assert abs(scan[b] - RANGES[max(found, key=lambda k: level[k, b])]) < 0.5001 * 0.0446
        else:
            assert np.isinf(scan[b])
    assert 10 < np.isfinite(scan).sum() < 80
    ring = noise() + echo(2.0, 0, 1e4, width=100)
    assert not np.isfinite(make_scans(ring, RANGES, AZIMUTHS, method="cfar")).any()


def test_first_echo_against_a_loop():
    occupied = RNG.random((6, 30, 9)) < 0.2
    power = RNG.random(occupied.shape)
    got = echoes.first(occupied, power)
    for f in range(6):
        for a in range(9):
            cells = np.flatnonzero(occupied[f, :, a])
            if not len(cells):
                assert got[f, a] == np.inf
                continue
            end = cells[0]
            while end < 30 and occupied[f, end, a]:
                end += 1
            best = cells[0] + power[f, cells[0] : end, a].argmax()
            assert abs(got[f, a] - best) <= 0.5
