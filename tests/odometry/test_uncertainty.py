"""Covariances of motions, compared with walks whose errors are drawn from the model, and with least squares over all
frames."""

import numpy as np
import pytest

from radarize.io.pose import between, compose, exponential
from radarize.odometry.uncertainty import SCALE, ErrorModel, MotionCovariance, half_turned

FRAMES, WALKS = 60, 10_000
WAY, TURN = np.array([0.04, 0.01]), 0.03
STEP = exponential(WAY, TURN)
DT = 1 / 30


def model(kept: float, heading: float, noise: np.ndarray, lasting: float = 0.0, velocity: float = 0.0) -> ErrorModel:
    """Error model: steps with noise along, across (m) and of yaw (rad); heading errors with correlation `kept` and
    added noise `heading` (rad); velocity errors (m/s) with correlation `lasting`."""
    cos, sin = np.cos(TURN / 2), np.sin(TURN / 2)
    aside = np.array([[cos, sin], [-sin, cos]]) @ np.diag(noise[:2])
    covariance, variance = np.zeros((FRAMES, 3, 3)), np.zeros((FRAMES, 3, 3))
    covariance[1:, :2, :2] = aside @ aside.T
    covariance[1:] += noise[2] ** 2 * np.outer(half_turned(STEP), half_turned(STEP))
    for k in range(1, FRAMES):
        variance[k, 0, 0] = kept**2 * variance[k - 1, 0, 0] + heading**2
    variance[:, 1:, 1:] = velocity**2 * np.eye(2)
    return ErrorModel(np.full(FRAMES, DT), covariance, np.tile([kept, lasting], (FRAMES, 1)), variance)


def drawn(errors: ErrorModel, noise: np.ndarray, rng) -> tuple[np.ndarray, np.ndarray]:
    """Poses of a walk in a curve, and of many estimates of it: (frame, 3), (frame, walk, 3)."""
    true, found = np.zeros((FRAMES, 3)), np.zeros((FRAMES, WALKS, 3))
    heading, velocity = np.zeros(WALKS), np.sqrt(errors.variance[0, 1, 1]) * rng.normal(size=(WALKS, 2))
    for k in range(1, FRAMES):
        (kept, lasting), variance = errors.correlation[k], errors.variance
        before, faster = heading, velocity
        heading = kept * heading + np.sqrt(variance[k, 0, 0] - kept**2 * variance[k - 1, 0, 0]) * rng.normal(size=WALKS)
        velocity = lasting * velocity + np.sqrt((1 - lasting**2) * variance[k, 1, 1]) * rng.normal(size=(WALKS, 2))
        turned = TURN + (heading - before) + noise[2] * rng.normal(size=WALKS)
        way = WAY + DT * (faster + velocity) / 2 + rng.normal(size=(WALKS, 2)) * noise[:2]
        # Half of the rotation before the translation, and half after it: independent of `half_turned`.
        cos, sin = np.cos(turned / 2), np.sin(turned / 2)
        moved = np.stack([cos * way[:, 0] - sin * way[:, 1], sin * way[:, 0] + cos * way[:, 1], turned], axis=1)
        true[k] = compose(true[k - 1], STEP)
        found[k] = compose(found[k - 1], moved)
    return true, found


@pytest.mark.parametrize("start", [0, 25])
@pytest.mark.parametrize(
    "errors",
    [
        {"kept": 0.7, "heading": 0.01},
        {"kept": 0.98, "heading": 0.01},
        {"kept": 1.0, "heading": 0.01},
        {"kept": 0.9, "heading": 0.003, "lasting": 0.6, "velocity": 0.05},
        {"kept": 0.9, "heading": 0.003, "lasting": 0.97, "velocity": 0.05},
    ],
)
def test_motions_scatter_as_modelled(errors, start):
    """Heading errors that are corrected soon, slowly or never, and velocity errors: over a few steps and many."""
    noise = np.array([0.002, 0.001, 0.002])
    known = model(noise=noise, **errors)
    true, found = drawn(known, noise, np.random.default_rng(3))
    for length in (1, 8, FRAMES - 1 - start):
        ends = start, start + length
        error = between(between(*true[[*ends]]), between(found[ends[0]], found[ends[1]]))
        covariance, scatter = _motion(known, true, start, length), np.cov(error.T)
        sizes = np.sqrt(np.outer(np.diag(scatter), np.diag(scatter)))
        assert np.abs((covariance - scatter) / sizes).max() < 0.04
        nees = (error * np.linalg.solve(covariance, error.T).T).sum(axis=1).mean() / 3
        assert nees == pytest.approx(1, abs=0.05)


def _motion(errors: ErrorModel, poses: np.ndarray, start: int, length: int) -> np.ndarray:
    """Covariance of a motion, without scale error."""
    found = MotionCovariance(errors.variance[start], scale=0.0)
    for k in range(start + 1, start + length + 1):
        found.step(between(poses[k - 1], poses[k]), errors[k])
    return found.covariance


