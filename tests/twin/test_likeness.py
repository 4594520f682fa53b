"""Fréchet distance against closed forms; patch statistics of maps with known content."""

import numpy as np
import pytest

from radarsim.twin.likeness import (
    DEPTH,
    PATCH,
    SCALES,
    WINDOW,
    correlation,
    foreground,
    frechet_distance,
    patch_statistics,
    similarity,
)  # fmt: skip


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


def test_correlation_is_pearsons():
    rng = np.random.default_rng(2)
    one, other = rng.normal(size=(2, 3, 20, 30))
    expected = [np.corrcoef(a.ravel(), b.ravel())[0, 1] for a, b in zip(one, other, strict=True)]
    assert correlation(one, other) == pytest.approx(expected)
    assert correlation(one, 3 * one + 7) == pytest.approx(1)
    assert np.isnan(correlation(one, np.ones_like(one))).all()


def test_foreground_forgets_gain_and_noise():
    rng = np.random.default_rng(3)
    maps = rng.normal(0, 5, (2, 32, 40))
    maps[:, 5, 5] = 80
    found = foreground(maps + 12)
    np.testing.assert_allclose(found, foreground(maps))
    assert (found[:, 5, 5] == DEPTH).all() and np.mean(found == 0) == pytest.approx(0.5, abs=0.01)


def test_similarity_is_wangs_ms_ssim():
    """For maps with space for two scales: cs(fine)^w1 * ssim(coarse)^w2, windows by brute force; coarse maps
    mirrored."""
    rng = np.random.default_rng(4)
    one = np.clip(rng.normal(20, 8, (1, 16, 16)), 0, DEPTH)
    other = np.clip(one + rng.normal(0, 3, one.shape), 0, DEPTH)
    offset = np.arange(WINDOW) - WINDOW // 2
    window = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * 1.5**2))
    window /= window.sum()

    def parts(a, b):
        a, b = (np.pad(x, WINDOW // 2, mode="reflect") for x in (a, b))
        a, b = (np.lib.stride_tricks.sliding_window_view(x, (WINDOW, WINDOW)) for x in (a, b))
        mean = [np.sum(window * x, axis=(2, 3)) for x in (a, b)]
        var = [np.sum(window * x**2, axis=(2, 3)) - m**2 for x, m in zip((a, b), mean, strict=True)]
        both = np.sum(window * a * b, axis=(2, 3)) - mean[0] * mean[1]
        c1, c2 = (0.01 * DEPTH) ** 2, (0.03 * DEPTH) ** 2
        contrast = (2 * both + c2) / (var[0] + var[1] + c2)
        return contrast, contrast * (2 * mean[0] * mean[1] + c1) / (mean[0] ** 2 + mean[1] ** 2 + c1)

    weights = np.array(SCALES[:2]) / sum(SCALES[:2])
    half = [x[0].reshape(8, 2, 8, 2).mean(axis=(1, 3)) for x in (one, other)]
    fine, coarse = parts(one[0], other[0])[0][5:-5, 5:-5].mean(), parts(*half)[1].mean()
    assert similarity(one, other) == pytest.approx(fine ** weights[0] * coarse ** weights[1], abs=1e-4)
    assert similarity(one, one) == pytest.approx(1)
    assert np.isnan(similarity(one[:, :4], other[:, :4])).all()
