"""Networks as estimators: which frames they are shown, and what becomes of their answers."""

import numpy as np
import pytest
import torch

from radarize.batch import Signal
from radarize.errors import InputError
from radarize.features.grid import Grid
from radarize.methods.radarize.fused import FusedVelocity
from radarize.methods.radarize.learned import LearnedRotation, LearnedVelocity
from radarize.methods.radarize.motion import RotationNet, TranslationNet
from radarize.nets.weights import Header, build, example, load, save
from radarize.odometry.doppler import Velocities
from radarize.radar.presets import PRESETS
from tests.batches import of_spectrum, parts

CONFIG = PRESETS["radarize"]
SLOW = CONFIG.model_copy(update={"frame_period": 2 * CONFIG.frame_period})
SIGNAL = Signal(CONFIG)
NETS = {net.kind: net for net in (TranslationNet, RotationNet)}
MAPS = {"translation": ("doppler_azimuth", "doppler_elevation_aware"), "rotation": ("range_azimuth",)}


def weights(folder, kind: str, **about):
    """An untrained network for frames at half the preset's rate."""
    maps = MAPS[kind]
    fields = {"spacings": (1, 2, 3, 4)} if kind == "rotation" else {}
    header = Header(kind=kind, frames=2, maps=maps, width=2, grid=Grid.of(SLOW, maps[0]), **(fields | about))
    torch.manual_seed(0)
    net = build(NETS[kind], header)
    net(*example(net, header))
    return save(net.eval(), header, folder / f"{kind}.safetensors")


def spectra(frames: int) -> torch.Tensor:
    """Frames of noise, each stronger than the one before: its maps say which one it is."""
    noise = torch.Generator().manual_seed(0)
    parts = torch.randn(frames, CONFIG.samples, CONFIG.loops, 12, 2, generator=noise)
    level = 10 ** (torch.arange(1.0, frames + 1) / 4)
    return torch.view_as_complex(parts * level[:, None, None, None, None])


def test_windows_are_frames_of_the_trained_rate(tmp_path):
    """Every second one of a radar twice as fast, however the stream is cut; before its beginning, its first."""
    everything, times = spectra(12), np.arange(12) * CONFIG.frame_period
    level = torch.from_numpy(SIGNAL.maker.of(everything, ("range_azimuth",))["range_azimuth"]).float().mean(dim=(1, 2))
    for cuts in ([12], [5, 7], [1] * 12):
        windows = load(weights(tmp_path, "rotation"), RotationNet, CONFIG)[1].windows(CONFIG)
        pushed = [windows.push(part, (1, 4)) for part in parts(SIGNAL, everything, times, cuts)]
        for k, spacing in enumerate((1, 4)):
            shown = torch.cat([part[k] for part in pushed]).mean(dim=(2, 3, 4))
            expected = [(max(0, frame - 2 * spacing), frame) for frame in range(12)]
            assert torch.allclose(shown, level[torch.tensor(expected)], atol=0.01)


def test_a_radar_of_another_rate_is_refused(tmp_path):
    odd = CONFIG.model_copy(update={"frame_period": 0.05})
    with pytest.raises(InputError, match="frame period 0.05 instead of 0.066666 or a part"):
        load(weights(tmp_path, "rotation"), RotationNet, odd)


def test_batches_do_not_matter(tmp_path):
    everything, times = spectra(10), np.arange(10) * CONFIG.frame_period
    results = []
    for cuts in ([10], [3, 1, 6]):
        velocity = LearnedVelocity(CONFIG, weights(tmp_path, "translation"))
        rotation = LearnedRotation(CONFIG, weights(tmp_path, "rotation"))
        batches = parts(SIGNAL, everything, times, cuts)
        v = [velocity.estimate(part) for part in batches]
        r = [rotation.estimate(part, found) for part, found in zip(batches, v, strict=True)]
        results.append(
            [np.concatenate(x) for x in ([p.velocity for p in v], [p.covariance for p in v], [p.yaw for p in r])]
        )
    for a, b in zip(*results, strict=True):
        assert np.allclose(a, b, atol=1e-4)


