"""Losses against their closed forms."""

import math

import pytest
import torch

from radarize.learning.nets.gaussian import Gaussian
from radarize.learning.nets.losses import cyclic, surfaces
from radarize.signal.depthlabel import FREE, SURFACE, UNKNOWN


def test_cyclic():
    """The paper's loss up to the scale: (d - f(a, b))^2 + (-d - f(b, a))^2, at standard deviations of 1."""
    both = Gaussian(torch.tensor([[0.3], [-0.1]]), torch.ones(2, 1, 1))
    d = 0.2
    assert cyclic(both, torch.tensor([[d]])).item() == pytest.approx(((d - 0.3) ** 2 + (-d + 0.1) ** 2) / 4)


def test_surfaces_are_balanced_and_what_is_unknown_does_not_count():
    label = torch.full((1, 100, 4), UNKNOWN, dtype=torch.uint8)
    label[:, :60], label[:, 60] = FREE, SURFACE
    logits = torch.zeros(1, 100, 4)
    dice = 1 - (2 * 2 + 1) / (122 + 4 + 1)  # half of 244 cells, 4 of them surface
    assert surfaces(logits, label).item() == pytest.approx(math.log(2) + dice, rel=1e-5)
    logits[:, 61:] = 9.0
    assert surfaces(logits, label).item() == pytest.approx(math.log(2) + dice, rel=1e-5)
    # All wrong about the few costs as much as all wrong about the many, Dice apart.
    few, many = logits.clone(), logits.clone()
    few[:, 60], many[:, :60] = -5.0, 5.0
    assert surfaces(few, label).item() - surfaces(many, label).item() == pytest.approx(0, abs=0.4)
    perfect = torch.where(label == SURFACE, 20.0, -20.0)
    assert surfaces(perfect, label).item() == pytest.approx(0, abs=1e-3)


def test_an_item_without_surfaces_is_no_division_by_zero():
    label = torch.zeros(1, 8, 4, dtype=torch.uint8)
    assert surfaces(torch.full((1, 8, 4), -9.0), label).item() < 0.1
    assert surfaces(torch.zeros(1, 8, 4), torch.full_like(label, UNKNOWN)).isfinite().all()