def test_against_least_squares_over_all_frames():
    """On a straight line: the covariance of the position is that of one linear system for the errors of all frames."""
    rng, start, length = np.random.default_rng(1), 7, 40
    lasting, deviation = rng.uniform(0.5, 0.9, FRAMES), np.full(FRAMES, 0.05)
    errors = model(1.0, 0.0, np.array([0.002, 0.001, 0.0]), velocity=0.05)
    errors.correlation[:, 1] = lasting
    poses = np.zeros((FRAMES, 3))  # the heading is constant
    errors.noise[1:] = np.diag([0.002, 0.001, 0.0]) ** 2
    # Unknowns: velocity errors at the frames of the window; rows: how each follows from the previous one.
    velocities = length + 1
    rows, weights = [np.eye(velocities)[0]], [1 / deviation[start] ** 2]
    for k in range(1, velocities):
        row = np.eye(velocities)[k] - lasting[start + k] * np.eye(velocities)[k - 1]
        rows.append(row), weights.append(1 / (deviation[start + k] ** 2 * (1 - lasting[start + k] ** 2)))
    covariance = np.linalg.inv(np.array(rows).T @ np.diag(weights) @ np.array(rows))
    way = DT * np.convolve(np.ones(velocities - 1), [0.5, 0.5])
    expected = way @ covariance @ way + length * np.array([0.002, 0.001]) ** 2
    assert np.diag(_motion(errors, poses, start, length))[:2] == pytest.approx(expected, rel=1e-9)


def test_a_corrected_heading_error_is_no_drift():
    """With a stationary heading error, the variance of a long rotation is twice that of the error, and of one step a
    small part of it."""
    variance = np.zeros((FRAMES, 3, 3))
    variance[:, 0, 0] = 0.01**2
    errors = ErrorModel(np.full(FRAMES, DT), np.zeros((FRAMES, 3, 3)), np.tile([0.9, 0.0], (FRAMES, 1)), variance)
    standing = np.zeros((FRAMES, 3))
    turns = [errors.motions(standing, np.array([4]), n)[0, 2, 2] / 0.01**2 for n in (1, 10, 50)]
    assert turns == pytest.approx([2 * (1 - 0.9**n) for n in (1, 10, 50)])


def test_independent_steps_add_up():
    covariance = np.tile(np.diag([1e-4, 4e-4, 1e-6]), (FRAMES, 1, 1))
    found = ErrorModel.independent(covariance).motions(np.zeros((FRAMES, 3)), np.array([0, 9]), 16)
    np.testing.assert_allclose(found, np.tile(16 * covariance[0], (2, 1, 1)), rtol=1e-12)


def test_scale_error_is_along_the_path():
    motion, exact = MotionCovariance(np.zeros((3, 3))), ErrorModel.independent(np.zeros((3, 3)))
    for _ in range(50):
        motion.step(np.array([0.0, 0.2, 0.0]), exact)
    assert np.sqrt(np.diag(motion.covariance)) == pytest.approx([0, 10 * SCALE, 0])
    motion.step(np.array([0.0, 0.0, np.pi / 2]), exact)
    assert np.sqrt(np.diag(motion.covariance)) == pytest.approx([10 * SCALE, 0, 0])


@pytest.fixture
def walk() -> tuple[np.ndarray, ErrorModel]:
    """Poses, and errors that vary from step to step."""
    rng = np.random.default_rng(0)
    poses = np.cumsum(rng.normal(size=(FRAMES, 3)) * 0.05, axis=0)
    noise, variance = rng.uniform(1e-5, 2e-5, (FRAMES, 1, 1)) * np.eye(3), np.zeros((FRAMES, 3, 3))
    variance[:, [0, 1, 2], [0, 1, 2]] = rng.uniform(1e-4, 2e-4, (FRAMES, 3))
    return poses, ErrorModel(np.full(FRAMES, DT), noise, rng.uniform(0.5, 0.7, (FRAMES, 2)), variance)


@pytest.mark.parametrize("length", [1, 7, FRAMES - 1])
def test_rotations_agree_with_motions(walk, length):
    poses, errors = walk
    motions = errors.motions(poses, np.arange(FRAMES - length), length)
    np.testing.assert_allclose(errors.turns(length), motions[:, 2, 2], rtol=1e-9)


def test_windows_are_independent_of_each_other(walk):
    poses, errors = walk
    starts = np.array([0, 7, 30])
    together = errors.motions(poses, starts, 20)
    np.testing.assert_allclose(together, [errors.motions(poses, np.array([k]), 20)[0] for k in starts], rtol=1e-12)
    np.testing.assert_allclose(errors.since_start(poses)[20], together[0], rtol=1e-9)


def test_a_step_is_the_sum_of_its_halves():
    """Noise grows with time."""
    errors = model(0.9, 0.01, np.array([0.002, 0.001, 0.002]))[30]
    half = errors.part(0.5)
    assert half.part(1.0).noise == pytest.approx(errors.noise / 2)
    assert half.correlation**2 == pytest.approx(errors.correlation)
