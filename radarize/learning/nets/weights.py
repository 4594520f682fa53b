"""Trained networks as files: safetensors in float16, with a header that says what they were trained on and for."""

import json
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import torch
from jaxtyping import Float
from pydantic import Field, ValidationError
from safetensors import safe_open
from safetensors.torch import save as serialise
from torch import Tensor, nn

from radarize import __version__
from radarize.io.errors import InputError, explained
from radarize.io.plain import Frozen
from radarize.io.replacing import replacing
from radarize.learning.features.grid import TOLERANCE, MapGrid, Resampling
from radarize.learning.features.windows import Windows
from radarize.radar.array import azimuth_row
from radarize.radar.config import RadarConfig
from radarize.signal.maps import Maker, MapMaker


class Header(Frozen):
    """What the file says of itself.

    Attributes:
        kind: of the network.
        setting: reading of the paper that its maps follow: ``corrected``, or ``published``.
        frames, maps, width: what the network is built with; maps are names of all that it reads of a frame.
        grid: of its maps; None if it sees none.
        spacings: frames from one of the window to the next, as trained.
        data: name of the data set; split: of it.
        hours: of walks that it learned from, validation aside; 0 if nobody said.
        seed, epochs: of the training.
        metrics: on its validation data.
        version: of this package.
    """

    kind: str
    setting: str = "corrected"
    frames: int
    maps: tuple[str, ...]
    width: int
    grid: MapGrid | None
    spacings: tuple[Annotated[int, Field(ge=1, le=1 << 10)], ...] = Field((1,), min_length=1, max_length=1 << 6)
    data: str = ""
    split: str | None = None
    hours: float = Field(0.0, ge=0, allow_inf_nan=False)
    seed: int = 0
    epochs: int = 0
    metrics: dict[str, float] = {}
    version: str = __version__

    @property
    def _seen(self) -> MapGrid:
        assert self.grid is not None  # who asks has a network that sees maps
        return self.grid

    def windows(self, config: RadarConfig, maker: type[Maker], spacings: Sequence[int] | None = None) -> Windows:
        """Of a radar's frames, as the network was trained on them.

        Args:
            config: of the radar.
            maker: of its maps.
            spacings: some of the network's; the first if None. The radar's that come nearest are taken, each once.
        """
        chosen = self.spacings[:1] if spacings is None else spacings
        grid = self._seen
        ratio = grid.frame_period / config.frame_period
        own, centred = MapGrid.of(config, self.maps[0], maker), maker.axes(config, self.maps[0]).centred
        return Windows(
            self.maps, self.frames, config.frame_period, sorted({max(1, round(ratio * spacing)) for spacing in chosen}),
            Resampling.between(grid, own, centred) if maker.physical else None,
        )  # fmt: skip

    def ranges(self, config: RadarConfig) -> Float[np.ndarray, "row"]:
        """Where the rows of a map over range lie that the network sees of a radar, m."""
        return self._seen.step * np.arange(self._seen.rows) - config.range_bias

    def difference(self, config: RadarConfig, maker: type[Maker]) -> str | None:
        """Why the network cannot be shown a radar's maps, in words; None if it can."""
        grid, own, period = self._seen, MapGrid.of(config, self.maps[0], maker), config.frame_period
        if not maker.physical:
            share = grid.frame_period / period
            fits = round(share) >= 1 and abs(share - round(share)) < TOLERANCE * share
            return grid.difference(own, ignore=("frame_period",)) or (
                None if fits else f"frame period {period:.6g} instead of {grid.frame_period:.6g} or a part"
            )
        if (antennas := len(azimuth_row(config))) < LEAST_ANTENNAS:
            return f"{antennas} antennas in a row, expected at least {LEAST_ANTENNAS}"
        longest = LATEST * max(self.spacings) * grid.frame_period
        if self.frames > 1 and period > longest:
            return f"a frame period of {period:.3g} s, expected at most {longest:.3g} s"
        if period * OFTENEST < grid.frame_period:
            return f"a frame period of {period:.3g} s, expected at least {grid.frame_period / OFTENEST:.3g} s"
        return grid.lack(own, "m/s" if maker.axes(config, self.maps[0]).centred else "m")


#: Bytes of a file's header: ours have some thousands.
_HEADER = 1 << 20
#: What tells bearings; by how much longer than any that it was trained on a window may be; and how many times as often
#: as in its training frames may come, which it keeps until a window is full.
LEAST_ANTENNAS, LATEST, OFTENEST = 4, 1.6, 32


