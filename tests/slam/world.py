"""A synthetic planar world of walls with exact ray casting; and a pose graph of a lap with known truth."""

import numpy as np

from radarize.io.pose import between, compose
from radarize.slam.posegraph import PoseGraph

#: Rate (Hz) and bearings (rad) of scans of a radar.
RATE, BEARINGS = 30.0, np.radians(np.linspace(-44, 43, 88))
#: Standard deviations of a step of a lap, m and rad.
SIGMA = np.array([0.02, 0.02, 0.01])


def box(x0, y0, x1, y1):
    """Walls (4, 4: x0 y0 x1 y1) of a rectangle."""
    return np.array([[x0, y0, x1, y0], [x1, y0, x1, y1], [x1, y1, x0, y1], [x0, y1, x0, y0]], float)


def ring():
    """A square corridor with niches and columns that break its symmetry: outer side 12 m, width 3 m."""
    return np.concatenate(
        [
            box(0, 0, 12, 12),
            box(3, 3, 9, 9),
            box(5, 0, 5.6, 0.5),
            box(11.2, 4, 12, 5.1),
            box(11.5, 8.2, 12, 8.6),
            box(7, 11.3, 8.2, 12),
            box(2.5, 11.6, 3, 12),
            box(0, 7, 0.7, 7.4),
            box(0, 2.2, 0.4, 3.4),
            box(9, 2.6, 9.3, 3),
        ]
    )


def scan(walls, pose, azimuths, max_range=np.inf):
    """Distance to the first wall on every bearing, m, inf beyond max_range."""
    angles = pose[2] + azimuths
    d = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[:, None]
    a, b = walls[None, :, :2], walls[None, :, 2:]
    e, w = b - a, a - pose[:2]
    det = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (w[..., 0] * e[..., 1] - w[..., 1] * e[..., 0]) / det
        s = (w[..., 0] * d[..., 1] - w[..., 1] * d[..., 0]) / det
    t = np.where((np.abs(det) > 1e-12) & (t > 0) & (s >= 0) & (s <= 1), t, np.inf).min(axis=1)
    return np.where(t <= max_range, t, np.inf)


def walk(corners, step, turn):
    """Poses along a polyline, turning on the spot at its corners."""
    poses = []
    corners = np.asarray(corners, float)
    yaw = np.arctan2(*(corners[1] - corners[0])[::-1])
    for a, b in zip(corners[:-1], corners[1:], strict=True):
        heading = np.arctan2(*(b - a)[::-1])
        swing = (heading - yaw + np.pi) % (2 * np.pi) - np.pi
        for k in range(1, int(np.ceil(abs(swing) / turn)) + 1):
            poses.append([*a, yaw + swing * k / np.ceil(abs(swing) / turn)])
        yaw = heading
        count = int(np.ceil(np.hypot(*(b - a)) / step))
        poses += [[*(a + (b - a) * k / count), yaw] for k in range(count)]
    return np.array([*poses, [*corners[-1], yaw]])


def play(slam, walls, poses, rng, share=0.03, floor=1e-5, bearings=BEARINGS):
    """Add scans of 4.3 m along poses, and odometry whose steps have errors of a share plus a floor (m, rad); returns
    its last pose."""
    odometry = poses[0]
    for k, (before, pose) in enumerate(zip(poses[[0, *range(len(poses) - 1)]], poses, strict=True)):
        step = between(before, pose)
        sigma = share * np.abs(step) + floor
        odometry = compose(odometry, step + rng.normal(0, sigma))
        slam.add_odometry(k / RATE, odometry, np.diag(sigma**2))
        slam.add_scan(k / RATE, bearings, scan(walls, pose, bearings, 4.28) + rng.normal(0, 0.02, len(bearings)))
    return odometry


def align(truth, estimate):
    """Rotation (2, 2) and shift of the best rigid alignment of estimated with true positions."""
    p, q = truth[:, :2], estimate[:, :2]
    u, _, vt = np.linalg.svd((p - p.mean(0)).T @ (q - q.mean(0)))
    turn = u @ np.diag([1, np.linalg.det(u @ vt)]) @ vt
    return turn, p.mean(0) - turn @ q.mean(0)


def ate(truth, estimate):
    """Absolute trajectory error: mean distance after the best rigid alignment, m."""
    turn, shift = align(truth, estimate)
    return float(np.hypot(*(estimate[:, :2] @ turn.T + shift - truth[:, :2]).T).mean())


def lap(false, seed=7):
    """A pose graph with 201 nodes on two laps of a square with sides of 25 m: noisy odometry, ten true and some false
    closures."""
    rng = np.random.default_rng(seed)
    truth = [np.zeros(3)]
    for k in range(200):
        truth.append(compose(truth[-1], np.array([1.0, 0, np.pi / 2 if k % 25 == 24 else 0.0])))
    truth = np.array(truth)
    graph = PoseGraph()
    graph.add_node(truth[0])
    for k in range(200):
        step = between(truth[k], truth[k + 1]) + rng.normal(0, SIGMA)
        graph.add_node(compose(graph.poses[-1], step))
        graph.add_motion(k, k + 1, step, np.diag(SIGMA**2))
    for k in range(10):
        i = 5 + 9 * k
        graph.add_closure(i, i + 100, between(truth[i], truth[i + 100]) + rng.normal(0, 0.03, 3), np.eye(3) * 0.03**2)
    for i, j in [(10, 60), (30, 180), (55, 85), (3, 140), (20, 70)][:false]:
        graph.add_closure(i, j, np.array([0.3, -0.2, 0.1]), np.eye(3) * 0.03**2)
    odometry = ate(truth, np.array(graph.poses))
    return graph, truth, odometry
