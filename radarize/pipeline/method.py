"""A method of odometry or scans, and the inputs that it is made from."""

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
    """Files of network weights.

    Args:
        folder: with ``translation.safetensors`` and so on, as `radarize train` writes them; the shipped ones if None.
    """

    def __init__(self, folder: str | Path | None = None):
        self.folder = None if folder is None else Path(folder)

    def of(self, kind: str) -> Path:
        """Return the weights file of a network."""
        return (self.folder or SHIPPED) / f"{kind}.safetensors"


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs that methods are made from.

    Attributes:
        delivered: configuration of the radar as it delivers frames.
        configuration: settings of the pipeline.
        weights: weights of the networks.
        recording: source of the streams of other sensors; None for a live radar.
        every: use every N-th frame.
    """

    delivered: RadarConfig
    configuration: Configuration = field(default_factory=Configuration)
    weights: Weights = field(default_factory=Weights)
    recording: Recording | None = None
    every: int = 1

    @cached_property
    def radar(self) -> RadarConfig:
        """Configuration of the radar with the frame period of the frames that are used."""
        return self.delivered.every(self.every)

    @cached_property
    def signal(self) -> Signal:
        """Signal processing of the frames that are used: spectra, maps and points."""
        return Signal(self.radar, self.configuration.heatmaps)

    def imu(self, method: str) -> Recording:
        """Return the recording, for a method that needs its IMU.

        Raises:
            InputError: the radar is live.
        """
        if self.recording is None:
            raise InputError(f"odometry is {method!r}, which reads a recording's IMU; a live radar has none")
        return self.recording


@dataclass(frozen=True)
class Method:
    """A method of odometry or of scans.

    Attributes:
        title: name in tables.
        make: called with `Inputs`; raises InputError if something is missing, such as weights for this radar or a
            stream.
        networks: kinds of weights that it needs.
        whole: the kinds that it needs if the array is whole (`radarize.radar.array.is_whole`); None: all of
            `networks`.
        scans: this odometry is computed from scans (`Batch.ranges`).
        pictures: it reads polar pictures (`radarize.signal.polar`), so it needs no samples.
    """

    title: str
    make: Callable
    networks: tuple[str, ...] = ()
    whole: tuple[str, ...] | None = None
    scans: bool = False
    pictures: bool = False

    def needed(self, radar: RadarConfig) -> tuple[str, ...]:
        """Return the kinds of weights that it needs for a radar."""
        return self.networks if self.whole is None or not is_whole(radar) else self.whole
