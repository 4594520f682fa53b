"""Recording a stream, whatever ends it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from threading import Event

from radarize.capture.stream import Stream, follow
from radarize.errors import InputError, first_line
from radarize.recording import RecordingWriter

#: Frames written at once, at most.
_BATCH = 16


@contextmanager
def recording(stream: Stream, output: Path, overwrite: bool = False) -> Iterator[RecordingWriter]:
    """A writer of a stream's frames. Whatever ends it, the recording is whole under its own name; where the disk does
    not permit that, what is left is named, and how to rescue it.

    Args:
        stream: an open one.
        output: recording to write.
        overwrite: replace one that came from a radar.

    Raises:
        InputError: it cannot be written; or of whatever went wrong, with the frames that are kept.
    """
    about = {"cfg_text": stream.text, "attributes": stream.facts}
    writer = RecordingWriter(output, stream.config, **about, overwrite=overwrite)
    ended: BaseException | None = None
    try:
        yield writer
    except BaseException as error:
        ended = error
    early = [f"it ended early: {_sentence(ended)}"] if ended else []
    warnings = [*stream.troubles(), *writer.losses.warnings(), *early]
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
    stream: Stream,
    output: Path,
    stopping: Event,
    *,
    frames: int | None = None,
    overwrite: bool = False,
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
        overwrite: replace a recording that came from a radar.
        progress: called with frames done and wanted (0: until stopped).

    Raises:
        InputError: nothing came, or something went wrong, with what is kept; see `recording`.
    """
    batches = follow(stream, stopping, most=_BATCH, frames=frames)
    if (first := next(batches, None)) is None:
        raise InputError(f"{output}: not written, since no whole frame came before the end")
    with recording(stream, output, overwrite) as writer:
        for batch in chain([first], batches):
            writer.append(batch["adc"], batch["time"], batch["valid"])
            progress(int(batch["number"][-1]) + 1, frames or 0)
    return output
