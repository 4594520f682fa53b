"""What a net must not learn from: handedness, and how one radar differs from another.

All take maps as (item, frame, map, row, azimuth), in dB or, where it says so, as powers, draw from a generator on their
device, and treat each item by itself. Maps have no phases: what mismatched channels and lost chirps do is imitated by
what they do to powers.
"""

import math

import torch
from jaxtyping import Bool, Shaped
from torch import Generator, Tensor

from radarize.signal.maps import FLOOR, Maps

#: A map's cell averages about as many looks: the spread of noise about its mean.
_LOOKS = 32


Chosen = Bool[Tensor, "item 1 1 1 1"]


def chosen(maps: Maps, generator: Generator, share: float = 0.5) -> Chosen:
    """Which items something happens to."""
    return torch.rand((len(maps), 1, 1, 1, 1), generator=generator, device=maps.device) < share


def mirrored(maps: Maps) -> Maps:
    """Left is right. Velocities to the left and turns change their signs (paper, section 5)."""
    return maps.flip(4)


def receding(maps: Maps) -> Maps:
    """What closes recedes: velocities change their signs (paper, section 5). The lowest of an even number of Doppler
    bins has no partner above and, being where speeds alias, is its own."""
    return maps.flip(3).roll(1 - maps.shape[3] % 2, dims=3)


def mirrored_columns(label: Shaped[Tensor, "item row bearing"], unknown: int) -> Tensor:
    """A label of bearings -44...+43 deg, mirrored: bearing +44, which -44 becomes, was never labelled."""
    return torch.cat([torch.full_like(label[..., :1], unknown), label[..., 1:].flip(-1)], dim=-1)


def other_radar(maps: Maps, generator: Generator, doppler: bool) -> Maps:
    """The same scene (dB) by a radar of other gains, noise and channels, which loses chirps where rows are Doppler, not
    range bins; each of it for half the items."""
    power = 10 ** (maps / 10)
    for effect in (noise, mismatch, lost_chirps if doppler else range_gain):
        power = effect(power, generator, chosen(maps, generator))
    return (10 * torch.log10(power)).clamp_min(FLOOR)


def range_gain(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """On powers: gain that changes slowly over range by some dB: filters, antenna gain in elevation, exponents."""
    return power * _linear(2.0 * where * _smooth(power, 3, generator))


def noise(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """On powers: receiver noise 15 dB below to 6 dB above what an item's weakest cells have."""
    weakest = power.flatten(2)[..., ::16].quantile(0.1, dim=2).amin(dim=1)[:, None, None, None, None]
    level = where * weakest * _linear(_uniform(power, -15.0, 6.0, generator))
    looks = torch.randn(power.shape, generator=generator, device=power.device) / math.sqrt(_LOOKS)
    return power + level * (1 + looks).clamp_min(0.1)


def mismatch(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """On powers: antennas of unequal gain and phase: sidelobes 35 to 18 dB down at all azimuths, and a ripple over
    azimuth."""
    lobes = where * _linear(_uniform(power, -35.0, -18.0, generator)) * power.amax(dim=4, keepdim=True)
    return (power + lobes) * _linear(0.7 * where * _smooth(power, 4, generator))


def lost_chirps(power: Maps, generator: Generator, where: Chosen) -> Maps:
    """On powers: up to a fifth of the chirps lost at random: their energy spreads over all Doppler bins."""
    lost = where * _uniform(power, 0.0, 0.2, generator)
    return power + lost / (1 - lost) * power.mean(dim=3, keepdim=True)


def lost_frames(maps: Maps, generator: Generator, share: float = 0.02) -> Maps:
    """Some frames without any samples."""
    gone = torch.rand((*maps.shape[:2], 1, 1, 1), generator=generator, device=maps.device) < share
    return torch.where(gone, FLOOR, maps)


def _smooth(maps: Maps, axis: int, generator: Generator) -> Tensor:
    """A random smooth curve over an axis for each item, of standard deviation 1 on average."""
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
