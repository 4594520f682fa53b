"""Recovery of interrupted recordings."""

import os
from pathlib import Path

from radarize.io.errors import InputError, explained
from radarize.io.files import regular
from radarize.io.locks import hold
from radarize.io.recording.captured import spare
from radarize.io.recording.reader import Recording
from radarize.io.recording.writer import Product, RecordingWriter, Stream

_PART = ".part"
#: Number of frames copied at a time.
_BATCH = 16


def recover(part: Path, output: Path | None = None) -> Path:
    """Write a recording from a ``.part`` that is no longer being written, with all complete frames and other data.

    Frames that cannot be unpacked are lost in the recording (zero, and not valid); damaged stamps are interpolated, or
    their frames left out, see `Recording`. The attribute ``warnings`` has the numbers.

    Args:
        part: interrupted recording; deleted if all of it was recovered.
        output: recording to write; by default the name that the interrupted one was to have.

    Raises:
        InputError: not an interrupted recording, without a complete frame, or still being written; or the output
            exists.
    """
    part = Path(part)
    if output is None and part.suffix != _PART:
        raise InputError(f"{part}: does not end in {_PART}, expected an interrupted recording, or --output")
    output = Path(output) if output else part.with_name(part.name.removesuffix(_PART))
    if output.exists():
        raise InputError(f"{output}: already exists, expected another --output")
    if output.with_name(output.name + _PART) != part:
        spare(output)
    half = output.with_name(output.name + ".recovered")
    regular(part, "an interrupted recording (.h5.part)")
    held = hold(part, others=True)
    try:
        with Recording(part) as left:
            if not len(left):
                raise InputError(f"{part}: has no complete frame, expected at least one")
            whole = _copied(left, half)
        with explained(f"{output}: cannot be written", OSError):
            os.replace(half, output)
            if whole:
                part.unlink()
    except BaseException:  # the part still has everything, and another attempt starts anew
        for path in (half, half.with_name(half.name + _PART)):
            path.unlink(missing_ok=True)
        raise
    finally:
        os.close(held)
    return output


def _copied(left: Recording, output: Path) -> bool:
    """Write a recording from an interrupted one; return whether all of it was recovered."""
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
        warnings = [str(attributes["warnings"])] if attributes.get("warnings") else []
        whole = len(left) == left.written and not left.damage and not gone
        ended = f"recovered from {left.path.name}, which was interrupted"
        if not whole:
            ended += f"; {left.written} frames were begun there, {len(left)} are here, and it is kept"
        ended += f"; {', '.join(gone)} cannot be read and is left out" if gone else ""
        writer.annotate(warnings="; ".join([*warnings, *writer.losses.warnings(), *left.damage, ended]))
    return whole


def _readable(left: Recording, name: str) -> bool:
    """Return whether a data set can be copied; some rows of a stream may be damaged, but not its clock."""
    try:
        left.rows(name, 0, 1) if "clock" in left.file[name].attrs else left.read(name)
    except InputError:
        return False
    return True


def along(recording: Recording, names: list[str]) -> tuple[dict[str, Stream], dict[str, Product]]:
    """Return the further data sets of these names as `RecordingWriter` takes them: streams, and products written
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
