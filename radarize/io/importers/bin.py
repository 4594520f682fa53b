"""Import of raw ``.bin`` files of a DCA1000: words only, from the start of the first frame.

Long captures are split into ``NAME_Raw_0.bin``, ``NAME_Raw_1.bin``, ... at any byte.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int16

from radarize.io.errors import InputError
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.format import Format
from radarize.io.importers.layout import arranged, likely, recorded
from radarize.io.importers.parameters import Given
from radarize.io.importers.resync import Judge, Pieces, read_range
from radarize.io.importers.words import oddity, signed
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import check_layout
from radarize.radar.presets import load_config

#: Bytes that are examined for the encoding, and for the period.
_LOOKED_AT, _PERIODS = 1 << 20, 1 << 21
#: Maximum ratio of the samples' loop to the configured one: three transmitters, where one is configured.
_LONGEST = 3
#: Minimum ratio of a period's correlation to that of its multiple, which is the best. Between receivers it is up to
#: 0.98 in the static room of the public IWR6843 capture.
_AS_GOOD = 0.99
_PART = re.compile(r"(?P<name>.+)_Raw_(?P<number>\d+)\.bin", re.IGNORECASE)


def parts(source: Path) -> tuple[Path, ...]:
    """Return all files of the capture that a ``.bin`` belongs to, in order: itself, unless its name is that of a part.

    Raises:
        InputError: a part is missing.
    """
    if not (match := _PART.fullmatch(source.name)):
        return (source,)
    numbered = {}
    for path in source.parent.iterdir():
        other = _PART.fullmatch(path.name)
        if other and other["name"] == match["name"]:
            numbered[int(other["number"])] = path
    if missing := sorted(set(range(max(numbered) + 1)) - numbered.keys()):
        raise InputError(
            f"{source.parent}: has parts {', '.join(map(str, sorted(numbered)))} of {match['name']}_Raw_*.bin, "
            f"expected part {missing[0]} too"
        )
    return tuple(numbered[number] for number in sorted(numbered))


def whole_name(source: Path) -> Path:
    """Return the name of a capture without the number of its part; its settings may be in ``NAME.cfg``."""
    match = _PART.fullmatch(source.name)
    return source.with_name(match["name"] + ".bin") if match else source


def all_zero(words: Int16[np.ndarray, "word"], config: RadarConfig) -> Bool[np.ndarray, "frame loop tx"]:
    """Return chirps (physical order) with zeros only, which capture programs write where packets were lost."""
    loops, tx = config.frame_shape[:2]
    fired = np.any(words.reshape(-1, loops, tx, 2 * config.samples * len(config.rx)), axis=3)
    return ~fired[:, :, list(config.slot)]


def open_bin(
    files: Sequence[Path],
    config: RadarConfig,
    cfg_text: str = "",
    assumed: tuple[str, ...] = (),
    warnings: Sequence[str] = (),
    encoding: str = "signed",
    layout: str = "pairs",
) -> Capture:
    """Open raw files that follow each other.

    Args:
        encoding, layout: of the words, see `radarize.io.importers.words` and `radarize.io.importers.layout`.

        Where bytes are missing, the following ones are moved to their correct place; if frames change their size, the
        rest is left out; both give a warning (`radarize.io.importers.resync`). An incomplete last frame is left out
        with a warning, unless the samples show that the configuration does not fit. Words that contradict `encoding`
        give a warning too. Chirps with zeros only count as lost, since capture programs replace lost packets by zeros.

    Raises:
        InputError: less than one frame, or the samples have another period than the configuration's loop.
    """
    given, config = config, recorded(config, layout)
    check_layout(config)
    warnings = list(warnings)
    size = sum(path.stat().st_size for path in files)
    whole, rest = divmod(size, config.frame_bytes)
    loops, tx, rx, samples, _ = config.frame_shape
    name = ", ".join(str(path) for path in files)
    each = f"{config.frame_bytes} bytes a frame ({loops} loops x {tx} TX x {rx} RX x {samples} samples x 4 bytes)"
    if not whole:
        raise InputError(f"{name}: has {size} bytes, less than one frame; expected a multiple of {each}")
    with files[0].open("rb") as file:
        begins = file.read(_LOOKED_AT)
    words = signed(np.frombuffer(begins, "<i2", len(begins) // 2), encoding)
    pieces = Pieces([(range(size), 0)])
    if odd := oddity(begins, encoding):
        warnings.append(f"{name}: {odd}")
    elif (other := likely(words, given, layout)) != layout:
        warnings.append(f"{name}: its words are probably {other}, not {layout}: use --layout {other}")
    elif layout == "pairs" and (period := other_period(read_range(files, 0, _PERIODS), config)):
        expected = tx * rx * samples
        message = (
            f"{name}: has {size} bytes, {whole} frames and {rest} bytes of {each}, but its samples repeat every "
            f"{period} and not every {expected} (TX x RX x samples), expected the configuration of this capture"
        )
        if rest:
            raise InputError(message)
        warnings.append(message)
    else:
        if layout == "pairs" and encoding == "signed":
            pieces, period = _judged(files, size, config)
            warnings += pieces.warnings(name)
            whole, rest = divmod(pieces.size, config.frame_bytes)
            if pieces.ends is not None:
                warnings.append(
                    f"{name}: from byte {pieces.ends} on, samples repeat every {period} and not every "
                    f"{tx * rx * samples} as before; {size - pieces.ends} bytes are left out, expected equal frames"
                )
        if rest:
            warnings.append(
                f"{name}: has {size} bytes, {whole} whole frames and {rest} bytes of an incomplete one, which is left "
                f"out; expected {each}"
            )
    read = partial(arranged, config=config, layout=layout)
    return Capture(config, cfg_text, _batches(files, pieces, config, encoding, read), whole, assumed, warnings)


def _batches(
    files: Sequence[Path],
    pieces: Pieces,
    config: RadarConfig,
    encoding: str,
    read: Callable[[np.ndarray], np.ndarray],
) -> Iterator[CapturedFrames]:
    for data in pieces.blocks(partial(read_range, files), batch_frames(config) * config.frame_bytes):
        words = np.frombuffer(data, "<i2", len(data) // config.frame_bytes * config.frame_bytes // 2)
        words = words.astype(np.int16, copy=False)
        if words.size:
            yield CapturedFrames(read(signed(words, encoding)), ~all_zero(words, config))


def _judged(files: Sequence[Path], size: int, config: RadarConfig) -> tuple[Pieces, int | None]:
    """Return the pieces of a capture, and the period of the samples after them, if they end early."""

    def period(start: int) -> int | None:
        return other_period(read_range(files, start, start + _PERIODS), config)

    pieces = Judge(partial(read_range, files), size, config, period).pieces()
    return pieces, None if pieces.ends is None else period(pieces.ends)


def other_period(data: bytes, config: RadarConfig) -> int | None:
    """Return the number of complex samples after which the capture repeats, if it differs from the configured loop.

    Chirps of one transmitter and receiver are similar from loop to loop, so the magnitude of the autocorrelation peaks
    at the length of a loop. None if the peak is there, or nowhere distinct.
    """
    loop = config.frame_bytes // 4 // config.loops
    words = np.frombuffer(data, "<i2", len(data) // 8 * 4)
    pairs = words.reshape(-1, 2, 2).astype(np.float32)  # the other order of I and Q gives the mirror image
    signal = (pairs[:, 0] + 1j * pairs[:, 1]).reshape(-1)
    signal -= signal.mean()
    longest = min(_LONGEST * loop, len(signal) // 2)
    if loop > longest or not signal.any():
        return None
    spectrum = np.fft.fft(signal, 2 * len(signal))
    correlation = np.abs(np.fft.ifft(np.abs(spectrum) ** 2)[: longest + 1])
    correlation *= len(signal) / (len(signal) - np.arange(longest + 1)) / correlation[0]
    candidates = np.arange(loop // 2 & ~1, longest + 1, 2)
    best = int(candidates[np.argmax(correlation[candidates])])
    if correlation[best] < 0.7 or correlation[loop] > 0.5 * correlation[best]:
        return None
    # A multiple of the period is equally good; a period much shorter than a loop is that between receivers.
    parts = [best // count for count in (4, 3, 2) if best % (2 * count) == 0 and best // count >= candidates[0]]
    return next((part for part in parts if correlation[part] > _AS_GOOD * correlation[best]), best)


def configured(source: Path, given: Given) -> Given:
    """Return the settings with the ``.cfg`` beside the source, of the same name, unless a configuration is given."""
    beside = whole_name(source).with_suffix(".cfg")
    return given.or_else(*load_config(beside)) if given.config is None and beside.is_file() else given


def _open(source: Path, given: Given, _: Path) -> Capture:
    given = configured(source, given)
    config, assumed = given.configure(str(source))
    return open_bin(parts(source), config, given.cfg_text, assumed, encoding=given.encoding, layout=given.layout)


def of_studio(source: Path) -> bool:
    """Return whether the settings of mmWave Studio are beside a ``.bin``, and no ``.cfg`` of its name."""
    configured = whole_name(source).with_suffix(".cfg").is_file()
    return not configured and len(list(source.parent.glob("*.mmwave.json"))) == 1


def _fits(source: Path) -> bool:
    return source.suffix.lower() == ".bin" and not source.is_dir() and not of_studio(source)


FORMAT = Format(".bin", "a DCA1000 .bin", _fits, _open, options=("encoding", "layout"))
