"""Where the virtual radar's samples come from: a recording, or whatever else gives frames (`simulation`)."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import Int16

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import encode

#: By how much settings may differ from the recording's: programs round them, xwr_raw_ros to two digits (33.33 ms).
_ROUNDING = 2e-4
#: What does not change the samples that the radar sends: corrections for whoever reads them.
NOT_IN_SAMPLES = {"board", "range_bias", "channel_calibration"}
_KEPT = 256 << 20  # bytes of a recording that, played in a loop, are unpacked once


class Source(Protocol):
    """Gives frames; sent to another process, which makes them ahead of time."""

    def expected(self) -> RadarConfig:
        """The configuration to make frames for before one has come over the UART."""

    def check(self, config: RadarConfig) -> None:
        """Refuse a configuration with an InputError."""

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """LVDS bytes of frame after frame."""


@dataclass(frozen=True)
class Playback:
    """The frames of a recording, as the radar that made it sent them.

    Attributes:
        path: of the recording.
        loop: begin again at the end.
    """

    path: Path
    loop: bool = False

    def expected(self) -> RadarConfig:
        """The recording's own."""
        with Recording(self.path) as recording:
            if not len(recording):
                raise InputError(f"{self.path}: holds no frame, expected at least one to play")
            recording.adc(0, 0)  # refuses recordings of heat maps
            return recording.config

    def check(self, config: RadarConfig) -> None:
        """Refuse any other configuration than the recording's, roundings aside.

        Raises:
            InputError: naming the first field that differs.
        """
        own = self.expected()
        for name in RadarConfig.model_fields:
            asked, recorded = getattr(config, name), getattr(own, name)
            if name not in NOT_IN_SAMPLES | {"iq_order"} and not _alike(asked, recorded):
                raise InputError(f"{name} is {asked}, expected {recorded} as in {self.path.name}, which is played")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """One at a time, packed as `config` says."""
        with Recording(self.path) as recording:
            numbers, kept = range(len(recording)), len(recording) * config.frame_bytes <= _KEPT
            frames: Iterator[bytes] = (
                packed(recording.adc(number, number + 1), config)
                for number in (cycle(numbers) if self.loop and not kept else numbers)
            )
            if self.loop and kept:
                frames = cycle(frames)
            yield from frames


def packed(frame: Int16[np.ndarray, "1 loop tx rx sample 2"], config: RadarConfig) -> bytes:
    """A frame's LVDS bytes."""
    return encode(frame, config).astype("<i2", copy=False).tobytes()


def _alike(first: object, second: object) -> bool:
    one, other = (value if isinstance(value, tuple) else (value,) for value in (first, second))
    if not all(isinstance(number, float) for number in one + other):
        return first == second
    return len(one) == len(other) and np.allclose(np.array(one), np.array(other), rtol=_ROUNDING, atol=0)
