"""What every foreign format is opened as."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.io.recording import Product, Stream
from radarize.radar.config import RadarConfig

#: Bytes of samples handled at a time, whatever the length of the source.
BATCH_BYTES = 16 << 20


def batch_frames(config: RadarConfig, streams: Mapping[str, Stream] | None = None) -> int:
    """Frames in a batch, with a row of each stream for each of them."""
    rows = sum(math.prod(stream.shape) * np.dtype(stream.dtype).itemsize for stream in (streams or {}).values())
    return max(1, BATCH_BYTES // (config.frame_bytes + rows))


@dataclass
class CapturedFrames:
    """Frames that follow each other.

    Attributes:
        frames: samples, I and Q in the order that the capture's configuration claims.
        valid: per chirp, whether its samples are all there.
        times: stamps, s; None where the source has none: then a frame period apart.
        rows: of the capture's streams.
    """

    frames: Int16[np.ndarray, "frame loop tx rx sample 2"]
    valid: Bool[np.ndarray, "frame loop tx"]
    times: Float[np.ndarray, "frame"] | None = None
    rows: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass
class Capture:
    """An opened source.

    Attributes:
        cfg_text: text it was read from, if any.
        batches: there is at least one, or taking the first raises InputError.
        expected_frames: estimate for progress bars.
        assumed: settings that nobody gave.
        warnings: what the user should know; complete once `batches` is exhausted.
        attributes: facts to store with the recording.
        board_known: it says which board made it.
        streams, products: what came along with the samples, as `RecordingWriter` takes them.
    """

    config: RadarConfig
    cfg_text: str
    batches: Iterable[CapturedFrames]
    expected_frames: int
    assumed: tuple[str, ...] = ()
    warnings: list[str] = field(default_factory=list)
    attributes: dict[str, object] = field(default_factory=dict)
    board_known: bool = False
    streams: Mapping[str, Stream] = field(default_factory=dict)
    products: Mapping[str, Product] = field(default_factory=dict)