def test_silence_says_nothing(tmp_path):
    """A lost frame is no motion of its own: neither network has seen one that should have been believed."""
    zeros = torch.zeros(4, CONFIG.samples, CONFIG.loops, 12, dtype=torch.complex64)
    nothing = of_spectrum(SIGNAL, zeros, np.arange(4) * CONFIG.frame_period)
    found = LearnedVelocity(CONFIG, weights(tmp_path, "translation")).estimate(nothing)
    assert (found.velocity == 0).all() and np.allclose(found.covariance, 4 * np.eye(2))
    turns = LearnedRotation(CONFIG, weights(tmp_path, "rotation")).estimate(nothing, found)
    assert np.allclose(turns.yaw, 0)


class Oracle:
    """Answers with true turns between the frames it is shown, plus noise that it knows of."""

    def __init__(self, yaw: np.ndarray, noise: float, rng: np.random.Generator):
        self.yaw, self.noise, self.rng = torch.tensor(yaw), noise, rng

    def estimate(self, frames: torch.Tensor, travel: torch.Tensor):
        first, last = frames.long().T
        turn = self.yaw[last] - self.yaw[first] + torch.tensor(self.rng.normal(0, self.noise, len(first)))
        return turn[:, None], torch.full((len(first), 1, 1), self.noise**2)


def test_turns_of_several_spacings_make_one_yaw(tmp_path, monkeypatch):
    """Better than chains of one spacing (the paper's), and as sure of it as it may be."""
    count, noise, stride = 300, np.radians(1.0), 2
    times = np.arange(count) * CONFIG.frame_period
    truth = np.cumsum(np.radians(40) * np.sin(times) * CONFIG.frame_period)
    ends, honest, chained = [], [], []
    path, frames = weights(tmp_path, "rotation"), of_spectrum(SIGNAL, torch.zeros(count), times)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        rotation = LearnedRotation(CONFIG, path)
        rotation._net = Oracle(truth, noise, rng)
        seen = "radarize.methods.radarize.learned.silent"
        monkeypatch.setattr(seen, lambda shown: torch.zeros(len(shown), dtype=torch.bool))
        at = torch.arange(count)
        shown = [torch.stack([(at - stride * s).clamp_min(0), at], dim=1) for s in rotation.spacings]
        monkeypatch.setattr(rotation._windows, "push", lambda batch, spacings, shown=shown: shown)
        found = rotation.estimate(frames, Velocities(*np.zeros((3, count, 2))))
        error = np.cumsum(found.yaw)[-1] - (truth[-1] - truth[0])
        ends.append(error)
        honest.append(error**2 / found.variance.sum())
        chained.append(np.sqrt(count / (stride * 4)) * noise * rng.normal())
    assert np.std(ends) < np.std(chained)
    assert 0.3 < np.mean(honest) < 1.2  # below 1, for it began without knowing its rate


class Says:
    """An estimator with one answer."""

    def __init__(self, velocity, covariance):
        self.answer = Velocities(np.array([velocity]), np.array([covariance]), np.array([3]))

    def estimate(self, batch):
        return self.answer


def test_fusion_is_the_product_of_the_two():
    """Against the information form; and two that contradict each other leave more doubt than either admits."""
    a, p = np.array([1.0, 0.2]), np.array([[0.04, 0.01], [0.01, 0.09]])
    b, q = np.array([1.1, 0.1]), np.array([[0.01, 0.0], [0.0, 0.04]])
    found = FusedVelocity(Says(a, p), Says(b, q)).estimate(None)
    covariance = np.linalg.inv(np.linalg.inv(p) + np.linalg.inv(q))
    assert np.allclose(found.covariance[0], covariance)
    assert np.allclose(found.velocity[0], covariance @ (np.linalg.inv(p) @ a + np.linalg.inv(q) @ b))
    apart = FusedVelocity(Says(a, p), Says(b + 3, q)).estimate(None)
    assert np.linalg.eigvalsh(apart.covariance[0] - covariance)[0] > 5 * np.linalg.eigvalsh(covariance)[-1]
