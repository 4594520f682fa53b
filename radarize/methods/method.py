"""What a method is, and what it is made from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TypeVar, cast

from radarize.batch import Signal
from radarize.errors import InputError
from radarize.methods.configuration import Configuration
from radarize.radar.array import is_whole
from radarize.radar.config import RadarConfig
from radarize.recording import Recording

Part = TypeVar("Part")


class Weights:
    """Where the networks' weights lie.

    Args:
        folder: with ``translation.safetensors`` and so on, as `radarize train` writes them; the shipped ones if None.
    """

    def __init__(self, folder: Path | None = None):
        self.folder = folder

    def of(self, kind: str) -> Path:
        """File of a network; in a folder of the user's ``published-KIND`` may be called ``KIND``, as it once was."""
        path = (self.folder or Path(__file__).parents[1] / "weights") / f"{kind}.safetensors"
        former = path.with_name(path.name.removeprefix("published-"))
        return former if self.folder and not path.is_file() and former.is_file() else path


@dataclass(frozen=True, eq=False)
class Inputs:
    """What methods are made from.

    Attributes:
        delivered: configuration of the radar.
        configuration: of the pipeline.
        weights: of the networks.
        recording: where other sensors' streams are; None on a live radar.
        every: every so many-th frame is used.
    """

    delivered: RadarConfig
    configuration: Configuration = field(default_factory=Configuration)
    weights: Weights = field(default_factory=Weights)
    recording: Recording | None = None
    every: int = 1
    _parts: dict[Callable, object] = field(default_factory=dict, repr=False)

    @cached_property
    def radar(self) -> RadarConfig:
        """Of a radar that delivers no more frames than are used."""
        return self.delivered.every(self.every)

    @cached_property
    def signal(self) -> Signal:
        """What makes spectra, maps and points of the radar's frames."""
        return Signal(self.radar, self.configuration.heatmaps)

    def part(self, make: Callable[[RadarConfig], Part]) -> Part:
        """What several methods share, made of the radar's configuration once."""
        if make not in self._parts:
            self._parts[make] = make(self.radar)
        return cast(Part, self._parts[make])

    def imu(self, method: str) -> Recording:
        """The recording, for a method that needs its IMU.

        Raises:
            InputError: there is none.
        """
        if self.recording is None:
            raise InputError(f"odometry is {method!r}, which reads a recording's IMU; a live radar has none")
        return self.recording


@dataclass(frozen=True)
class Method:
    """A way to odometry or scans.

    Attributes:
        title: what tables call it.
        make: called with `Inputs`, and with a scanner if it takes `scans`; or where that is, as ``module:name``, which
            is loaded when the method is asked for. Raises InputError where something is lacking, such as weights for
            this radar or a stream.
        networks: kinds of weights that it needs.
        whole: those of them that it needs where the array is whole (`radarize.radar.array.is_whole`); all if None.
        scans: this odometry is made from scans.
        pictures: it reads polar pictures (`radarize.polar`), so it needs no samples.
        options: further arguments of `make`.
    """

    title: str
    make: str | Callable
    networks: tuple[str, ...] = ()
    whole: tuple[str, ...] | None = None
    scans: bool = False
    pictures: bool = False
    options: Mapping[str, object] = field(default_factory=dict)

    def needed(self, radar: RadarConfig) -> tuple[str, ...]:
        """Kinds of weights that it needs for a radar."""
        return self.networks if self.whole is None or not is_whole(radar) else self.whole

    @property
    def maker(self) -> Callable:
        """`make`, loaded."""
        return load(self.make) if isinstance(self.make, str) else self.make


def load(place: str) -> Callable:
    """What stands at ``module:name``."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
