"""Trained networks as files: safetensors in float16, with a header that says what they were trained on and for."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from pydantic import BaseModel, ConfigDict, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as serialise
from torch import Tensor, nn

from radarize import __version__
from radarize.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.replacing import replacing
from radarize.settings import SETTINGS

#: Steps of range or speed that differ by less read as the same grid.
_TOLERANCE = 0.01
#: Networks that need to know how far their maps' rows are apart.
_SCALED = ("translation", "rotation")


class Grid(BaseModel):
    """Cells of a map: a network that knows one grid reads wrong speeds and ranges off another.

    Attributes:
        rows: range bins, or Doppler bins.
        step: m, or m/s, from row to row.
        azimuths: columns.
        field: rad, from the first column to the last.
        frame_period: s.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rows: int
    step: float
    azimuths: int
    field: float
    frame_period: float

    @classmethod
    def of(cls, config: RadarConfig, name: str, setting: str = "corrected") -> "Grid":
        """The grid of a radar's map."""
        maker = SETTINGS[setting].maker
        axes = maker.axes(config, name)
        return cls(
            rows=axes.rows,
            step=axes.step,
            azimuths=len(axes.azimuths),
            field=float(axes.azimuths[-1] - axes.azimuths[0]),
            frame_period=config.frame_period * maker.stride(config),
        )

    def difference(self, other: "Grid", ignore: tuple[str, ...] = ()) -> str | None:
        """What differs of another grid, in words; None if nothing does."""
        for name, own in self:
            if name not in ignore and abs(own - getattr(other, name)) > _TOLERANCE * abs(own):
                return f"{name.replace('_', ' ')} {getattr(other, name):.6g} instead of {own:.6g}"
        return None


