"""What every foreign format is opened as."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Int16

from radarize.radar.config import RadarConfig

#: Bytes of samples handled at a time, whatever the length of the source.
BATCH_BYTES = 16 << 20


def batch_frames(config: RadarConfig) -> int:
    """Frames in a batch."""
    return max(1, BATCH_BYTES // config.frame_bytes)


@dataclass
class Capture:
    """An opened source.

    Attributes:
        config: radar configuration.
        cfg_text: text it was read from, if any.
        batches: words of whole frames as the radar sent them, and per chirp (physical order) whether it is whole;
            there is at least one batch, or taking the first raises InputError.
        expected_frames: estimate for progress bars.
        assumed: settings that nobody gave.
        warnings: what the user should know; complete once `batches` is exhausted.
        attributes: facts to store with the recording.
    """

    config: RadarConfig
    cfg_text: str
    batches: Iterable[tuple[Int16[np.ndarray, "word"], Bool[np.ndarray, "frame loop tx"]]]
    expected_frames: int
    assumed: tuple[str, ...] = ()
    warnings: list[str] = field(default_factory=list)
    attributes: dict[str, object] = field(default_factory=dict)
