"""Recording of a stream to a file, which stays whole however the stream ends."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from threading import Event

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.capture.stream import FrameStream, follow
from radarize.io.errors import DiskFull, InputError, first_line
from radarize.io.recording import RecordingWriter

#: Largest number of frames written at once.
_BATCH = 16
#: s that a recording waits for space on a full disk before it ends.
PATIENCE = 60.0


class Keeper:
    """Append frames to a recording; frames that arrive while the disk is full are left out.

    Attributes:
        left_out: number of frames left out.
    """

    def __init__(self, writer: RecordingWriter):
        self.writer, self.left_out = writer, 0
        self._full_since: float | None = None

    def append(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        stamps: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"],
    ) -> None:
        """Append frames, or leave them out if the disk is full.

        Raises:
            InputError: they cannot be appended, or the disk has been full for too long.
        """
        appended = self.writer.losses.frames
        try:
            self.writer.append(adc, stamps, valid)
            self._full_since = None
        except DiskFull as error:
            now = time.monotonic()
            if self._full_since is None:
                self._full_since = now
                print(f"warning: {error}; frames are left out, for up to {PATIENCE:g} s", file=sys.stderr)
            if now - self._full_since >= PATIENCE:
                raise
        self.left_out += len(stamps) - (self.writer.losses.frames - appended)

    def warnings(self) -> list[str]:
        """A warning if frames were left out."""
        return [f"{self.left_out} frames are left out, since the disk was full"] if self.left_out else []


@contextmanager
def recording(stream: FrameStream, output: Path, overwrite: bool = False) -> Iterator[Keeper]:
    """Open a recording of a stream's frames. However it ends, the recording is completed under its own name; if the
    disk does not permit that, the error names the partial file and how to recover it.

    Args:
        stream: open stream.
        output: recording to write.
        overwrite: replace an existing recording of a radar.

    Raises:
        InputError: the file cannot be written, or any later error, with the number of frames that are kept.
    """
    writer = RecordingWriter(output, stream.config, cfg_text=stream.text, attributes=stream.facts, overwrite=overwrite)
    keeper = Keeper(writer)
    ended: BaseException | None = None
    try:
        yield keeper
    except BaseException as error:
        ended = error
    early = [f"it ended early: {_sentence(ended)}"] if ended else []
    warnings = [*stream.troubles(), *keeper.warnings(), *writer.losses.warnings(), *early]
    writer.annotate(warnings="; ".join(warnings), first_packet_time=stream.counts.first)
    kept = str(output)
    try:
        writer.close()
    except InputError as error:
        ended, kept = ended or error, f"{writer.part}, of which radarize recover {writer.part} makes a recording"
    if ended:
        raise InputError(f"{_sentence(ended)}; {writer.frames} whole frames are kept in {kept}") from ended


def _sentence(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "stopped"
    if isinstance(error, InputError):
        return str(error)
    return f"internal error, {type(error).__name__}: {first_line(error)}"


def record(
    stream: FrameStream,
    output: Path,
    stopping: Event,
    *,
    frames: int | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Record a stream until the user stops it, the number of frames is reached, or no more frames arrive.

    Lost samples are zero and marked; frames for which the disk is too slow, or temporarily full, are left out. Time
    stamps are those of the radar's clock, from 0 on, whatever was lost. The recording's attribute ``warnings`` contains
    the warnings.

    Args:
        stream: open stream; stopped here.
        output: recording to write; it exists, and is whole, if a frame was received.
        stopping: event that ends the recording.
        frames: end after this number of frames.
        overwrite: replace an existing recording of a radar.
        progress: called with frames done and total (0: until stopped).

    Raises:
        InputError: no frame was received, or another error, with what is kept; see `recording`.
    """
    batches = follow(stream, stopping, most=_BATCH, frames=frames)
    if (first := next(batches, None)) is None:
        raise InputError(f"{output}: not written, since no whole frame came before the end")
    with recording(stream, output, overwrite) as keeper:
        for batch in chain([first], batches):
            keeper.append(batch["adc"], batch["time"], batch["valid"])
            progress(int(batch["number"][-1]) + 1, frames or 0)
    return output
