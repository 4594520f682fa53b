"""What real pictures have and simulated ones lack: drawn at random, so that a network relies on neither.

Simulated boards have gains and phases of their own, walls are flatter and rooms emptier than real ones. Here what four
antennas hear is changed as another board and another room might have done it: gains and phases differ, flashes lose
what they have above a random level, echoes that nobody explains are added, gain wanders over range, noise comes on top.
A picture is then made of it as RadarHD makes them, but keeps a random share of its cells, of which some go missing.
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

#: Of antennas, standard deviation: gain, dB; phase, rad, at most. Sine of the mount's yaw, at most.
GAIN, PHASE, YAW = 0.5, 0.15, 0.02
#: dB re the frame's largest, of what flashes may keep.
CEILING = (-5.0, 15.0)
#: Echoes that are added at most, their levels, dB re the largest, and the bins and sines that they wander from frame to
#: frame, standard deviations.
ADDED, LEVELS, WANDER = 8, (-45.0, -15.0), (2.0, 0.02)
#: dB: gain over range, at either end; its patches, standard deviation at most, and how many there are; noise re the
#: frame's largest.
TILT, PATCHY, PATCHES, NOISE = 2.0, 1.0, 32, (-60.0, -40.0)
#: Blocks of pixels, a row high, that are missing at most, and columns of one.
MISSING, BLOCK = 0.1, 8
#: Shares of the pixels that are kept: the spread of the training walks (6 to 14 %), and more to either side.
KEPT = (0.02, 0.18)
#: dB below the largest: where no cell of the radar lies.
FLOOR = -90.0

Draw = Callable[..., Tensor]
Heard = Complex64[Tensor, "item frame range antenna"]


def rough(antennas: Maps, generator: Generator) -> Float[Tensor, "item frame 1 range column"]:
    """Pictures as another room and another board might have made them.

    Args:
        antennas: of `PictureMaker`, with one map.
        generator: of random numbers, on the maps' device.
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
    """Random numbers on the generator's device."""
    return low + (high - low) * torch.rand(shape, generator=generator, device=generator.device)


def kept(level: Float[Tensor, "item frame row column"], generator: Generator) -> Maps:
    """Pictures that keep a random share of their pixels: the share is of the newest, the threshold every one's."""
    newest = (level[:, -1] - level[:, -1].amax(dim=(1, 2), keepdim=True)).flatten(1).sort(dim=1, descending=True).values
    share = uniform(generator, *KEPT, len(level), 1)
    threshold = newest.gather(1, (share * newest.shape[1]).long())[:, :, None, None]
    return picture(level, threshold.clamp(-50.0, -15.0))[:, :, None]


def antennas_of(maps: Maps) -> Heard:
    """What antennas hear, of maps of `PictureMaker`."""
    return torch.view_as_complex(maps[:, :, 0].float().unflatten(3, (-1, 2)))


def levels(heard: Heard) -> Float[Tensor, "item frame row column"]:
    """What pictures are made of before anything is dropped: dB below the largest, `FLOOR` where no cell lies."""
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
    """0...255 from the least to the largest of what is at most `threshold` (dB) below the largest of its frame."""
    level = level - level.amax(dim=(2, 3), keepdim=True)
    kept = level >= threshold
    least = torch.where(kept, level, torch.zeros_like(level)).amin(dim=(2, 3), keepdim=True)
    return torch.where(kept, (255 * (1 - level / least.clamp_max(-1e-3))).floor(), torch.zeros_like(level))


def _amplitude(decibels: Tensor) -> Tensor:
    return 10 ** (decibels / 20)


def _largest(heard: Heard) -> Float[Tensor, "item frame 1 1"]:
    return heard[:, :, polar.LEAKAGE :].abs().amax(dim=(2, 3), keepdim=True)


def _dimmed(heard: Heard, ceiling: Float[Tensor, "item 1 1"]) -> Heard:
    """Range bins of no more than so many dB re the largest: what is far below it keeps its level."""
    power = heard.abs().square().mean(dim=3)
    most = _largest(heard)[..., 0].square() * 10 ** (ceiling / 10)
    return heard * (1 + power / most.clamp_min(1e-30)).rsqrt()[..., None]


def _added(frames: int, draw: Draw, normal: Draw) -> Heard:
    """Point echoes, re the largest, as antennas half a wavelength apart hear them over range without a window."""
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
    """Gains and phases of antennas, and the mount's yaw."""
    sine = draw(-YAW, YAW, 1)
    yaw = torch.pi * sine * torch.arange(4, device=sine.device)
    return torch.polar(_amplitude(GAIN * normal(4)), draw(0.0, PHASE, 1) * normal(4) + yaw)
