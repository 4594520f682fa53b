"""``NAME.words``: little-endian int16, ordered frame, loop, tx, rx, sample, I and Q, beside ``NAME.cfg``."""

from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.importers.bin import configured
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.format import Format
from radarize.io.importers.parameters import Given


def open_words(source: Path, given: Given, _: Path) -> Capture:
    """Open a file; stamps, the order of I and Q, and the recording are radarize's business."""
    given = configured(source, given)
    config, assumed = given.configure(str(source))
    count, rest = divmod(source.stat().st_size, config.frame_bytes)
    if rest or not count:
        raise InputError(f"{source}: has {source.stat().st_size} bytes, expected frames of {config.frame_bytes} bytes")
    words = np.memmap(source, "<i2", "r").reshape(count, *config.frame_shape)

    def batches():
        for first in range(0, count, size := batch_frames(config)):
            frames = np.array(words[first : first + size])
            yield CapturedFrames(frames, np.ones(frames.shape[:3], bool))

    return Capture(config, given.cfg_text, batches(), count, assumed)


FORMAT = Format("file of words", "a .words file", lambda source: source.suffix == ".words", open_words)
