"""The chip's point cloud: synthetic targets, walls, lost chirps, and a real capture of moving people."""

from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.points import COLUMNS, Cfar, PointCloudConfig, PointClouds
from tests.echoes import record

CONFIG = PRESETS["radarize"]
RECORDINGS = Path(__file__).parents[3] / "shared" / "recordings"


def polar(distance, azimuth=0.0, elevation=0.0):
    a, e = np.radians([azimuth, elevation])
    return distance * np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


def cloud(points, velocity=(0, 0, 0), config=CONFIG, settings=None, frames=1, valid=None, amplitude=400.0):
    """Point cloud of static points seen by a moving radar."""

    def pose(t):
        t = np.asarray(t)
        return t[..., None] * np.asarray(velocity, float), np.zeros(t.shape)

    points = np.atleast_2d(points)
    adc = record(
        config, pose, points, np.full(len(points), amplitude + 0j), np.arange(frames) * config.frame_period,
        np.random.default_rng(0), noise=5.0,
    )  # fmt: skip
    if valid is not None:
        adc[~valid] = 0
    return PointClouds(config, settings)(adc, valid)


@pytest.mark.parametrize("azimuth", [-40, -12, 0, 25])
@pytest.mark.parametrize("elevation", [-15, 0, 20])
def test_a_target_is_found_where_it_is(azimuth, elevation):
    place = polar(2.3, azimuth, elevation)
    points, frame = cloud(place)
    assert len(points) == 1 and frame.tolist() == [0]
    found = dict(zip(COLUMNS, points[0], strict=True))
    assert np.linalg.norm(points[0, :3]) == pytest.approx(2.3, abs=0.75 * CONFIG.range_resolution)
    assert found["y"] == pytest.approx(place[1], abs=2.3 / 32)  # 64 azimuth cells over two
    assert found["z"] == pytest.approx(place[2], abs=0.1)
    assert found["x"] == pytest.approx(place[0], abs=0.12)
    assert found["velocity"] == 0
    assert found["snr"] > 20


def test_a_frame_has_the_same_points_in_any_batch():
    """Bit-identical: the rounding of a joint matrix product would depend on the number of detections."""
    places = np.array([polar(*each) for each in ((1.7, 33, 4), (2.3, -25, 12), (3.1, 8, -9), (3.6, -47, 2))])
    adc = record(
        CONFIG, lambda t: (t[..., None] * [0.3, 0.1, 0], 0.2 * t), places, np.full(4, 400 + 0j),
        np.arange(7) * CONFIG.frame_period, np.random.default_rng(0), noise=5.0,
    )  # fmt: skip
    make = PointClouds(CONFIG)
    whole = make(adc)[0]
    assert len(whole) > 14
    for size in (1, 2, 3):
        parts = [make(adc[k : k + size])[0] for k in range(0, 7, size)]
        assert np.array_equal(np.concatenate(parts), whole)


@pytest.mark.parametrize("speed", [-1.5, -0.4, 0.4, 1.5])
def test_closing_is_positive_and_does_not_turn_the_target(speed):
    """Without compensation of the TDM delays, 1.5 m/s would shift it by 11 degrees."""
    points, _ = cloud(polar(2.0, 15), velocity=(speed, 0, 0))
    best = points[points[:, 4].argmax()]
    expected = speed * np.cos(np.radians(15))
    assert best[3] == pytest.approx(expected, abs=0.6 * CONFIG.velocity_resolution)
    assert np.degrees(np.arctan2(best[1], best[0])) == pytest.approx(15, abs=2.5)


def test_a_second_peak_at_the_same_range_and_speed():
    pair = [polar(2.0, -20), polar(2.0, 20)]
    points, _ = cloud(pair)
    assert sorted(np.rint(np.degrees(np.arctan2(points[:, 1], points[:, 0])) / 20)) == [-1, 1]
    only, _ = cloud(pair, settings=PointCloudConfig(second_peak=2.0))
    assert len(only) == 1


