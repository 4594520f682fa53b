"""An opened source of any other format."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.io.recording import Product, Stream
from radarize.radar.config import RadarConfig

#: Bytes of samples processed at a time, for sources of any length.
BATCH_BYTES = 16 << 20


def batch_frames(config: RadarConfig, streams: Mapping[str, Stream] | None = None) -> int:
    """Return the number of frames of a batch, each with a row of every stream."""
    rows = sum(math.prod(stream.shape) * np.dtype(stream.dtype).itemsize for stream in (streams or {}).values())
    return max(1, BATCH_BYTES // (config.frame_bytes + rows))


@dataclass
class CapturedFrames:
    """Consecutive frames.

    Attributes:
        frames: samples, I and Q in the order of the capture's configuration.
        valid: per chirp, whether all its samples are present.
        times: stamps, s; None if the source has none: then one frame period apart.
        rows: rows of the capture's streams.
    """

    frames: Int16[np.ndarray, "frame loop tx rx sample 2"]
    valid: Bool[np.ndarray, "frame loop tx"]
    times: Float[np.ndarray, "frame"] | None = None
    rows: Mapping[str, np.ndarray] = field(default_factory=dict)


@dataclass
class Capture:
    """An opened source of samples.

    Attributes:
        cfg_text: text of the configuration, if any.
        batches: batches of frames; taking the first one raises InputError if there is none.
        expected_frames: estimate for progress bars.
        assumed: names of assumed settings.
        warnings: what the user should know; complete once `batches` is exhausted.
        attributes: attributes to store in the recording.
        board_known: whether the source names the board.
        streams, products: further data beside the samples, as for `RecordingWriter`.
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
