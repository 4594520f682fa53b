"""Augmentation of simulated pictures by random properties of real boards and rooms, so that networks do not rely on
their absence.

Real boards have channel errors, and real walls are less flat and real rooms less empty than simulated ones. The signals
of four antennas are changed at random: gains and phases of channels, a limit of the level of specular reflections,
additional echoes, a gain that varies over range, and noise. A picture is then computed as RadarHD does, except that it
keeps a random share of its cells, of which some are deleted.
"""

from collections.abc import Callable

import torch
from jaxtyping import Complex64, Float
from torch import Generator, Tensor
from torch.nn.functional import interpolate

from radarize.baselines.pictures.maps import BINS
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from radarize.signal.maps import Maps

#: Channel errors: standard deviation of gains, dB; maximum standard deviation of phases, rad; maximum sine of the yaw
#: of the mounting.
GAIN, PHASE, YAW = 0.5, 0.15, 0.02
#: Limit of the level of specular reflections, dB relative to the frame's maximum.
CEILING = (-5.0, 15.0)
#: Additional echoes: maximum number; levels, dB relative to the frame's maximum; standard deviations of their motion
#: between frames, range bins and sine of azimuth.
ADDED, LEVELS, WANDER = 8, (-45.0, -15.0), (2.0, 0.02)
#: Gain over range: maximum slope at either end, dB; maximum standard deviation of random patches, dB; number of
#: patches. Noise relative to the frame's maximum, dB.
TILT, PATCHY, PATCHES, NOISE = 2.0, 1.0, 32, (-60.0, -40.0)
#: Deleted blocks of pixels, one row high: maximum share, and columns per block.
MISSING, BLOCK = 0.1, 8
#: Share of pixels that are kept: wider than the range of the training walks, 6 to 14 %.
KEPT = (0.02, 0.18)
#: Level of pixels without a cell of the radar, dB relative to the maximum.
FLOOR = -90.0

Draw = Callable[..., Tensor]
Heard = Complex64[Tensor, "item frame range antenna"]


