"""What a method is, and what it is made from."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.pipeline.config import Configuration
from radarize.radar.array import is_whole
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Signal

#: Folder of the shipped weights.
SHIPPED = Path(__file__).parents[1] / "learning" / "weights"


class Weights:
    """Where the networks' weights lie.

    Args:
        folder: with ``translation.safetensors`` and so on, as `radarize train` writes them; the shipped ones if None.
    """

    def __init__(self, folder: str | Path | None = None):
        self.folder = None if folder is None else Path(folder)

    def of(self, kind: str) -> Path:
        """File of a network."""
        return (self.folder or SHIPPED) / f"{kind}.safetensors"


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

    @cached_property
    def radar(self) -> RadarConfig:
        """Of a radar that delivers no more frames than are used."""
        return self.delivered.every(self.every)

    @cached_property
    def signal(self) -> Signal:
        """What makes spectra, maps and points of the radar's frames."""
        return Signal(self.radar, self.configuration.heatmaps)

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
        make: called with `Inputs`; raises InputError where something is lacking, such as weights for this radar or a
            stream.
        networks: kinds of weights that it needs.
        whole: those of them that it needs where the array is whole (`radarize.radar.array.is_whole`); all if None.
        scans: this odometry is made from scans (`Batch.ranges`).
        pictures: it reads polar pictures (`radarize.signal.polar`), so it needs no samples.
    """

    title: str
    make: Callable
    networks: tuple[str, ...] = ()
    whole: tuple[str, ...] | None = None
    scans: bool = False
    pictures: bool = False

    def needed(self, radar: RadarConfig) -> tuple[str, ...]:
        """Kinds of weights that it needs for a radar."""
        return self.networks if self.whole is None or not is_whole(radar) else self.whole
