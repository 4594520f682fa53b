"""Recordings from what a killed program has left of them."""

import os
from pathlib import Path

from radarize.io.errors import InputError, explained
from radarize.io.files import regular
from radarize.io.locks import hold
from radarize.io.recording.captured import spare
from radarize.io.recording.reader import Recording
from radarize.io.recording.writer import Product, RecordingWriter, Stream

_PART = ".part"
#: Frames that are copied at a time.
_BATCH = 16


def recover(part: Path, output: Path | None = None) -> Path:
    """Make a recording of a ``.part`` that nobody writes any more: of all its whole frames, with all that came along.

    Frames that cannot be unpacked are lost in the recording (zero, and not valid); damaged stamps are made anew, or
    their frames left out, see `Recording`. The attribute ``warnings`` says how many.

    Args:
        part: what was left, which goes when all of it is in the recording.
        output: recording to write; by default the name that it was to have.

    Raises:
        InputError: it is none, holds no whole frame, or is being written; or a recording is there already.
    """
    part = Path(part)
    if output is None and part.suffix != _PART:
        raise InputError(f"{part}: does not end in {_PART}, expected what was left of a recording, or --output")
    output = Path(output) if output else part.with_name(part.name.removesuffix(_PART))
    if output.exists():
        raise InputError(f"{output}: is there already, expected another --output")
    if output.with_name(output.name + _PART) != part:
        spare(output)
    half = output.with_name(output.name + ".recovered")
    regular(part, "what was left of a recording (.h5.part)")
    held = hold(part, others=True)
    try:
        with Recording(part) as left:
            if not len(left):
                raise InputError(f"{part}: holds no whole frame, expected at least one to recover")
            whole = _copied(left, half)
        with explained(f"{output}: cannot be written", OSError):
            os.replace(half, output)
            if whole:
                part.unlink()
    except BaseException:  # nothing of it is needed: the part has it all, and a later attempt starts anew
        for path in (half, half.with_name(half.name + _PART)):
            path.unlink(missing_ok=True)
        raise
    finally:
        os.close(held)
    return output


def _copied(left: Recording, output: Path) -> bool:
    """Write a recording of what is left of one; returns whether all of that is in it."""
    others = [name for name in left.names() if not name.startswith("radar/")]
    gone = [name for name in others if not _readable(left, name)]
    streams, products = along(left, [name for name in others if name not in gone])
    attributes = {name: value for name, value in left.attributes.items() if name not in ("format", "radarize_version")}
    has_samples = left.has("radar/adc")
    with RecordingWriter(
        output, left.config, cfg_text=left.cfg_text, attributes=attributes, streams=streams, products=products,
        raw=has_samples, overwrite=True,
    ) as writer:  # fmt: skip
        for start in range(0, len(left), _BATCH):
            stop = min(start + _BATCH, len(left))
            rows = {name: left.rows(name, start, stop) for name in streams}
            adc = left.adc(start, stop) if has_samples else None
            writer.append(adc, left.times[start:stop], left.valid(start, stop), rows=rows)
        told = [str(attributes["warnings"])] if attributes.get("warnings") else []
        whole = len(left) == left.written and not left.damage and not gone
        ended = f"recovered from {left.path.name}: what wrote it ended early"
        if not whole:
            ended += f"; {left.written} frames were begun there, {len(left)} are here, and it is kept"
        ended += f"; {', '.join(gone)} cannot be read and is left out" if gone else ""
        writer.annotate(warnings="; ".join([*told, *writer.losses.warnings(), *left.damage, ended]))
    return whole


def _readable(left: Recording, name: str) -> bool:
    """Whether a data set is there to be copied; some rows of a stream may be damaged, but not its clock."""
    try:
        left.rows(name, 0, 1) if "clock" in left.file[name].attrs else left.read(name)
    except InputError:
        return False
    return True


def along(recording: Recording, names: list[str]) -> tuple[dict[str, Stream], dict[str, Product]]:
    """What came along with the samples, of some names, as `RecordingWriter` takes it: streams, and what was written
    once."""
    streams: dict[str, Stream] = {}
    products: dict[str, Product] = {}
    for name in names:
        data = recording.file[name]
        unit, about = (str(recording.describe(name)[key]) for key in ("unit", "about"))
        if "clock" in data.attrs:
            clock = str(data.attrs["clock"])
            streams[name] = Stream(data.shape[1:], data.dtype.str, unit, about, clock, recording.labels(name))
        else:
            products[name] = Product(recording.read(name), unit, about)
    return streams, products
