"""Recordings as files for other programs."""

from collections.abc import Callable
from pathlib import Path

from radarize.errors import InputError
from radarize.radar.cfg import parse_cfg, write_cfg
from radarize.radar.dca1000 import encode
from radarize.recording import Recording
from radarize.replacing import replacing
from radarize.tum import write_tum

_BATCH_BYTES = 16 << 20


def export(recording: Path, to: str, output: Path) -> Path:
    """Write a recording in another format.

    Args:
        recording: ``.h5`` file.
        to: ``dca1000``: ``OUT.bin`` of raw samples and ``OUT.cfg``, as an IWR1843 with a DCA1000 leaves them; ``tum``:
            true poses, ``time x y z qx qy qz qw`` a line.
        output: file to write; ``.bin`` is put in place of any other suffix for ``dca1000``.

    Returns:
        The file written.

    Raises:
        InputError: unknown format, the recording lacks what is asked for, or the file cannot be written.
    """
    if to not in _WRITERS:
        raise InputError(f"export format is {to!r}, expected one of {', '.join(_WRITERS)}")
    with Recording(recording) as source:
        return _WRITERS[to](source, Path(output))


def _dca1000(source: Recording, output: Path) -> Path:
    config = source.config
    # Files are named NAME.bin and NAME.cfg; a suffix such as .v2 belongs to the name.
    stem = output.with_suffix("") if output.suffix in (".bin", ".cfg") else output
    binary, settings = stem.with_name(stem.name + ".bin"), stem.with_name(stem.name + ".cfg")
    text = write_cfg(config)
    if source.cfg_text and _says_the_same(source.cfg_text, config):
        text = source.cfg_text

    with replacing(settings) as part:
        part.write_bytes(text.encode())
    with replacing(binary) as part, part.open("wb") as file:
        for _, adc in source.batches(max(1, _BATCH_BYTES // config.frame_bytes)):
            file.write(encode(adc, config).astype("<i2", copy=False).data)
    return binary


def _says_the_same(text: str, config: object) -> bool:
    try:
        return parse_cfg(text) == config
    except InputError:
        return False


def _tum(source: Recording, output: Path) -> Path:
    if not (source.has("truth/time") and source.has("truth/pose")):
        raise InputError(f"{source.path}: has no true poses (/truth/time and /truth/pose) to write as TUM")
    times, poses = source.read("truth/time"), source.read("truth/pose")
    shared = min(len(times), len(poses))
    return write_tum(output, times[:shared], poses[:shared])


_WRITERS: dict[str, Callable[[Recording, Path], Path]] = {"dca1000": _dca1000, "tum": _tum}