class Network(nn.Module):
    """What networks have in common; `scaled` ones take the `step` from row to row of their maps as well.

    Args:
        frames: of a window, oldest first.
        maps: names of what it reads of a frame.
        width: channels of the first stage.

    Attributes:
        kind: name of its task; setting: see `Header`.
        maker: of the maps that it sees.
        scaled: it needs to know how far its maps' rows are apart.
        inputs, outputs: names of what `estimate` takes and gives.
        shapes: of an item's inputs, of a network that sees no maps.
        estimate: what the network is used for; its arguments and answers are the subclass's own.
    """

    kind: str
    setting: str = "corrected"
    maker: type[Maker] = MapMaker
    scaled: bool = False
    inputs: tuple[str, ...] = ("maps",)
    outputs: tuple[str, ...] = ("estimate", "covariance")
    shapes: tuple[tuple[int, ...], ...]
    estimate: Callable[..., Any]

    def __init__(self, frames: int, maps: Sequence[str], width: int):
        super().__init__()
        self.frames, self.maps, self.width = frames, tuple(maps), width


_Net = TypeVar("_Net", bound=Network)


def build(network: type[_Net], header: Header) -> _Net:
    """An untrained network as a header describes it.

    Raises:
        ValueError: it needs to know the grid, and there is none.
    """
    scale: dict[str, float] = {}
    if network.scaled:
        if header.grid is None:
            raise ValueError(f"{header.kind} without a grid")
        scale["step"] = header.grid.step
    return network(header.frames, header.maps, header.width, **scale)


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


def load(path: Path, network: type[_Net], config: RadarConfig | None = None) -> tuple[_Net, Header]:
    """A network in float32, ready for use.

    Args:
        path: file that `save` wrote.
        network: what it has to be.
        config: of the radar whose maps it is to read.

    Raises:
        InputError: no such file, no weights of this project, another network's, or trained for maps of another grid.
    """
    tensors, about = read(path)
    with explained(misfit := f"{path}: its weights do not fit its header", ValidationError):
        header = Header.model_validate(about)
    if (header.kind, header.setting) != (network.kind, network.setting):
        raise InputError(
            f"{path}: is a network for {header.kind!r} ({header.setting}), expected one for {network.kind!r} "
            f"({network.setting})"
        )
    with explained(misfit, ValueError, RuntimeError, OverflowError):
        with torch.device("meta"), warnings.catch_warnings():  # sizes that the header makes up take no memory
            warnings.simplefilter("ignore")  # nothing is copied
            build(network, header).load_state_dict(tensors)
        net = build(network, header)
        net.load_state_dict(tensors)
    if config is not None:
        _check(header, config, path, network.maker)
    return net.eval(), header


def check(path: Path, config: RadarConfig) -> None:
    """Whether a network reads the maps of a radar that networks commonly see, by its header alone.

    Raises:
        InputError: see `load`.
    """
    _check(header_of(path), config, path, MapMaker)


def header_of(path: Path) -> Header:
    """What a file says of itself.

    Raises:
        InputError: no such file, or no weights of this project.
    """
    with explained(f"{path}: its weights do not fit its header", ValidationError):
        return Header.model_validate(read(path, tensors=False)[1])


def _check(header: Header, config: RadarConfig, path: Path, maker: type[Maker]) -> None:
    if header.grid is None:
        return
    if header.maps[0] not in maker.maps:
        raise InputError(f"{path}: reads maps {header.maps[0]!r}, expected some of: {', '.join(maker.maps)}")
    if difference := header.difference(config, maker):
        raise InputError(f"{path}: does not fit this radar, which has {difference}")


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
    with explained(f"{path}: is no file of weights of this project"):
        with Path(path).open("rb") as file:
            if (size := int.from_bytes(file.read(8), "little")) > _HEADER:
                raise ValueError(f"its header has {size} bytes, expected at most {_HEADER}")
        with safe_open(path, "pt") as file:
            if "radarize" not in (header := file.metadata() or {}):
                raise ValueError("has no header of radarize")
            about = json.loads(header["radarize"])
            return {name: file.get_tensor(name) for name in (file.keys() if tensors else ())}, about


def example(net: Network, header: Header) -> tuple[Tensor, ...]:
    """What a network reads, twice: maps of noise and, if it wants to be told, a travel; or its other readings."""
    noise = torch.Generator().manual_seed(0)
    if header.grid is None:
        return tuple(torch.randn((2, *shape), generator=noise) for shape in net.shapes)
    shape = (2, header.frames, len(header.maps), header.grid.rows, header.grid.azimuths)
    maps = 10 * torch.randn(shape, generator=noise)
    return (maps, 0.1 * torch.randn((2, 2), generator=noise)) if "travel" in net.inputs else (maps,)