def rough(antennas: Maps, generator: Generator) -> Float[Tensor, "item frame 1 range column"]:
    """Compute pictures with random properties of board and room.

    Args:
        antennas: the map `antennas` of `PictureMaker`.
        generator: random number generator on the device of the maps.
    """

    def draw(low: float, high: float, *shape: int) -> Tensor:
        return uniform(generator, low, high, len(antennas), *shape)

    def normal(*shape: int) -> Tensor:
        return torch.randn((len(antennas), *shape), generator=generator, device=generator.device)

    heard = antennas_of(antennas)
    heard = _dimmed(heard, draw(*CEILING, 1, 1))
    heard = heard + _largest(heard) * _added(heard.shape[1], draw, normal)
    gain = draw(0.0, PATCHY, 1, 1) * interpolate(normal(1, PATCHES), size=BINS, mode="linear")
    gain = gain + draw(-TILT, TILT, 1, 1) * torch.linspace(-1, 1, BINS, device=gain.device)
    heard = heard * _amplitude(gain)[..., None]
    noise = torch.view_as_complex(normal(*heard.shape[1:], 2))
    heard = heard + _largest(heard) * _amplitude(draw(*NOISE, 1, 1, 1)) * noise
    heard = heard * _board(draw, normal)[:, None, None]
    level = levels(heard)
    blocks = draw(0.0, 1.0, *level.shape[1:3], polar.COLUMNS // BLOCK) < draw(0.0, MISSING, 1, 1, 1)
    return kept(level.masked_fill(blocks.repeat_interleave(BLOCK, dim=3), FLOOR), generator)


def uniform(generator: Generator, low: float, high: float, *shape: int) -> Tensor:
    """Draw uniform random numbers on the generator's device."""
    return low + (high - low) * torch.rand(shape, generator=generator, device=generator.device)


def kept(level: Float[Tensor, "item frame row column"], generator: Generator) -> Maps:
    """Keep a random share of the pixels. The threshold follows from the newest frame and applies to all frames."""
    newest = (level[:, -1] - level[:, -1].amax(dim=(1, 2), keepdim=True)).flatten(1).sort(dim=1, descending=True).values
    share = uniform(generator, *KEPT, len(level), 1)
    threshold = newest.gather(1, (share * newest.shape[1]).long())[:, :, None, None]
    return picture(level, threshold.clamp(-50.0, -15.0))[:, :, None]


def antennas_of(maps: Maps) -> Heard:
    """Return complex antenna signals from the map `antennas` of `PictureMaker`."""
    return torch.view_as_complex(maps[:, :, 0].float().unflatten(3, (-1, 2)))


def levels(heard: Heard) -> Float[Tensor, "item frame row column"]:
    """Compute polar pictures without a threshold, dB relative to the maximum; `FLOOR` in pixels without a cell."""
    spectrum = torch.fft.fft(heard, polar.COLUMNS, dim=3).transpose(2, 3)
    magnitude = torch.fft.fftshift(spectrum, dim=2).abs()
    largest = magnitude[..., polar.LEAKAGE :].amax(dim=(2, 3), keepdim=True).clamp_min(1e-30)
    share = 20 * torch.log10((magnitude / largest).clamp_min(1e-4))
    inside = polar.cells(PRESETS["radarhd"])
    sine, bins = (torch.from_numpy(each).to(heard.device) for each in divmod(inside.cell, PRESETS["radarhd"].samples))
    pixel = torch.from_numpy(inside.pixel).to(heard.device)
    found = share.new_full((*heard.shape[:2], polar.ROWS * polar.COLUMNS), FLOOR)
    found = found.scatter_reduce(2, pixel.expand(*heard.shape[:2], -1), share[:, :, sine, bins], "amax")
    return found.unflatten(2, (polar.ROWS, polar.COLUMNS))


def picture(
    level: Float[Tensor, "item frame row column"], threshold: Float[Tensor, "item 1 1 1"]
) -> Float[Tensor, "item frame row column"]:
    """Scale levels to 0...255, from the least to the largest of those above `threshold` (dB relative to the
    maximum)."""
    level = level - level.amax(dim=(2, 3), keepdim=True)
    kept = level >= threshold
    least = torch.where(kept, level, torch.zeros_like(level)).amin(dim=(2, 3), keepdim=True)
    return torch.where(kept, (255 * (1 - level / least.clamp_max(-1e-3))).floor(), torch.zeros_like(level))


def _amplitude(decibels: Tensor) -> Tensor:
    return 10 ** (decibels / 20)


def _largest(heard: Heard) -> Float[Tensor, "item frame 1 1"]:
    return heard[:, :, polar.LEAKAGE :].abs().amax(dim=(2, 3), keepdim=True)


def _dimmed(heard: Heard, ceiling: Float[Tensor, "item 1 1"]) -> Heard:
    """Limit the level of range bins softly, to a level in dB relative to the maximum."""
    power = heard.abs().square().mean(dim=3)
    most = _largest(heard)[..., 0].square() * 10 ** (ceiling / 10)
    return heard * (1 + power / most.clamp_min(1e-30)).rsqrt()[..., None]


def _added(frames: int, draw: Draw, normal: Draw) -> Heard:
    """Simulate point echoes, relative to the maximum, at antennas half a wavelength apart, without a range window."""
    there = draw(0.0, 1.0, 1) > draw(0.0, 1.0, ADDED)
    strength = _amplitude(draw(*LEVELS, ADDED)) * there
    steps = torch.arange(frames, device=strength.device)[None, :, None]
    place = draw(0.0, BINS, 1, ADDED) + steps * WANDER[0] * normal(1, ADDED)
    sine = draw(-1.0, 1.0, 1, ADDED) + steps * WANDER[1] * normal(1, ADDED)
    phase = draw(0.0, 2 * torch.pi, frames, ADDED)
    apart = torch.arange(BINS, device=place.device) - place[..., None]
    over_range = torch.polar(torch.sinc(apart), -torch.pi * apart)
    antenna = torch.arange(4, device=place.device)
    over_array = torch.polar(torch.ones_like(sine)[..., None], phase[..., None] - torch.pi * sine[..., None] * antenna)
    return torch.einsum("nk,nfkr,nfka->nfra", strength.to(over_range.dtype), over_range, over_array)


def _board(draw: Draw, normal: Draw) -> Complex64[Tensor, "item antenna"]:
    """Draw complex gains of the antennas, including the yaw of the mounting."""
    sine = draw(-YAW, YAW, 1)
    yaw = torch.pi * sine * torch.arange(4, device=sine.device)
    return torch.polar(_amplitude(GAIN * normal(4)), draw(0.0, PHASE, 1) * normal(4) + yaw)
