"""Recording a stream."""

from collections.abc import Callable
from itertools import chain
from pathlib import Path
from threading import Event

from radarize.capture.stream import Stream, follow
from radarize.errors import InputError
from radarize.recording import RecordingWriter

#: Frames written at once, at most.
_BATCH = 16


def record(
    stream: Stream,
    output: Path,
    stopping: Event,
    *,
    frames: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a stream's frames to a recording until the user stops it, there are enough, or nothing comes any more.

    Lost samples are zero and marked; frames that were dropped because the disk is too slow are left out. Stamps are
    those of the radar's clock, from 0 on, whatever was lost. What the user should know is joined in the recording's
    attribute ``warnings``.

    Args:
        stream: an open one; stopped here.
        output: recording to write; it is there, and whole, if a frame came.
        stopping: set when the user wants to end.
        frames: end after so many.
        progress: called with frames done and wanted (0: until stopped).

    Raises:
        InputError: nothing came, or the file cannot be written; frames written before are kept in its ``.part``.
    """
    batches = follow(stream, stopping, most=_BATCH, frames=frames)
    if (first := next(batches, None)) is None:
        raise InputError(f"{output}: not written, since no whole frame came before the end")
    with RecordingWriter(output, stream.config, cfg_text=stream.text, attributes=stream.facts) as writer:
        for batch in chain([first], batches):
            writer.append(batch["adc"], batch["time"], batch["valid"])
            progress(int(batch["number"][-1]) + 1, frames or 0)
        warnings = stream.troubles() + writer.losses.warnings()
        writer.annotate(warnings="; ".join(warnings), first_packet_time=stream.counts.first)
    return output