class Header(BaseModel):
    """What the file says of itself.

    Attributes:
        kind: of the network.
        setting: key of `radarize.settings.SETTINGS`.
        frames, maps, width: what the network is built with; maps are names of all that it reads of a frame.
        grid: of its maps; None if it sees none.
        spacings: frames from one of the window to the next, as trained.
        data: name of the data set; split: of it.
        seed, epochs: of the training.
        metrics: on its validation data.
        version: of this package.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: str
    setting: str = "corrected"
    frames: int
    maps: tuple[str, ...]
    width: int
    grid: Grid | None
    spacings: tuple[int, ...] = (1,)
    data: str = ""
    split: str | None = None
    seed: int = 0
    epochs: int = 0
    metrics: dict[str, float] = {}
    version: str = __version__

    def stride(self, config: RadarConfig) -> int:
        """Frames of a radar from one to the next of those that the network was trained on: 2 at 30 Hz, if at 15 Hz.

        Raises:
            ValueError: the radar's frames do not come as often, or not at a whole multiple.
        """
        ratio = self.grid.frame_period / config.frame_period
        if round(ratio) < 1 or abs(ratio - round(ratio)) > _TOLERANCE * ratio:
            raise ValueError(
                f"frame period {config.frame_period:.6g} instead of {self.grid.frame_period:.6g} or a part"
            )
        return round(ratio)


def make(
    kind: str, frames: int, maps: Sequence[str], width: int, grid: Grid | None, setting: str = "corrected"
) -> nn.Module:
    """An untrained network for maps of a grid.

    Raises:
        ValueError: it needs to know the grid.
    """
    if kind in _SCALED and grid is None:
        raise ValueError(f"{kind} without a grid")
    scale = {"step": grid.step} if kind in _SCALED else {}
    return SETTINGS[setting].nets[kind](frames, maps, width, **scale)


def build(header: Header) -> nn.Module:
    """The network of a header, untrained."""
    return make(header.kind, header.frames, header.maps, header.width, header.grid, header.setting)


def save(net: nn.Module, header: Header, path: Path) -> Path:
    """Write a network.

    Raises:
        InputError: weights that float16 does not hold, or that the disk does not.
    """
    halves = {}
    for name, values in net.state_dict().items():
        halves[name] = values.half() if values.is_floating_point() else values
        if not halves[name].isfinite().all():
            raise InputError(f"{path}: {name} has values that float16 does not hold, expected a network that converged")
    write(halves, header.model_dump(), path)
    return path


def load(path: Path, config: RadarConfig | None = None) -> tuple[nn.Module, Header]:
    """A network in float32, ready for use.

    Args:
        path: file that `save` wrote.
        config: of the radar whose maps it is to read.

    Raises:
        InputError: no such file, no weights of this project, or trained for maps of another grid.
    """
    tensors, about = read(path)
    try:
        header = _header(about, path)
        net = build(header)
        net.load_state_dict(tensors)
    except (ValueError, RuntimeError) as error:
        raise _misfit(path, error) from error
    if config is not None:
        _check(header, config, path)
    return net.eval(), header


def check(path: Path, config: RadarConfig) -> None:
    """Whether a network reads a radar's maps, by its header alone.

    Raises:
        InputError: see `load`.
    """
    _check(_header(read(path, tensors=False)[1], path), config, path)


def _header(about: dict[str, Any], path: Path) -> Header:
    try:
        header = Header.model_validate(about)
    except ValidationError as error:
        raise _misfit(path, error) from error
    for value, known in ((header.setting, SETTINGS), (header.kind, SETTINGS["corrected"].nets)):
        if value not in known:
            raise InputError(f"{path}: is a network for {value!r}, expected one of: {', '.join(known)}")
    return header


def _misfit(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: its weights do not fit its header ({str(error).splitlines()[0].rstrip(':')})")


def _check(header: Header, config: RadarConfig, path: Path) -> None:
    if header.grid is None:
        return
    difference = header.grid.difference(Grid.of(config, header.maps[0], header.setting), ignore=("frame_period",))
    try:
        header.stride(config)
    except ValueError as error:
        difference = difference or str(error)
    if difference:
        raise InputError(f"{path}: does not fit this radar, whose maps have {difference}; it needs weights of its own")


def shipped(kind: str) -> Path:
    """Weights that come with the package: for the ``radarize`` preset, trained on simulated buildings."""
    return Path(__file__).parents[1] / "weights" / f"{kind}.safetensors"


def write(tensors: dict[str, Tensor], about: dict[str, Any], path: Path) -> None:
    """A safetensors file with JSON in its header, whole or not at all.

    Raises:
        InputError: it cannot be written.
    """
    content = {name: values.detach().cpu().contiguous() for name, values in tensors.items()}
    data = serialise(content, {"radarize": json.dumps(about)})
    with replacing(path) as part:
        part.write_bytes(data)  # safetensors' own writer hides the file from other users


def read(path: Path, tensors: bool = True) -> tuple[dict[str, Float[Tensor, "..."]], dict[str, Any]]:
    """What `write` wrote, or its header alone.

    Raises:
        InputError: no such file, or none of this project.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file, expected weights (.safetensors)")
    try:
        with safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {})["radarize"])
            return {name: file.get_tensor(name) for name in (file.keys() if tensors else ())}, about
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        reason = "has no header of radarize" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: is no file of weights of this project ({reason})") from error


def example(header: Header) -> tuple[Tensor, ...]:
    """What a network reads, twice: maps of noise, and for turns of setting `corrected` a travel; or other readings."""
    noise = torch.Generator().manual_seed(0)
    if header.grid is None:
        return tuple(torch.randn((2, *shape), generator=noise) for shape in build(header).shapes)
    shape = (2, header.frames, len(header.maps), header.grid.rows, header.grid.azimuths)
    maps = 10 * torch.randn(shape, generator=noise)
    told = header.kind == "rotation" and header.setting == "corrected"
    return (maps, 0.1 * torch.randn((2, 2), generator=noise)) if told else (maps,)
