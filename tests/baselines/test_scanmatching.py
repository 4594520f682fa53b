"""Odometry from scans alone, in a world whose scans are exact."""

import numpy as np
import pytest

from radarize.baselines.scan_matching.odometry import ScanMatching
from radarize.io.errors import InputError
from radarize.io.pose import between
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Signal
from radarize.signal.bearings import BEARINGS
from radarize.slam.config import SlamConfig
from tests.batches import of_scans
from tests.slam.world import ate, box, scan, walk

CONFIG = PRESETS["radarize"]
SIGNAL = Signal(CONFIG)
FAR = SlamConfig.preset("lidar")


ROOM = np.concatenate(
    [box(0, 0, 7, 6), box(2.5, 0, 3.2, 0.8), box(6, 2, 7, 3), box(3.2, 3, 3.7, 3.5), box(0, 4, 1, 4.6)]
)


@pytest.fixture(scope="module")
def way():
    """Poses, stamps and scans of a walk round a corner at 0.75 m/s, through a room that is nowhere a corridor."""
    poses = walk([[1, 1.5], [4.8, 1.5], [4.8, 4.5]], step=0.025, turn=np.radians(1.5))
    rng = np.random.default_rng(0)
    scans = np.array([scan(ROOM, pose, BEARINGS, 6.0) for pose in poses])
    scans += rng.normal(0, 0.02, scans.shape)
    return poses, np.arange(len(poses)) * CONFIG.frame_period, scans


def test_follows_walls(way):
    poses, times, scans = way
    matching = ScanMatching(FAR)
    parts = [matching.update(of_scans(SIGNAL, scans[i : i + 16], times[i : i + 16])) for i in range(0, len(times), 16)]
    pose, rate = (np.concatenate([getattr(part, name) for part in parts]) for name in ("pose", "velocity"))
    assert ate(poses, pose) < 0.03
    assert abs(np.rad2deg(between(poses[0], poses[-1])[2] - pose[-1, 2])) < 2
    straight = slice(40, 150)
    assert np.abs(rate[straight] - [0.025 / CONFIG.frame_period, 0]).mean() < 0.05
    step, spread = (
        np.concatenate(each) for each in zip(*((part.step, part.errors.noise) for part in parts), strict=True)
    )
    wrong = step[1:] - between(poses[:-1], poses[1:])
    normalised = (wrong[:, None] @ np.linalg.solve(spread[1:], wrong[:, :, None])).mean() / 3
    assert normalised < 2


def test_yaw_rates_are_integrated_without_returns(way):
    """Without returns, a yaw rate of 0.4 rad/s over two seconds gives a change of yaw of 0.8 rad. With a standard
    deviation of 1000 rad/s it has no effect, and the covariance is large."""
    frames = 61
    times = np.arange(frames) * CONFIG.frame_period
    nothing = np.full((frames, len(BEARINGS)), np.inf)

    def track(deviation: float):
        rates = np.column_stack([np.full(frames, 0.4), np.full(frames, deviation**2)])
        return ScanMatching(FAR, lambda batch: rates).update(of_scans(SIGNAL, nothing, times))

    sure, unsure = track(0.01), track(1000.0)
    assert abs(sure.pose[-1, 2] - 0.4 * times[-1]) < 0.02 * 0.4 * times[-1]
    assert abs(unsure.pose[-1, 2]) < 0.3 * 0.4 * times[-1]
    assert sure.errors.noise[-1, 2, 2] < 1e-2 * unsure.errors.noise[-1, 2, 2]


def test_batches_do_not_matter(way):
    _, times, scans = way
    whole = ScanMatching().update(of_scans(SIGNAL, scans[:50], times[:50]))
    matching = ScanMatching()
    parts = [matching.update(of_scans(SIGNAL, scans[i : i + 7], times[i : i + 7])).pose for i in range(0, 50, 7)]
    assert np.array_equal(np.concatenate(parts)[:50], whole.pose)


def test_motion_is_extrapolated_without_returns(way):
    """Without returns for half a second, motion is extrapolated and its covariance grows."""
    poses, times, scans = way
    matching = ScanMatching(FAR)
    before = matching.update(of_scans(SIGNAL, scans[:100], times[:100]))
    without = matching.update(of_scans(SIGNAL, np.full_like(scans[100:115], np.inf), times[100:115]))
    assert np.allclose(without.velocity, before.velocity[-1])
    assert without.errors.noise[-1, 0, 0] > before.errors.noise[-1, 0, 0]
    assert np.allclose(between(before.pose[-1], without.pose[-1])[:2], [15 * 0.025, 0], atol=0.05)


def test_stamps_must_ascend(way):
    _, _, scans = way
    with pytest.raises(InputError, match="expected ascending times"):
        ScanMatching().update(of_scans(SIGNAL, scans[:3], np.array([0.0, 0.1, 0.1])))
