"""Sources of the virtual radar's samples: the interface, and playback of a recording (`simulation` is another)."""

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

#: Tolerances for settings against the recording's: programs round them, xwr_raw_ros to two digits (33.33 ms).
_ROUNDING = 2e-4
#: Settings without influence on the samples that the radar sends: corrections applied by readers.
NOT_IN_SAMPLES = {"board", "range_bias", "channel_calibration"}
_KEPT = 256 << 20  # bytes; a looped recording up to this size is unpacked only once


class Source(Protocol):
    """Source of frames; it is sent to another process, which makes them ahead of time."""

    def expected(self) -> RadarConfig:
        """Configuration to make frames for until one arrives over the UART."""

    def check(self, config: RadarConfig) -> None:
        """Raise InputError for a configuration that the source cannot deliver."""

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """Yield the LVDS bytes of each frame."""


@dataclass(frozen=True)
class Playback:
    """Playback of a recording's frames, as the radar that made it sent them.

    Attributes:
        path: path of the recording.
        loop: restart at the end.
    """

    path: Path
    loop: bool = False

    def expected(self) -> RadarConfig:
        """Configuration of the recording."""
        with Recording(self.path) as recording:
            if not len(recording):
                raise InputError(f"{self.path}: holds no frame, expected at least one to play")
            recording.adc(0, 0)  # refuses recordings of heat maps
            return recording.config

    def check(self, config: RadarConfig) -> None:
        """Accept only the recording's configuration, up to rounding.

        Raises:
            InputError: names the first field that differs.
        """
        own = self.expected()
        for name in RadarConfig.model_fields:
            asked, recorded = getattr(config, name), getattr(own, name)
            if name not in NOT_IN_SAMPLES | {"iq_order"} and not _equal(asked, recorded):
                raise InputError(f"{name} is {asked}, expected {recorded} as in {self.path.name}, which is played")

    def frames(self, config: RadarConfig) -> Iterator[bytes]:
        """Yield the frames, packed for the data format of `config`."""
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
    """LVDS bytes of a frame."""
    return encode(frame, config).astype("<i2", copy=False).tobytes()


def _equal(first: object, second: object) -> bool:
    one, other = (value if isinstance(value, tuple) else (value,) for value in (first, second))
    if not all(isinstance(number, float) for number in one + other):
        return first == second
    return len(one) == len(other) and np.allclose(np.array(one), np.array(other), rtol=_ROUNDING, atol=0)
