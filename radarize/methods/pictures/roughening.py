"""What real pictures have and simulated ones lack: drawn at random, so that a network relies on neither.

Simulated walls are flatter and rooms emptier than real ones, so a few flashes hide everything that lies below the
threshold of 26 dB. Here flashes lose what they have above a random level, echoes that nobody explains are added, levels
wander, and cells go missing, before a picture is made that keeps a random share of its cells.
"""

import math

import torch
from jaxtyping import Float
from torch import Generator, Tensor
from torch.nn.functional import interpolate

from radarize import polar
from radarize.features.maps import Maps
from radarize.methods.pictures.maps import FLOOR

#: Echoes that are added at most, the spread of their levels, dB re the picture's largest, and the rows and sines that
#: they wander from frame to frame, standard deviations.
ADDED, LEVELS, WANDER = 32, (-40.0, -6.0), (2.0, 0.02)
#: dB, of what flashes may keep above the rest; of the gain over range, at either end; of patches of cells, at most.
CEILING, TILT, PATCHY = (-25.0, 0.0), 6.0, 3.0
#: Patches: so many columns wide, a row high; and the most of them that are missing.
_COLUMNS, MISSING = 8, 0.3
#: Shares of the cells that are kept: the spread of the training walks (6 to 14 %), and more to either side.
KEPT = (0.02, 0.18)
#: Rows by which the radar reads too far: range bias and lever arm of the data set's rig, 0.17 to 0.34 m on its training
#: walks.
BIAS = (4, 8)


def rough(levels: Maps, generator: Generator) -> Maps:
    """Pictures of levels (dB below the largest), as another room and another board might have made them.

    Args:
        levels: of `PictureMaker`, with one map.
        generator: of random numbers.
    """

    def draw(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand((len(levels), *shape), generator=generator)

    inside = levels[:, :, 0] > FLOOR
    power = 10 ** (levels[:, :, 0].float() / 10)
    power = power / (1 + power / 10 ** (draw(*CEILING, 1, 1, 1) / 10))
    peak = power.flatten(1).amax(dim=1)[:, None, None, None]
    power = power + peak * _added(levels, draw, generator)
    level = 10 * torch.log10(power.clamp_min(1e-12))
    level = level + draw(-TILT, TILT, 1, 1, 1) * torch.linspace(-1, 1, polar.ROWS)[:, None]
    coarse = (*level.shape[:3], _COLUMNS)
    patchy = torch.randn(coarse, generator=generator) * draw(0.0, PATCHY, 1, 1, 1)
    level = level + interpolate(patchy, size=level.shape[2:], mode="bilinear")
    missing = (torch.rand(coarse, generator=generator) < draw(0.0, MISSING, 1, 1, 1)).repeat_interleave(
        polar.COLUMNS // _COLUMNS, dim=3
    )
    level = torch.where(inside & ~missing, level, torch.full_like(level, FLOOR))
    # The share is of the newest picture; the threshold is every picture's.
    newest = (level[:, -1] - level[:, -1].amax(dim=(1, 2), keepdim=True)).flatten(1).sort(dim=1, descending=True).values
    kept = (draw(*KEPT, 1) * newest.shape[1]).long()
    found = picture(level, newest.gather(1, kept)[:, :, None, None].clamp(-50.0, -15.0))
    shifts = torch.randint(BIAS[0], BIAS[1] + 1, (len(levels),), generator=generator)
    return shifted(found, shifts)[:, :, None]


def picture(
    level: Float[Tensor, "item frame row column"], threshold: Float[Tensor, "item 1 1 1"]
) -> Float[Tensor, "item frame row column"]:
    """0...255 from the least to the largest of what is at most `threshold` (dB) below the largest of its frame."""
    level = level - level.amax(dim=(2, 3), keepdim=True)
    kept = level >= threshold
    least = torch.where(kept, level, torch.zeros_like(level)).amin(dim=(2, 3), keepdim=True)
    return torch.where(kept, (255 * (1 - level / least.clamp_max(-1e-3))).floor(), torch.zeros_like(level))


def shifted(found: Float[Tensor, "item frame row column"], rows: Tensor) -> Float[Tensor, "item frame row column"]:
    """Pictures that read so many rows too far."""
    place = torch.arange(polar.ROWS)[None] - rows[:, None]
    moved = found.gather(2, place.clamp_min(0)[:, None, :, None].expand_as(found))
    return moved * (place >= 0)[:, None, :, None]


def _added(levels: Maps, draw, generator: Generator) -> Float[Tensor, "item frame row column"]:
    """Power of point echoes, re the largest, as the array of eight sees them."""
    items, frames = levels.shape[:2]
    there = draw(0.0, 1.0, 1) > torch.rand((items, ADDED), generator=generator)
    strength = 10 ** (draw(*LEVELS, ADDED) / 10) * there
    along = draw(0.0, polar.ROWS, ADDED)
    across = draw(-1.0, 1.0, ADDED)
    steps = torch.arange(frames)[None, :, None]
    row = along[:, None] + steps * WANDER[0] * torch.randn((items, 1, ADDED), generator=generator)
    sine = across[:, None] + steps * WANDER[1] * torch.randn((items, 1, ADDED), generator=generator)
    ranges = torch.arange(polar.ROWS, dtype=torch.float32)
    over_range = torch.sinc(ranges - row[..., None]).square()
    columns = torch.sin(torch.tensor(polar.AZIMUTHS, dtype=torch.float32))
    phase = math.pi * (columns - sine[..., None])
    array = (torch.sin(4 * phase) / (8 * torch.sin(phase / 2)).where(phase.abs() > 1e-4, phase.new_ones(()))).square()
    array = array.where(phase.abs() > 1e-4, array.new_ones(()))
    return torch.einsum("nfk,nfkr,nfkc->nfrc", strength[:, None].expand(-1, frames, -1), over_range, array)
