"""The fast synthesis against a float64 brute force of the same echoes."""

import numpy as np
import pytest

from benchmarks.references.brute_force import beat, direct_sum
from benchmarks.references.rigs import Rig
from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarsim.propagation.burst import BurstClock
from radarsim.propagation.paths import Kind, Paths
from radarsim.receiver.synthesis import Synthesizer

CONFIG = PRESETS["radarize"]


def error_db(found, truth):
    return 10 * np.log10(np.sum(np.abs(found - truth) ** 2) / np.sum(np.abs(truth) ** 2))


def cloud(rng, n):
    """Point echoes all around in front, a quarter of them ghosts with different paths out and back."""
    place = rng.uniform([0.3, -2.5, -1.2], [4.2, 2.5, 1.2], (n, 3))
    points = np.repeat(place[:, None], 2, axis=1)
    points[: n // 4, 1] += rng.uniform(-1, 1, (n // 4, 3))
    amplitude = (rng.normal(size=n) + 1j * rng.normal(size=n)) / np.sum(place**2, axis=1)
    return Paths.of(Kind.POINT, points, amplitude)


FAST = Rig(velocity=(1.6, 0.5, 0.1), yaw_rate=1.5, lever=(0.3, 0.1, 0))


def test_against_brute_force():
    echoes = cloud(np.random.default_rng(1), 60)
    truth = beat(CONFIG, FAST, 0.4, echoes.points, echoes.amplitude)
    fast = Synthesizer(CONFIG)(echoes.lengths(CONFIG, FAST, 0.4), echoes.amplitude)
    assert error_db(fast, truth) < -40


def test_against_direct_sum():
    """Against a direct sum over the same path-length parabolas: error of the expansion."""
    echoes = cloud(np.random.default_rng(2), 300)
    lengths = echoes.lengths(CONFIG, FAST, 0.0)
    assert error_db(Synthesizer(CONFIG)(lengths, echoes.amplitude), direct_sum(CONFIG, lengths, echoes.amplitude)) < -60


def test_the_direct_sum_itself():
    """Error of the path-length parabolas."""
    echoes = cloud(np.random.default_rng(2), 25)
    truth = beat(CONFIG, FAST, 0.2, echoes.points, echoes.amplitude)
    assert error_db(direct_sum(CONFIG, echoes.lengths(CONFIG, FAST, 0.2), echoes.amplitude), truth) < -55


@pytest.mark.parametrize(
    "changes",
    [
        {"samples": 95, "loops": 7},
        {"tx_order": (0, 1, 2)},
        {"tx_order": (2,), "rx": (1,)},
        {"loops": 60, "samples": 64, "frame_period": 0.05},
    ],
)
def test_other_configurations(changes):
    config = RadarConfig(**{**CONFIG.model_dump(), **changes})
    echoes = cloud(np.random.default_rng(4), 12)
    truth = beat(config, FAST, 0.0, echoes.points, echoes.amplitude)
    fast = Synthesizer(config)(echoes.lengths(config, FAST, 0.0), echoes.amplitude)
    assert error_db(fast, truth) < -40


def test_images_follow_the_mirror():
    """The path of a mirror image is |tx - M rx|: equal to a brute force over the specular point of a wall."""
    wall = 2.0
    matrix = np.diag([-1.0, 1, 1])
    image = np.concatenate([matrix, [[2 * wall], [0], [0]]], axis=1)[None]
    echoes = Paths.of(Kind.IMAGE, image, np.ones(1, complex))
    lengths = echoes.lengths(CONFIG, FAST, 0.1)
    clock = BurstClock.of(CONFIG)
    for s in (-0.9, 0.3, 1.0):
        at = np.array([0.1 + clock.middle + s * clock.half])
        position, rotation = FAST.position(at)[0], FAST.rotation(at).as_matrix()[0]
        tx = position + tx_positions(CONFIG)[2] @ rotation.T
        rx = position + rx_positions(CONFIG)[1] @ rotation.T
        share = (wall - tx[0]) / (2 * wall - tx[0] - rx[0])
        specular = np.array([wall, *(tx[1:] + share * (rx[1:] - tx[1:]))])
        truth = np.linalg.norm(tx - specular) + np.linalg.norm(rx - specular)
        parabola = lengths[0, 2 * 4 + 1]
        assert parabola @ [1, s, s * s] == pytest.approx(truth, abs=2e-6)


def test_silence_without_echoes():
    echoes = cloud(np.random.default_rng(0), 0)
    signal = Synthesizer(CONFIG)(echoes.lengths(CONFIG, Rig(), 0.0), echoes.amplitude)
    assert signal.shape == (32, 3, 4, 96) and not signal.any()
