"""Networks as estimators: which frames are their input, and how their outputs are used."""

from functools import partial

import numpy as np
import pytest
import torch

from radarize.io.errors import InputError
from radarize.learning.features.grid import MapGrid, Resampling
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.learning.nets.weights import Header, build, example, load, save
from radarize.odometry.doppler import Velocities
from radarize.odometry.fused import FusedVelocity
from radarize.odometry.learned import LearnedRotation, LearnedVelocity
from radarize.odometry.settings import FusionConfig, TurnConfig
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Batch, Signal
from radarize.signal.maps import MapMaker
from tests.batches import of_spectrum, parts

CONFIG = PRESETS["radarize"]
SLOW = CONFIG.model_copy(update={"frame_period": 2 * CONFIG.frame_period})
SIGNAL = Signal(CONFIG)
NETS = {net.kind: net for net in (TranslationNet, RotationNet)}
MAPS = {"translation": ("doppler_azimuth", "doppler_elevation_aware"), "rotation": ("range_azimuth",)}


def weights(folder, kind: str, **about):
    """An untrained network for frames at half the preset's frame rate."""
    maps = MAPS[kind]
    fields = {"spacings": (1, 2, 3, 4)} if kind == "rotation" else {}
    header = Header(kind=kind, frames=2, maps=maps, width=2, grid=MapGrid.of(SLOW, maps[0]), **(fields | about))
    torch.manual_seed(0)
    net = build(NETS[kind], header)
    net(*example(net, header))
    return save(net.eval(), header, folder / f"{kind}.safetensors")


def spectra(frames: int) -> torch.Tensor:
    """Frames of noise with ascending power, which identifies each frame in the maps."""
    noise = torch.Generator().manual_seed(0)
    parts = torch.randn(frames, CONFIG.samples, CONFIG.loops, 12, 2, generator=noise)
    level = 10 ** (torch.arange(1.0, frames + 1) / 4)
    return torch.view_as_complex(parts * level[:, None, None, None, None])


def test_windows_are_frames_of_the_trained_rate(tmp_path):
    """The network gets every second frame of a radar with twice the frame rate, in batches of any size; windows before
    the start repeat the first frame."""
    everything, times = spectra(12), np.arange(12) * CONFIG.frame_period
    level = torch.from_numpy(SIGNAL.maker.of(everything, ("range_azimuth",))["range_azimuth"]).float().mean(dim=(1, 2))
    for cuts in ([12], [5, 7], [1] * 12):
        windows = load(weights(tmp_path, "rotation"), RotationNet, CONFIG)[1].windows(CONFIG, MapMaker, (1, 4))
        batches = parts(SIGNAL, everything, times, cuts)
        pushed = [windows.push(batch.maps(windows.maps), batch.stamps) for batch in batches]
        for k, spacing in enumerate((1, 4)):
            shown = torch.cat([part[k].maps for part in pushed]).mean(dim=(2, 3, 4))
            whole = np.concatenate([part[k].whole for part in pushed])
            assert (whole == (np.arange(12) >= 2 * spacing)).all()
            expected = [(max(0, frame - 2 * spacing), frame) for frame in range(12)]
            assert torch.allclose(shown, level[torch.tensor(expected)], atol=0.01)


@pytest.mark.parametrize(
    ("period", "spacings"), [(0.02, (3, 7, 13)), (0.033333, (2, 4, 8)), (0.05, (1, 3, 5)), (0.15, (1, 2)), (0.3, (1,))]
)
def test_windows_of_other_rates_last_as_long(tmp_path, period, spacings):
    """For a network trained on 1, 2 and 4 frames of 67 ms; each spacing occurs once."""
    header = load(weights(tmp_path, "rotation"), RotationNet)[1]
    radar = CONFIG.model_copy(update={"frame_period": period})
    assert header.windows(radar, MapMaker, (1, 2, 4)).spacings == spacings


def test_a_frame_period_longer_than_any_spacing_is_refused(tmp_path):
    slow = CONFIG.model_copy(update={"frame_period": 0.5})
    with pytest.raises(InputError, match=r"which has a frame period of 0.5 s, expected at most 0.427 s"):
        load(weights(tmp_path, "rotation"), RotationNet, slow)


