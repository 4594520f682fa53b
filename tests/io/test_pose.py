"""Pose arithmetic against homogeneous matrices."""

import numpy as np

from radarize.io.pose import adjoint, between, compose, interpolate, inverse, transform, wrap

RNG = np.random.default_rng(0)


def matrix(p):
    c, s = np.cos(p[2]), np.sin(p[2])
    return np.array([[c, -s, p[0]], [s, c, p[1]], [0, 0, 1]])


def test_against_matrices():
    for _ in range(20):
        a, b = RNG.uniform(-3, 3, (2, 3))
        np.testing.assert_allclose(matrix(compose(a, b)), matrix(a) @ matrix(b), atol=1e-12)
        np.testing.assert_allclose(matrix(inverse(a)), np.linalg.inv(matrix(a)), atol=1e-12)
        np.testing.assert_allclose(compose(a, between(a, b)), [*b[:2], wrap(b[2])], atol=1e-12)
        points = RNG.normal(size=(5, 2))
        expected = (matrix(a) @ np.c_[points, np.ones(5)].T)[:2].T
        np.testing.assert_allclose(transform(a, points), expected, atol=1e-12)


def test_adjoint_carries_small_motions():
    a, small = np.array([1.0, -2.0, 0.7]), 1e-6 * np.array([1.0, 2.0, -3.0])
    carried = compose(compose(a, small), inverse(a))
    np.testing.assert_allclose(carried, adjoint(a) @ small, atol=1e-11)


def test_interpolation_takes_the_short_way():
    a, b = np.array([0, 0, 3.0]), np.array([2.0, 4.0, -3.0])
    middle = interpolate(a, b, 0.5)
    np.testing.assert_allclose(middle[:2], [1, 2])
    assert abs(abs(middle[2]) - np.pi) < 1e-9
