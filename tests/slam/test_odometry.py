"""Odometry as a function of time, and covariance of its motions compared with sampling."""

import numpy as np
import pytest

from radarize.io.pose import between, compose
from radarize.slam.config import OdometryConfig
from radarize.slam.odometry import Drift, Odometry


def test_pose_between_entries_and_outside():
    odometry = Odometry(OdometryConfig())
    odometry.add(1.0, np.array([0, 0, 3.0]), None)
    odometry.add(3.0, np.array([2, 1, -3.0]), None)
    np.testing.assert_allclose(odometry.pose(2.0)[:2], [1, 0.5])
    assert abs(odometry.pose(2.0)[2]) == pytest.approx(np.pi)
    np.testing.assert_allclose(odometry.pose(0.0), [0, 0, 3])
    np.testing.assert_allclose(odometry.pose(9.0), [2, 1, -3])
    assert not odometry.add(3.0, np.zeros(3), None)
    assert odometry.covers(3.0) and not odometry.covers(3.1)


def test_covariance_of_a_motion_is_that_of_sampled_steps():
    rng = np.random.default_rng(8)
    steps = np.array([[0.5, 0.1, 0.3], [0.4, -0.2, -0.5], [0.6, 0.0, 0.2], [0.1, 0.3, 0.8]])
    root = np.array([[0.02, 0, 0], [0.004, 0.01, 0], [0.002, -0.003, 0.015]])
    covariance = root @ root.T
    odometry = Odometry(OdometryConfig(scale=0.0))
    pose = np.array([3.0, -1.0, 2.0])
    odometry.add(0.0, pose, np.zeros((3, 3)))
    for k, step in enumerate(steps):
        pose = compose(pose, step)
        odometry.add(k + 1.0, pose, covariance)
    motion, got = odometry.motion(0.0, 4.0)
    samples = np.zeros((40_000, 3))
    for step in steps:
        samples = compose(compose(samples, step), rng.normal(size=(len(samples), 3)) @ root.T)
    spread = np.sqrt(got.diagonal())
    sampled = np.cov(between(motion, samples).T)
    np.testing.assert_allclose(sampled / np.outer(spread, spread), got / np.outer(spread, spread), atol=0.04)
    _, half = odometry.motion(1.0, 1.5)
    np.testing.assert_allclose(half, covariance / 2, atol=2e-8)


def test_the_scale_error_is_added():
    odometry = Odometry(OdometryConfig(scale=0.02))
    odometry.add(0.0, np.zeros(3), np.zeros((3, 3)))
    odometry.add(1.0, np.array([3.0, 4.0, 0.5]), np.eye(3) * 1e-6)
    _, covariance = odometry.motion(0.0, 1.0)
    np.testing.assert_allclose(covariance.diagonal(), [0.1**2, 0.1**2, 1e-6], rtol=0.02)


def test_drift_between_nodes_agrees_with_sampled_walks():
    rng = np.random.default_rng(9)
    sigma = np.array([0.02, 0.01, 0.015])
    steps = np.tile([0.4, 0.05, 0.3], (30, 1))
    drift, pose = Drift(scale=0.0), np.array([5.0, -3.0, 1.0])
    drift.add(pose, np.zeros((3, 3)), 0.0)
    for step in steps:
        pose = compose(pose, step)
        drift.add(pose, np.diag(sigma**2), 0.4)
    whole, samples = np.zeros(3), np.zeros((40_000, 3))
    for step in steps[10:]:
        whole, samples = compose(whole, step), compose(samples, step + rng.normal(0, sigma, samples.shape))
    sampled = np.cov(between(whole, samples).T)
    got = drift.between(10, 30)
    np.testing.assert_allclose(np.sqrt(sampled.diagonal()), np.sqrt(got.diagonal()), rtol=0.05)
    np.testing.assert_array_equal(got, drift.between(30, 10))
    assert np.sqrt(Drift.between(drift, 0, 30)[2, 2]) > np.sqrt(got[2, 2])


def test_model_without_covariance():
    config = OdometryConfig(translation=0.03, translation_per_metre=0.04, rotation=0.01)
    odometry = Odometry(config)
    odometry.add(0.0, np.zeros(3), None)
    odometry.add(1.0, np.array([1.0, 0, 0]), None)
    _, covariance = odometry.motion(0.0, 1.0)
    assert covariance[0, 0] == pytest.approx(0.05**2)