def test_maps_of_other_chirps_are_resampled(tmp_path):
    """The same echoes are in the same cells, see tests/learning/features/test_resampling.py."""
    fine = CONFIG.model_copy(update={"samples": 192, "sample_rate": 2 * CONFIG.sample_rate, "loops": 40})
    signal, header = Signal(fine), load(weights(tmp_path, "translation"), TranslationNet, fine)[1]
    noise = torch.randn((3, 192, 40, 12), dtype=torch.complex64, generator=torch.Generator().manual_seed(0))
    made = signal.maker.of(noise, MAPS["translation"])
    (shown,) = header.windows(fine, MapMaker).push(made, fine.frame_period * np.arange(3))
    assert shown.maps.shape == (3, 2, 2, CONFIG.loops, 80)
    resampling = Resampling(header.grid, MapGrid.of(fine, "doppler_azimuth"), centred=True)
    both = torch.stack([torch.from_numpy(made[name]) for name in MAPS["translation"]], dim=1).float()
    assert torch.equal(shown.maps[:, -1], resampling(both))


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


def test_maps_are_computed_only_for_requested_frames(tmp_path):
    """Maps are computed for the requested frames and their windows; the estimates are the same as for requests of all
    frames."""
    everything, times = spectra(12), np.arange(12) * CONFIG.frame_period
    requested = np.isin(np.arange(12), (0, 5, 6, 11))
    always = LearnedVelocity(CONFIG, weights(tmp_path, "translation")).estimate(of_spectrum(SIGNAL, everything, times))
    for cuts, expected in (([1] * 12, [0, 3, 4, 5, 6, 9, 10, 11]), ([4, 3, 2, 3], range(12)), ([1, 1, 10], range(12))):
        on_request, made, found = LearnedVelocity(CONFIG, weights(tmp_path, "translation")), [], []
        wanted = np.split(requested, np.cumsum(cuts)[:-1])
        for batch, some in zip(parts(SIGNAL, everything, times, cuts), wanted, strict=True):
            batch.maps = partial(noted, made, batch.maps, batch.stamps)
            found.append(on_request.estimate(batch, some))
        assert np.allclose(made, times[list(expected)])
        seen, velocity = (np.concatenate([getattr(each, what) for each in found]) for what in ("seen", "velocity"))
        assert (seen == requested & always.seen).all() and seen.sum() == 3  # the first frame has no whole window
        assert np.allclose(velocity[seen], always.velocity[seen], atol=1e-4) and np.ptp(velocity[seen, 0]) > 1e-3


def noted(made: list, maps, stamps: np.ndarray, names: tuple[str, ...]) -> dict:
    made.extend(stamps)
    return maps(names)


def numbered(numbers: np.ndarray, times: np.ndarray) -> Batch:
    """Frames whose maps hold their frame index."""
    batch = of_spectrum(SIGNAL, numbers, times)
    batch.maps = lambda names: {name: np.asarray(numbers, np.float32)[:, None, None] for name in names}
    return batch


class Oracle:
    """Network that returns true velocities, or the mean and variance of yaw increments given measurements with noise
    and the distribution of turns in training; for windows with an untrained spacing wrong values with a small
    variance."""

    def __init__(self, times: np.ndarray, truth: np.ndarray, noise: float, rng: np.random.Generator):
        self.times, self.truth, self.noise, self.rng = times, truth, noise, rng

    def estimate(self, maps: torch.Tensor, travel: torch.Tensor | None = None):
        first, last = maps[:, :, 0, 0, 0].long().numpy().T
        apart = (self.times[last] - self.times[first]) / SLOW.frame_period
        known = (abs(apart - apart.round()) < 0.01) & (0.5 < apart) & (apart < 4.5)
        if travel is None:
            mean = np.where(known[:, None], self.truth[last], -3.0)
            return torch.tensor(mean), torch.eye(2).double().repeat(len(mean), 1, 1) * self.noise**2
        turn = self.truth[last] - self.truth[first] + self.rng.normal(0, self.noise, len(first))
        prior = (TurnConfig().trained * apart * SLOW.frame_period) ** 2
        weight = prior / (prior + self.noise**2)
        mean, variance = np.where(known, weight * turn, -0.5), weight * self.noise**2
        return torch.tensor(mean)[:, None], torch.tensor(variance)[:, None, None]


def nowhere(count: int) -> Velocities:
    return Velocities(np.zeros((count, 2)), np.zeros((count, 2, 2)), np.zeros(count, int), np.ones(count, bool))


