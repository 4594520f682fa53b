"""How far motions may be off, beside walks whose steps are drawn as is claimed."""

import numpy as np
import pytest

from radarize.io.pose import between, compose, exponential
from radarize.odometry.claims import _SCALE, Claims, Unknown, half_turned

FRAMES, WALKS = 60, 10_000
STEP = exponential(np.array([0.04, 0.01]), 0.03)


def drawn(kept: np.ndarray, held: np.ndarray, half: np.ndarray, rng) -> tuple[np.ndarray, np.ndarray]:
    """Poses of a walk in a curve, and of many odometries of it: (frame, 3), (frame, walk, 3).

    A heading is off by e, which goes on as kept * e and news; a step errs by what e changes by, and by noise.
    """
    true, found = np.zeros((FRAMES, 3)), np.zeros((FRAMES, WALKS, 3))
    error = np.zeros(WALKS)
    for k in range(1, FRAMES):
        news = held[k] - kept[k] ** 2 * held[k - 1]
        before, error = error, kept[k] * error + np.sqrt(news) * rng.normal(size=WALKS)
        turned = STEP[2] + (error - before) + half[2, 2] * rng.normal(size=WALKS)
        # Half of the turn before the way, and half after it: nothing of `half_turned`.
        way = np.array([0.04, 0.01]) + rng.normal(size=(WALKS, 2)) @ half[:2, :2].T
        direction = turned / 2
        cos, sin = np.cos(direction), np.sin(direction)
        moved = np.stack([cos * way[:, 0] - sin * way[:, 1], sin * way[:, 0] + cos * way[:, 1], turned], axis=1)
        true[k] = compose(true[k - 1], STEP)
        found[k] = compose(found[k - 1], moved)
    return true, found


def claims_of(kept: np.ndarray, held: np.ndarray, half: np.ndarray) -> Claims:
    turned, noise = half_turned(STEP), np.zeros((FRAMES, 3, 3))
    cos, sin = np.cos(STEP[2] / 2), np.sin(STEP[2] / 2)
    aside = np.array([[cos, sin], [-sin, cos]]) @ half[:2, :2]
    noise[1:, :2, :2] = aside @ aside.T
    noise[1:] += half[2, 2] ** 2 * np.outer(turned, turned)
    return Claims(noise, kept, held)


@pytest.mark.parametrize("start", [0, 25])
@pytest.mark.parametrize("fading", [0.7, 0.98, 1.0])
def test_motions_scatter_as_claimed(fading, start, monkeypatch):
    """Errors of headings that are soon taken back, slowly, or never: over a few steps and over many."""
    monkeypatch.setattr("radarize.odometry.claims._SCALE", 0.0)
    kept, held = np.full(FRAMES, fading), np.zeros(FRAMES)
    for k in range(1, FRAMES):
        held[k] = fading**2 * held[k - 1] + 0.01**2
    half = np.diag([0.002, 0.001, 0.002])
    true, found = drawn(kept, held, half, np.random.default_rng(3))
    claims = claims_of(kept, held, half)
    for length in (1, 8, FRAMES - 1 - start):
        ends = start, start + length
        off = between(between(*true[[*ends]]), between(found[ends[0]], found[ends[1]]))
        scatter, claimed = np.cov(off.T), claims.motions(true, np.array([start]), length)[0]
        sizes = np.sqrt(np.outer(np.diag(scatter), np.diag(scatter)))
        assert np.abs((claimed - scatter) / sizes).max() < 0.04


def test_what_is_taken_back_is_no_drift():
    """As headings hold their error, a turn over any time is unsure by twice its variance, and one step by little."""
    kept, held = np.full(FRAMES, 0.9), np.full(FRAMES, 0.01**2)
    claims = Claims(np.zeros((FRAMES, 3, 3)), kept, held)
    standing = np.zeros((FRAMES, 3))
    turns = [claims.motions(standing, np.array([4]), n)[0, 2, 2] / 0.01**2 for n in (1, 10, 50)]
    assert turns == pytest.approx([2 * (1 - 0.9**n) for n in (1, 10, 50)])


def test_independent_steps_add_up():
    covariance = np.tile(np.diag([1e-4, 4e-4, 1e-6]), (FRAMES, 1, 1))
    found = Claims.independent(covariance).motions(np.zeros((FRAMES, 3)), np.array([0, 9]), 16)
    np.testing.assert_allclose(found, np.tile(16 * covariance[0], (2, 1, 1)), rtol=1e-12)


def test_a_way_is_unsure_by_a_share_of_itself_ahead_but_not_aside():
    unknown, sure = Unknown(), Claims.independent(np.zeros((1, 3, 3)))
    for _ in range(50):
        unknown.step(np.array([0.0, 0.2, 0.0]), sure, 0)
    assert np.sqrt(np.diag(unknown.covariance)) == pytest.approx([0, 10 * _SCALE, 0])


@pytest.fixture
def walk() -> tuple[np.ndarray, Claims]:
    """Poses, and claims that change from step to step."""
    rng = np.random.default_rng(0)
    poses = np.cumsum(rng.normal(size=(FRAMES, 3)) * 0.05, axis=0)
    noise = rng.uniform(1e-5, 2e-5, (FRAMES, 1, 1)) * np.eye(3)
    return poses, Claims(noise, rng.uniform(0.5, 0.7, FRAMES), rng.uniform(1e-4, 2e-4, FRAMES))


@pytest.mark.parametrize("length", [1, 7, FRAMES - 1])
def test_turns_are_those_of_motions(walk, length):
    poses, claims = walk
    motions = claims.motions(poses, np.arange(FRAMES - length), length)
    np.testing.assert_allclose(claims.turns(length), motions[:, 2, 2], rtol=1e-9)


def test_a_window_of_many_is_as_alone(walk):
    poses, claims = walk
    starts = np.array([0, 7, 30])
    together = claims.motions(poses, starts, 20)
    np.testing.assert_allclose(together, [claims.motions(poses, np.array([k]), 20)[0] for k in starts], rtol=1e-12)
    unknown = Unknown(claims.held[7])
    for k in range(8, 28):
        unknown.step(between(poses[k - 1], poses[k]), claims, k)
    np.testing.assert_allclose(unknown.covariance, together[1], rtol=1e-9)
