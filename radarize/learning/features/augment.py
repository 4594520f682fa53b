"""Augmentation of maps: mirrored scenes, and differences between radars, from which a network should not learn.

All functions take maps as (item, frame, map, row, azimuth), in dB or, if stated, as powers, use a generator on their
device, and treat each item separately. Maps have no phases, so mismatched channels and lost chirps are imitated by
their effect on powers.
"""

import math

import torch
from jaxtyping import Bool, Shaped
from torch import Generator, Tensor

from radarize.signal.maps import FLOOR, Maps

#: Number of independent samples averaged in a cell of a map, which determines the spread of noise about its mean.
_LOOKS = 32


Chosen = Bool[Tensor, "item 1 1 1 1"]


def chosen(maps: Maps, generator: Generator, share: float = 0.5) -> Chosen:
    """Choose the items to change."""
    return torch.rand((len(maps), 1, 1, 1, 1), generator=generator, device=maps.device) < share


def mirrored(maps: Maps) -> Maps:
    """Mirror left and right. Leftward velocities and rotations change sign (paper, section 5)."""
    return maps.flip(4)


def receding(maps: Maps) -> Maps:
    """Reverse closing speeds: velocities change sign (paper, section 5). With an even number of Doppler bins, the
    lowest bin, where speeds alias, stays in place."""
    return maps.flip(3).roll(1 - maps.shape[3] % 2, dims=3)


def mirrored_columns(label: Shaped[Tensor, "item row bearing"], unknown: int) -> Tensor:
    """Mirror a label of bearings -44 to +43 deg; bearing +44, which -44 becomes, has no label."""
    return torch.cat([torch.full_like(label[..., :1], unknown), label[..., 1:].flip(-1)], dim=-1)


def other_radar(maps: Maps, generator: Generator, doppler: bool) -> Maps:
    """Imitate the same scene (dB) seen by a radar with other gains, noise and channels, and with lost chirps if rows
    are Doppler bins; each effect for half of the items."""
    power = 10 ** (maps / 10)
    for effect in (noise, mismatch, lost_chirps if doppler else range_gain):
        power = effect(power, generator, chosen(maps, generator))
    return (10 * torch.log10(power)).clamp_min(FLOOR)


def range_gain(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """Change powers by a gain that varies slowly over range by a few dB, as from filters and antenna gain in
    elevation."""
    return power * _linear(2.0 * where * _smooth(power, 3, generator))


def noise(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """Add receiver noise to powers, 15 dB below to 6 dB above an item's weakest cells."""
    weakest = power.flatten(2)[..., ::16].quantile(0.1, dim=2).amin(dim=1)[:, None, None, None, None]
    level = where * weakest * _linear(_uniform(power, -15.0, 6.0, generator))
    looks = torch.randn(power.shape, generator=generator, device=power.device) / math.sqrt(_LOOKS)
    return power + level * (1 + looks).clamp_min(0.1)


def mismatch(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """Change powers as by antennas of unequal gain and phase: sidelobes at -35 to -18 dB at all azimuths, and a ripple
    over azimuth."""
    lobes = where * _linear(_uniform(power, -35.0, -18.0, generator)) * power.amax(dim=4, keepdim=True)
    return (power + lobes) * _linear(0.7 * where * _smooth(power, 4, generator))


def lost_chirps(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """Change powers as by up to a fifth of the chirps lost at random: their energy spreads over all Doppler bins."""
    lost = where * _uniform(power, 0.0, 0.2, generator)
    return power + lost / (1 - lost) * power.mean(dim=3, keepdim=True)


def lost_frames(maps: Maps, generator: Generator, share: float = 0.02) -> Maps:
    """Replace some frames by frames without samples."""
    gone = torch.rand((*maps.shape[:2], 1, 1, 1), generator=generator, device=maps.device) < share
    return torch.where(gone, FLOOR, maps)


def _smooth(maps: Maps, axis: int, generator: Generator) -> Tensor:
    """Return a random smooth curve over an axis for each item, with a mean standard deviation of 1."""
    size = maps.shape[axis]
    orders = torch.arange(1, 4, device=maps.device)
    waves = torch.cos(math.pi * orders[:, None] * torch.arange(size, device=maps.device) / max(size - 1, 1))
    weights = torch.randn((len(maps), len(orders)), generator=generator, device=maps.device)
    curve = weights @ (waves / math.sqrt(len(orders) / 2))
    shape = [len(maps), 1, 1, 1, 1]
    shape[axis] = size
    return curve.reshape(shape)


def _uniform(maps: Maps, low: float, high: float, generator: Generator) -> Tensor:
    return low + (high - low) * torch.rand((len(maps), 1, 1, 1, 1), generator=generator, device=maps.device)


def _linear(decibels: Tensor) -> Tensor:
    return 10 ** (decibels / 10)