def test_increments_of_several_spacings_are_fused(tmp_path):
    """The error is smaller than that of chains of one spacing (the paper), and the covariance consistent."""
    count, noise, stride = 300, np.radians(1.0), 2
    times = np.arange(count) * CONFIG.frame_period
    truth = np.cumsum(np.radians(40) * np.sin(times) * CONFIG.frame_period)
    ends, nees, chained = [], [], []
    path = weights(tmp_path, "rotation")
    for seed in range(40):
        rng = np.random.default_rng(seed)
        rotation = LearnedRotation(
            CONFIG, path, TurnConfig(variance_factor=1)
        )  # the errors of the oracle are independent
        rotation._net = Oracle(times, truth, noise, rng)
        found = rotation.estimate(numbered(np.arange(count), times), nowhere(count))
        error = np.cumsum(found.yaw)[-1] - (truth[-1] - truth[0])
        ends.append(error)
        nees.append(error**2 / found.noise.sum())
        chained.append(np.sqrt(count / (stride * 4)) * noise * rng.normal())
    assert np.std(ends) < np.std(chained)
    assert 0.3 < np.mean(nees) < 1.2  # below 1, as the initial rate is unknown


def test_the_prior_of_training_is_removed(tmp_path):
    """A posterior mean is drawn to zero, a measurement is not: yaw increments have the scale and the noise of the
    measurement."""
    count, noise, rate = 400, np.radians(0.8), np.radians(50)
    times = np.arange(count) * CONFIG.frame_period
    rotation = LearnedRotation(CONFIG, weights(tmp_path, "rotation"))
    rotation._net = Oracle(times, rate * times, noise, np.random.default_rng(0))
    turns, back = rotation.turns(numbered(np.arange(count), times), nowhere(count))
    whole = back > 0
    error = turns[..., 0][whole] - rate * back[whole] * CONFIG.frame_period
    assert abs(error.mean()) < 4 * noise / np.sqrt(whole.sum())
    assert error.std() == pytest.approx(noise, rel=0.1)
    assert np.allclose(turns[..., 1][whole], noise**2)


def test_correlated_errors_add_up(tmp_path):
    """The network estimates 2 % too little of each yaw increment: the factor on the variance covers the error over 10
    s."""
    count, noise = 300, np.radians(0.5)
    times = np.arange(count) * CONFIG.frame_period
    nees = []
    for factor in (1, 4):
        rotation = LearnedRotation(CONFIG, weights(tmp_path, "rotation"), TurnConfig(variance_factor=factor))
        rotation._net = Oracle(times, 0.98 * np.radians(60) * times, noise, np.random.default_rng(0))
        found = rotation.estimate(numbered(np.arange(count), times), nowhere(count))
        error = found.yaw.sum() - np.radians(60) * (times[-1] - times[0])
        nees.append(error**2 / found.noise[4:].sum())
    assert nees[0] / nees[1] == pytest.approx(4) and nees[0] > 4


@pytest.mark.parametrize("rate", np.radians([40, -70]))
def test_a_gap_of_a_second_is_predicted(tmp_path, rate):
    """Windows across the gap are not used: the yaw is predicted with the rate, and its variance is that of the
    prediction."""
    kept = np.r_[0:60, 90:150]
    times = kept * CONFIG.frame_period
    rotation = LearnedRotation(CONFIG, weights(tmp_path, "rotation"))
    rotation._net = Oracle(times, rate * times, np.radians(0.5), np.random.default_rng(0))
    found = rotation.estimate(numbered(np.arange(120), times), nowhere(120))
    over = rate * (times[60] - times[59])
    spread = np.sqrt(found.noise[60])
    assert abs(found.yaw[60] - over) < 3 * spread and np.radians(20) < spread < np.radians(60)
    assert np.degrees(found.yaw[60]) == pytest.approx(np.degrees(over), abs=25)
    assert not found.seen[60:62].any() and found.seen[2:60].all() and found.seen[62:].all()
    # No later yaw increment corrects the error of the gap's.
    assert np.degrees(np.abs(found.yaw[61:] - rate * CONFIG.frame_period)).max() < 4
    assert np.degrees(found.yaw[75:].sum()) == pytest.approx(np.degrees(rate * (times[-1] - times[74])), abs=2)


