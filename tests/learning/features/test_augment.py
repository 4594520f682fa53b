"""Augmentations: all signs occur, and nothing else changes."""

import numpy as np
import pytest
import torch

from radarize.learning.features import augment
from radarize.learning.task import find_task
from radarize.signal.bearings import BEARINGS
from radarize.signal.depthlabel import FREE, SURFACE, UNKNOWN
from radarize.signal.maps import AZIMUTHS, FLOOR
from tests.learning.training.ridges import CONFIG, ridge, walls

VELOCITY = np.array([[0.7, 0.4]])


def items(values: np.ndarray) -> torch.Tensor:
    """Maps (frame, row, azimuth) as (item, 1 frame, 1 map, row, azimuth)."""
    return torch.as_tensor(values, dtype=torch.float32)[:, None, None]


def test_a_mirrored_ridge_is_the_ridge_of_the_mirrored_velocity():
    assert torch.allclose(augment.mirrored(items(ridge(VELOCITY))), items(ridge(VELOCITY * (1, -1))), atol=1e-4)


@pytest.mark.parametrize("loops", [16, 17])
def test_a_receding_ridge_is_the_ridge_of_the_velocity_backwards(loops):
    config = CONFIG.model_copy(update={"loops": loops})
    found = augment.receding(items(ridge(VELOCITY, config)))
    assert torch.allclose(found[..., 1:, :], items(ridge(-VELOCITY, config))[..., 1:, :], atol=1e-4)


def test_labels_follow_their_maps():
    """The wall of the mirrored map, at every bearing that has a mirror image."""
    label = torch.as_tensor(walls(3, np.random.default_rng(0))[1])
    found = augment.mirrored_columns(label, UNKNOWN)
    for k in range(1, len(BEARINGS)):
        mirror = int(np.argmin(np.abs(BEARINGS + BEARINGS[k])))
        assert BEARINGS[mirror] == pytest.approx(-BEARINGS[k])
        assert torch.equal(found[..., k], label[..., mirror])
    assert (found[..., 0] == UNKNOWN).all()


def test_signs_of_all_tasks():
    """Augmented maps fit the augmented label, for any random numbers."""
    generator = torch.Generator().manual_seed(0)
    count = 64
    maps = items(ridge(np.repeat(VELOCITY, count, axis=0))).repeat(1, 1, 2, 1, 1)
    label = torch.tensor(VELOCITY, dtype=torch.float32).repeat(count, 1)
    found, velocity = find_task("translation").augment(maps, label, generator)
    assert len(np.unique(velocity.numpy().round(4), axis=0)) == 4
    for shown, v in zip(found[:, 0, 0], velocity, strict=True):
        signs = [(a, b) for a in (1, -1) for b in (1, -1)]
        fits = [float((shown * torch.tensor(ridge(VELOCITY * s)[0])).sum()) for s in signs]
        assert tuple(np.sign(v.numpy()).astype(int)) == signs[int(np.argmax(fits))]

    maps = torch.zeros(count, 2, 1, 16, 40)
    maps[:, 0, :, 8, 25], maps[:, 1, :, 8, 20] = 60, 60  # the echo moves to the right: the sensor turns to the left
    found, turn = find_task("rotation").augment(maps, torch.tensor([[0.2, 0.3, 0.1]]).repeat(count, 1), generator)
    moved = found[:, 0, 0, 8].argmax(dim=1) - found[:, 1, 0, 8].argmax(dim=1)
    assert torch.equal(moved.sign(), turn[:, 0].sign().long()) and len(turn[:, 0].unique()) == 2
    assert torch.allclose(turn[:, 1:].abs(), torch.tensor([0.3, 0.1]), atol=0.05)  # given with some error
    assert torch.equal(turn[:, 2].sign(), turn[:, 0].sign())  # mirrored with the maps

    shown, label = walls(count, np.random.default_rng(0))
    label = torch.as_tensor(label)
    found, changed = find_task("segmentation").augment(items(shown).repeat(1, 1, 2, 1, 1), label, generator)
    flipped = torch.tensor([not torch.equal(a, b) for a, b in zip(changed, label, strict=True)])
    assert 10 < flipped.sum() < count - 10
    column = int(np.argmin(np.abs(AZIMUTHS - BEARINGS[84])))
    nearest = found[:, 0, 0, :, column].argmax(dim=1)
    surface = (changed[:, :, 84] == SURFACE).int().argmax(dim=1)
    seen = (changed[:, :, 84] == SURFACE).any(dim=1)
    assert ((nearest - surface).abs()[seen] <= 1).float().mean() > 0.9
    assert set(changed.unique().tolist()) <= {FREE, SURFACE, UNKNOWN}


@pytest.mark.parametrize(
    ("effect", "least", "most"),
    [
        (augment.range_gain, -12, 12),
        (augment.noise, 0, 12),
        (augment.mismatch, -5, 25),
        (augment.lost_chirps, 0, 25),
    ],
)
def test_effects_are_of_their_size(effect, least, most):
    """Effects on dB: peaks move little, and added power never reduces a cell."""
    maps = items(np.repeat(ridge(VELOCITY), 50, axis=0)).repeat(1, 2, 1, 1, 1)

    def change(where: bool) -> torch.Tensor:
        chosen = torch.full((50, 1, 1, 1, 1), where)
        return 10 * torch.log10(effect(10 ** (maps / 10), torch.Generator().manual_seed(0), chosen)) - maps

    changed = change(True)
    assert change(False).abs().max() < 1e-4
    assert least - 1e-3 <= changed.min() and changed.max() <= most
    assert changed.std(dim=0).max() > 0.3
    assert torch.equal(change(True), changed)


def test_a_lost_frame_has_no_samples():
    maps = torch.zeros(1000, 3, 2, 4, 4)
    found = augment.lost_frames(maps, torch.Generator().manual_seed(0), 0.1)
    gone = (found == FLOOR).flatten(2)
    assert torch.equal(gone.any(dim=2), gone.all(dim=2))
    assert gone.float().mean() == pytest.approx(0.1, abs=0.02)
