"""milliEgo and RNIN in a stream: with networks that return the true displacement, the track is the true path."""

import numpy as np
import pytest
import torch

from radarize.baselines.milliego.network import MilliEgoNet
from radarize.baselines.rnin.network import RninNet
from radarize.io.errors import InputError
from radarize.io.pose import between
from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.learning.nets.weights import Header, save
from radarize.odometry.inertial import Imu
from radarize.odometry.integration import Track
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.method import Inputs, Weights
from radarize.pipeline.methods import make_odometry
from tests.baselines.walks_known import CONFIG, RATE, attitude, pose, walk
from tests.batches import batch

pytestmark = pytest.mark.usefixtures("one_thread")

FRAMES = 90


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    with Recording(walk(tmp_path_factory.mktemp("walk") / "a.h5", FRAMES)) as found:
        yield found


@pytest.fixture
def weights(tmp_path):
    """Untrained networks."""
    for net in (MilliEgoNet(3, width=4), RninNet(3, width=4)):
        header = Header(kind=net.kind, frames=3, maps=net.maps, width=4, grid=None)
        save(net, header, tmp_path / f"{net.kind}.safetensors")
    return Weights(tmp_path)


def follow(name: str, recording: Recording, weights: Weights, cuts: list[int]) -> Track:
    inputs = Inputs(recording.config, weights=weights, recording=recording)
    follower, first, parts = make_odometry(inputs, name), 0, []
    for count in cuts:
        adc, times = recording.adc(first, first + count), recording.times[first : first + count]
        parts.append(follower.update(batch(inputs.signal, adc, times)))
        first += count
    *arrays, errors = zip(*(vars(part).values() for part in parts), strict=True)
    return Track(*map(np.concatenate, arrays), ErrorModel.joined(list(errors)))


class Truth:
    """A network that returns the true displacement of consecutive frames."""

    def __init__(self, answers: np.ndarray, covariance: np.ndarray):
        self.answers, self.covariance, self.done = answers, covariance, 0

    def estimate(self, first: torch.Tensor, *_) -> tuple[torch.Tensor, torch.Tensor]:
        mean = self.answers[self.done : self.done + len(first)]
        self.done += len(first)
        return torch.from_numpy(mean), torch.from_numpy(self.covariance).expand(len(mean), -1, -1)


def true_track() -> np.ndarray:
    """Planar poses seen from the first one."""
    found = planar(pose(np.arange(FRAMES) * CONFIG.frame_period + CONFIG.burst_center))
    return between(found[0], found)


@pytest.mark.parametrize("name", ["milliego", "rnin"])
def test_truth_told_is_truth_followed(name, recording, weights, monkeypatch):
    centers = recording.times + CONFIG.burst_center
    if name == "milliego":
        older, newer = (planar(pose(t)) for t in (centers - 6 * CONFIG.frame_period, centers))
        net = Truth(between(older, newer), 1e-4 * np.eye(3))
    else:
        moved = (pose(centers) - pose(centers - 30 * CONFIG.frame_period))[:, :2]
        off = Imu.of(recording).yaw(centers) - planar(pose(centers))[:, 2]
        cos, sin = np.cos(off), np.sin(off)
        turned = np.column_stack([cos * moved[:, 0] - sin * moved[:, 1], sin * moved[:, 0] + cos * moved[:, 1]])
        net = Truth(turned, 1e-4 * np.eye(2))
    header = Header(kind=name, frames=3, maps=(), width=4, grid=None)
    monkeypatch.setattr("radarize.baselines.inertial.load", lambda path, network: (net, header))
    track, truth = follow(name, recording, weights, [16] * 5 + [10]), true_track()
    # The first displacement needs an earlier frame: until then the estimate is at rest.
    late = slice(45, None)
    assert track.step[late] == pytest.approx(between(truth[44:-1], truth[45:]), abs=0.012)
    apart = between(track.pose[45], track.pose[-1]) - between(truth[45], truth[-1])
    assert np.hypot(*apart[:2]) < 0.06 and abs(apart[2]) < 0.02
    assert np.hypot(*track.velocity[late].T) == pytest.approx(2 * RATE, abs=0.15)
    assert (np.linalg.eigvalsh(track.errors.noise) > 0)[1:].all()
    assert attitude(np.zeros(1)).as_euler("ZYX")[0, 0] == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["milliego", "rnin"])
def test_batches_do_not_matter(name, recording, weights):
    tracks = [follow(name, recording, weights, cuts) for cuts in ([20], [1, 7, 12])]
    whole, parts = (vars(track) | vars(track.errors) for track in tracks)
    for field in whole.keys() - {"errors"}:
        assert parts[field] == pytest.approx(whole[field], abs=1e-6), field


def test_what_is_missing_is_named(recording, weights, tmp_path):
    with pytest.raises(InputError, match="odometry is 'rnin', which reads a recording's IMU; a live radar has none"):
        make_odometry(Inputs(CONFIG, weights=weights), "rnin")
    with Recording(walk(tmp_path / "b.h5", 3, with_imu=False)) as without:
        with pytest.raises(InputError, match="b.h5: has no /imu/time"):
            make_odometry(Inputs(CONFIG, weights=weights, recording=without), "milliego")