def test_a_lost_frame_is_in_no_window(tmp_path):
    """At twice the trained frame rate a window takes every second frame, so the window of the frame two later lacks
    one."""
    kept = np.r_[0:10, 11:20]
    times = kept * CONFIG.frame_period
    truth = np.stack([np.full(19, 1.0), np.zeros(19)], axis=1)
    for cuts in ([19], [9, 3, 7]):
        velocity = LearnedVelocity(CONFIG, weights(tmp_path, "translation"))
        velocity._net = Oracle(times, truth, 0.01, np.random.default_rng(0))
        parts = [
            velocity.estimate(numbered(rows, times[rows])) for rows in np.split(np.arange(19), np.cumsum(cuts)[:-1])
        ]
        seen = np.concatenate([part.seen for part in parts])
        assert (kept[~seen] == [0, 1, 12]).all()
        assert np.allclose(np.concatenate([part.velocity for part in parts])[seen], [1.0, 0.0])
        unknown = np.concatenate([part.covariance for part in parts])[~seen]
        assert (np.linalg.eigvalsh(unknown) > 1.0).all()


class FixedVelocity:
    """Estimator with given velocities."""

    lever, limit = 0.0, 10.0

    def __init__(self, velocity, covariance, seen=True):
        velocity = np.atleast_2d(velocity)
        count = len(velocity)
        self.answer = Velocities(
            velocity, np.tile(covariance, (count, 1, 1)), np.full(count, 3), np.full(count, seen, bool)
        )

    def estimate(self, batch, requested=None):
        return self.answer


A, P = np.array([1.0, 0.2]), np.array([[0.04, 0.01], [0.01, 0.09]])
B, Q = np.array([1.1, 0.1]), np.array([[0.01, 0.0], [0.0, 0.04]])


def test_fusion_of_independent_estimates_is_the_product():
    """Compared with the information form; the covariance is inflated if two estimates contradict each other."""
    alone = FusionConfig(correlation=0.0)
    found = FusedVelocity(FixedVelocity(A, P), FixedVelocity(B, Q), alone).estimate(None)
    covariance = np.linalg.inv(np.linalg.inv(P) + np.linalg.inv(Q))
    assert np.allclose(found.covariance[0], covariance)
    assert np.allclose(found.velocity[0], covariance @ (np.linalg.inv(P) @ A + np.linalg.inv(Q) @ B))
    apart = FusedVelocity(FixedVelocity(A, P), FixedVelocity(B + 3, Q), alone).estimate(None)
    assert np.linalg.eigvalsh(apart.covariance[0] - covariance)[0] > 5 * np.linalg.eigvalsh(covariance)[-1]


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6])
def test_fusion_of_correlated_errors_is_consistent(correlation):
    rng, count = np.random.default_rng(0), 4000
    same, one, other = rng.normal(size=(3, count, 2))
    one, other = (np.sqrt(correlation) * same + np.sqrt(1 - correlation) * own for own in (one, other))
    estimators = FixedVelocity(one @ np.linalg.cholesky(P).T, P), FixedVelocity(other @ np.linalg.cholesky(Q).T, Q)
    found = FusedVelocity(*estimators, FusionConfig(correlation=correlation, gate=100)).estimate(None)
    error = found.velocity[:, :, None]
    nees = (error.mT @ np.linalg.solve(found.covariance, error)).mean() / 2
    assert nees == pytest.approx(1, abs=0.04)


def test_fusion_ignores_the_network_beyond_its_speed_limit():
    """At 10.5 m/s a network with a limit of 10 m/s returns a velocity with a small covariance."""
    fast = [10.5, 0.0]
    found = FusedVelocity(FixedVelocity([0.3, 0.1], 1e-4 * np.eye(2)), FixedVelocity(fast, Q)).estimate(None)
    assert np.allclose(found.velocity[0], fast, atol=0.06)
    assert (np.linalg.eigvalsh(found.covariance[0]) > 0.9 * np.diag(Q)).all()


def test_fusion_with_an_unobservable_velocity_is_the_other():
    nothing = FixedVelocity([0.0, 0.0], 4 * np.eye(2), seen=False)
    for pair in ((nothing, FixedVelocity(B, Q)), (FixedVelocity(B, Q), nothing)):
        found = FusedVelocity(*pair).estimate(None)
        assert found.seen[0] and np.allclose(found.velocity[0], B, atol=0.02)
    assert not FusedVelocity(nothing, nothing).estimate(None).seen[0]
