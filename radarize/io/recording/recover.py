"""Recordings from what a killed program has left of them."""

import os
from pathlib import Path

from radarize.io.errors import InputError, explained
from radarize.io.locks import hold
from radarize.io.recording.captured import spare
from radarize.io.recording.reader import Recording
from radarize.io.recording.writer import Product, RecordingWriter, Stream

_PART = ".part"
#: Frames that are copied at a time.
_BATCH = 16


def recover(part: Path, output: Path | None = None) -> Path:
    """Make a recording of a ``.part`` that nobody writes any more: of all its whole frames, with all that came along.

    Args:
        part: what was left, which goes when the recording is there.
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
    with Recording(part) as left:
        os.close(hold(part))
        if not len(left):
            raise InputError(f"{part}: holds no whole frame, expected at least one to recover")
        _copied(left, half)
    with explained(f"{output}: cannot be written", OSError):
        os.replace(half, output)
        part.unlink()
    return output


def _copied(left: Recording, output: Path) -> None:
    others = [name for name in left.names() if not name.startswith("radar/")]
    streams, products = along(left, others)
    attributes = {name: value for name, value in left.attributes.items() if name not in ("format", "radarize_version")}
    has_samples = left.has("radar/adc")
    with RecordingWriter(
        output, left.config, cfg_text=left.cfg_text, attributes=attributes, streams=streams, products=products,
        raw=has_samples,
    ) as writer:  # fmt: skip
        for start in range(0, len(left), _BATCH):
            stop = min(start + _BATCH, len(left))
            rows = {name: left.rows(name, start, stop) for name in streams}
            adc = left.adc(start, stop) if has_samples else None
            writer.append(adc, left.times[start:stop], left.valid(start, stop), rows=rows)
        told = [str(attributes["warnings"])] if attributes.get("warnings") else []
        ended = f"recovered from {left.path.name}: what wrote it ended early"
        writer.annotate(warnings="; ".join([*told, *writer.losses.warnings(), ended]))


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
