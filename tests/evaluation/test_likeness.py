"""Fréchet's distance against closed forms; patch statistics of maps made by hand."""

import numpy as np
import pytest

from radarize.evaluation.likeness import PATCH, frechet_distance, patch_statistics


def test_along_an_axis_it_is_the_distance_of_means_and_deviations():
    """One dimension: d^2 = (m1 - m2)^2 + (s1 - s2)^2."""
    ends = np.array([[-1.0], [1.0]])
    assert frechet_distance(2 * ends + 5, 6 * ends + 8) == pytest.approx(5)
    assert frechet_distance(ends, ends) == pytest.approx(0, abs=1e-7)


def test_of_normal_clouds_that_do_not_share_axes():
    """For S2 = A S1 A with symmetric positive A (an optimal transport map), d^2 = tr((A - 1) S1 (A - 1))."""
    rng = np.random.default_rng(0)
    one = rng.normal(size=(500, 3)) @ rng.normal(size=(3, 3))
    one -= one.mean(axis=0)
    root = rng.normal(size=(3, 3))
    stretch = root @ root.T + 0.1 * np.eye(3)
    expected = np.sqrt(np.mean(np.sum((one @ stretch - one) ** 2, axis=1)))
    assert frechet_distance(one, one @ stretch) == pytest.approx(expected)
    assert frechet_distance(one @ stretch, one) == pytest.approx(expected)
    assert frechet_distance(one, one @ stretch + [3, 0, 0]) == pytest.approx(np.hypot(expected, 3))


def test_statistics_of_a_ramp():
    rows, columns = np.mgrid[:16, :24]
    found = patch_statistics((2.0 * rows + 3.0 * columns)[None])
    assert found.shape == (1, 3 * 5, 5)
    assert found[0, :, 3] == pytest.approx(2) and found[0, :, 4] == pytest.approx(3)
    # Levels are about the map's mean: the medians of patches are symmetric about zero.
    assert found[0, :, 1] == pytest.approx(-found[0, ::-1, 1])


def test_gain_does_not_count_but_contrast_does():
    rng = np.random.default_rng(1)
    maps = rng.normal(0, 5, (4, 32, 40))
    same = patch_statistics(maps + 17.0)
    np.testing.assert_allclose(same, patch_statistics(maps))
    flat = np.concatenate(same), np.concatenate(patch_statistics(2 * maps))
    other = patch_statistics(rng.normal(0, 5, (4, 32, 40)))
    assert frechet_distance(*flat) > 10 * frechet_distance(flat[0], np.concatenate(other))
    assert PATCH == (8, 8)