def test_clutter_removal_leaves_what_moves():
    still = PointCloudConfig(clutter_removal=True)
    assert len(cloud(polar(2.0), settings=still)[0]) == 0
    assert len(cloud(polar(2.0), velocity=(0.8, 0, 0), settings=still)[0]) > 0


def test_noise_alone_makes_hardly_any_point():
    points, _ = cloud(polar(2.0), amplitude=0.0, frames=20)
    assert len(points) < 20


def test_a_wall_is_a_line():
    """Points spread over a wall 2 m ahead, seen sideways on the move: most of the cloud lies on it."""
    rng = np.random.default_rng(1)
    wall = np.column_stack([np.full(400, 2.0), rng.uniform(-1.5, 1.5, 400), rng.uniform(-0.5, 0.5, 400)])
    points, frame = cloud(wall, velocity=(0.3, 0.9, 0), frames=4, amplitude=40.0)
    assert len(points) >= 12
    ahead = points[:, 0] + 0.3 * CONFIG.frame_period * frame
    assert np.mean(np.abs(ahead - 2.0) < 0.15) > 0.8
    # v cos(angle between): every point of a static world closes at the radar's own speed towards it.
    speed = points[:, :3] @ [0.3, 0.9, 0] / np.linalg.norm(points[:, :3], axis=1)
    assert np.median(np.abs(speed - points[:, 3])) < CONFIG.velocity_resolution


def test_lost_chirps_weigh_nothing():
    valid = np.ones((1, CONFIG.loops, 3), bool)
    valid[0, 11:14] = False
    points, _ = cloud(polar(2.0, 10), valid=valid)
    best = points[points[:, 4].argmax()]
    assert np.degrees(np.arctan2(best[1], best[0])) == pytest.approx(10, abs=2.5)


def test_two_transmitters_resolve_no_height():
    points, _ = cloud(polar(2.0, 10, 10), config=PRESETS["two-tx"])
    assert points[:, 2].tolist() == [0.0] * len(points) and len(points) >= 1


def test_frames_are_numbered():
    _, frame = cloud(polar(2.0), frames=3)
    assert frame.tolist() == [0, 1, 2]


def test_too_few_cells_are_refused():
    with pytest.raises(InputError, match="loops give 4 cells, expected at least 13"):
        PointClouds(CONFIG.model_copy(update={"loops": 4}))
    PointClouds(CONFIG.model_copy(update={"loops": 4}), PointCloudConfig(doppler_cfar=Cfar(window=1, guard=0)))


def test_moving_people_of_a_real_capture():
    """Labels of its makers: static target at 5.22 m; two people at 2.93 m, one closing at 0.5...0.8 m/s and 12...16 deg
    to the left, one receding at 0.58 m/s and 7 deg to the right (signs converted to ours)."""
    path = RECORDINGS / "xwr-moving-people" / "doppler_example_1.npy"
    if not path.exists():
        pytest.skip("needs ../shared/recordings")
    stored = np.load(path, allow_pickle=False)
    iq = np.stack([part.astype(np.uint16).view(np.int16) for part in (stored.real, stored.imag)], axis=-1)
    config = RadarConfig(
        start_frequency=77e9, slope=60.012e12, idle_time=30e-6, adc_start_time=6e-6, ramp_end_time=62e-6, samples=128,
        sample_rate=2.5e6, loops=128, frame_period=0.1, tx_order=(0, 2),
    )  # fmt: skip
    points, _ = PointClouds(config)(iq.reshape(1, 128, 2, 4, 128, 2))
    distance, azimuth = np.linalg.norm(points[:, :3], axis=1), np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    near = np.abs(distance - 2.93) < 0.3

    def some(*conditions):
        return np.any(np.all(conditions, axis=0))

    assert some(np.abs(distance - 5.22) < 0.1, points[:, 3] == 0, np.abs(azimuth + 2) < 4)
    assert some(near, np.abs(points[:, 3] - 0.65) < 0.2, np.abs(azimuth - 14) < 5)
    assert some(near, np.abs(points[:, 3] + 0.58) < 0.12, np.abs(azimuth + 7) < 5)
    assert 5 <= len(points) < 200
