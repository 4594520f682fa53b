"""Files of trained networks: safetensors in float16, with a header on their training."""

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
    """Header of a file of weights.

    Attributes:
        kind: kind of network.
        setting: variant of the paper's method that its maps follow: ``corrected``, or ``published``.
        frames, maps, width: parameters of the network; maps are the names of all inputs from a frame.
        grid: grid of its maps; None without maps.
        spacings: spacings between frames of a window, in frames, as trained.
        data: name of the data set; split: its split.
        hours: duration of the training walks without validation, h; 0 if unknown.
        seed, epochs: seed and number of epochs of the training.
        metrics: metrics on its validation data.
        version: version of this package.
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
    def map_grid(self) -> MapGrid:
        """Grid of the maps of a network whose input is maps."""
        assert self.grid is not None, f"{self.kind} has no maps"
        return self.grid

    def windows(self, config: RadarConfig, maker: type[Maker], spacings: Sequence[int] | None = None) -> Windows:
        """Return windows over a radar's frames, as the network was trained on them.

        Args:
            config: configuration of the radar.
            maker: class of its maps.
            spacings: some of the network's spacings; None: the first. The nearest ones of the radar are used, each
                once.
        """
        chosen = self.spacings[:1] if spacings is None else spacings
        grid = self.map_grid
        ratio = grid.frame_period / config.frame_period
        own, centred = MapGrid.of(config, self.maps[0], maker), maker.axes(config, self.maps[0]).centred
        return Windows(
            self.maps, self.frames, config.frame_period, sorted({max(1, round(ratio * spacing)) for spacing in chosen}),
            Resampling.between(grid, own, centred) if maker.physical else None,
        )  # fmt: skip

    def ranges(self, config: RadarConfig) -> Float[np.ndarray, "row"]:
        """Return the ranges of the network's map rows for a radar, m."""
        return self.map_grid.step * np.arange(self.map_grid.rows) - config.range_bias

    def difference(self, config: RadarConfig, maker: type[Maker]) -> str | None:
        """Return in words why the network cannot process a radar's maps; None if it can."""
        grid, own, period = self.map_grid, MapGrid.of(config, self.maps[0], maker), config.frame_period
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


#: Maximum bytes of a file's header; ours have some thousands.
_HEADER = 1 << 20
#: Minimum number of antennas in a row; maximum ratio of a window's duration to the longest one in training; maximum
#: ratio of frame rate to that in training, since frames are stored until a window is complete.
LEAST_ANTENNAS, LATEST, OFTENEST = 4, 1.6, 32


class Network(nn.Module):
    """Base class of networks; `scaled` ones also have the parameter `step` between rows of their maps.

    Args:
        frames: number of frames of a window, oldest first.
        maps: names of the inputs from a frame.
        width: channels of the first stage.

    Attributes:
        kind: name of its task; setting: see `Header`.
        maker: class of its maps.
        scaled: whether it needs the step between rows of its maps.
        inputs, outputs: names of inputs and outputs of `estimate`.
        shapes: shapes of an item's inputs, for a network without maps.
        estimate: inference; inputs and outputs depend on the subclass.
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
    """Return an untrained network as described by a header.

    Raises:
        ValueError: the network needs a grid, and the header has none.
    """
    scale: dict[str, float] = {}
    if network.scaled:
        if header.grid is None:
            raise ValueError(f"{header.kind} without a grid")
        scale["step"] = header.grid.step
    return network(header.frames, header.maps, header.width, **scale)


def save(net: nn.Module, header: Header, path: Path) -> Path:
    """Write a network's weights.

    Raises:
        InputError: weights exceed the range of float16, or the disk is full.
    """
    halves = {}
    for name, values in net.state_dict().items():
        halves[name] = values.half() if values.is_floating_point() else values
        if not halves[name].isfinite().all():
            raise InputError(
                f"{path}: {name} has values outside the range of float16, expected a network that converged"
            )
    write(halves, header.model_dump(), path)
    return path


def load(path: Path, network: type[_Net], config: RadarConfig | None = None) -> tuple[_Net, Header]:
    """Load a network in float32.

    Args:
        path: file that `save` wrote.
        network: expected class.
        config: configuration of the radar whose maps are its input.

    Raises:
        InputError: no such file, not weights of this project, another network, or trained for maps of another grid.
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
        with torch.device("meta"), warnings.catch_warnings():  # sizes in the header allocate no memory
            warnings.simplefilter("ignore")  # nothing is copied
            build(network, header).load_state_dict(tensors)
        net = build(network, header)
        net.load_state_dict(tensors)
    if config is not None:
        _check(header, config, path, network.maker)
    return net.eval(), header


def check(path: Path, config: RadarConfig) -> None:
    """Raise unless a network with standard maps fits a radar, from its header only.

    Raises:
        InputError: see `load`.
    """
    _check(header_of(path), config, path, MapMaker)


def header_of(path: Path) -> Header:
    """Read the header of a file of weights.

    Raises:
        InputError: no such file, or not weights of this project.
    """
    with explained(f"{path}: its weights do not fit its header", ValidationError):
        return Header.model_validate(read(path, tensors=False)[1])


def _check(header: Header, config: RadarConfig, path: Path, maker: type[Maker]) -> None:
    if header.grid is None:
        return
    if header.maps[0] not in maker.maps:
        raise InputError(f"{path}: has input {header.maps[0]!r}, expected some of: {', '.join(maker.maps)}")
    if difference := header.difference(config, maker):
        raise InputError(f"{path}: does not fit this radar, which has {difference}")


def write(tensors: dict[str, Tensor], about: dict[str, Any], path: Path) -> None:
    """Write a safetensors file with JSON in its header; the file appears when complete.

    Raises:
        InputError: the file cannot be written.
    """
    content = {name: values.detach().cpu().contiguous() for name, values in tensors.items()}
    data = serialise(content, {"radarize": json.dumps(about)})
    with replacing(path) as part:
        part.write_bytes(data)  # safetensors' own writer makes it unreadable for other users


def read(path: Path, tensors: bool = True) -> tuple[dict[str, Float[Tensor, "..."]], dict[str, Any]]:
    """Read what `write` wrote, or its header only.

    Raises:
        InputError: no such file, or not one of this project.
    """
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file, expected weights (.safetensors)")
    with explained(f"{path}: is not a file of weights of this project"):
        with Path(path).open("rb") as file:
            if (size := int.from_bytes(file.read(8), "little")) > _HEADER:
                raise ValueError(f"its header has {size} bytes, expected at most {_HEADER}")
        with safe_open(path, "pt") as file:
            if "radarize" not in (header := file.metadata() or {}):
                raise ValueError("has no header of radarize")
            about = json.loads(header["radarize"])
            return {name: file.get_tensor(name) for name in (file.keys() if tensors else ())}, about


def example(net: Network, header: Header) -> tuple[Tensor, ...]:
    """Return example inputs of a network, two items: maps of noise with a travel if it is an input, or other inputs."""
    noise = torch.Generator().manual_seed(0)
    if header.grid is None:
        return tuple(torch.randn((2, *shape), generator=noise) for shape in net.shapes)
    shape = (2, header.frames, len(header.maps), header.grid.rows, header.grid.azimuths)
    maps = 10 * torch.randn(shape, generator=noise)
    return (maps, 0.1 * torch.randn((2, 2), generator=noise)) if "travel" in net.inputs else (maps,)
