"""Import of mmWave Studio captures: ``.bin`` with ``NAME.mmwave.json`` and ``NAME.setup.json`` beside it."""

from collections.abc import Sequence
from pathlib import Path, PureWindowsPath

from radarize.io.errors import InputError
from radarize.io.importers.bin import of_studio, open_bin, parts
from radarize.io.importers.capture import Capture
from radarize.io.importers.format import Format
from radarize.io.importers.parameters import Given
from radarize.radar.boards import named_board
from radarize.radar.cfg import assumed_board
from radarize.radar.studio import load_json, load_studio


def open_studio(source: Path, given: Given) -> Capture:
    """Open a capture from its folder, or from one of its ``.bin`` files.

    Raises:
        InputError: settings or samples are missing or ambiguous; see `open_bin`.
    """
    folder = source if source.is_dir() else source.parent
    settings = _one(folder, "*.mmwave.json")
    setups = sorted(folder.glob("*.setup.json"))
    if len(setups) > 1:
        raise InputError(f"{folder}: has {len(setups)} files *.setup.json, expected one")
    setup = load_json(setups[0]) if setups else {}
    given = given.or_else(*load_studio(settings, setups[0] if setups else None))
    config, _ = given.configure(str(settings))
    files: Sequence[Path]
    files, filled = _captured(setup, folder)
    if not source.is_dir():
        files = parts(source)
    elif not files:
        captures = {parts(path) for path in folder.glob("*.bin")}
        files = captures.pop() if len(captures) == 1 else [_one(folder, "*.bin")]
    warnings = (f"{filled} bytes were lost on capture and filled with zeros",) if filled else ()
    known = named_board(str(setup.get("mmWaveDevice", ""))) is not None or given.overrides.get("board") is not None
    if not known:
        warnings = (*warnings, assumed_board(config))
    return open_bin(files, config, given.cfg_text, warnings=warnings, encoding=given.encoding, layout=given.layout)


def _captured(setup: dict, folder: Path) -> tuple[list[Path], int]:
    """Return the existing sample files that the setup names, and the number of zero-filled bytes in them."""
    captured = setup.get("capturedFiles")
    entries = captured.get("files") if isinstance(captured, dict) else None
    files, filled = [], 0
    for entry in entries if isinstance(entries, list) else ():
        if not isinstance(entry, dict):
            continue
        # The names come from another machine: only their last part is used.
        names = [PureWindowsPath(str(entry.get(key, ""))).name for key in ("processedFileName", "rawFileName")]
        present = [folder / name for name in names if name and (folder / name).is_file()]
        if present and present[0] not in files:
            files.append(present[0])
        summary = entry.get("processedFileSummary")
        count = summary.get("numZeroFillBytes", 0) if isinstance(summary, dict) else 0
        filled += count if isinstance(count, int) else 0
    return files, filled


def _one(folder: Path, pattern: str) -> Path:
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        names = f" ({', '.join(path.name for path in found[:5])})" if found else ""
        raise InputError(f"{folder}: has {len(found)} files {pattern}{names}, expected one")
    return found[0]


def _fits(source: Path) -> bool:
    if source.is_dir():
        return not (source / "metadata.yaml").is_file()
    return source.suffix.lower() == ".bin" and of_studio(source)


FORMAT = Format(
    "folder of mmWave Studio",
    "a folder of mmWave Studio files",
    _fits,
    lambda source, given, _: open_studio(source, given),
    options=("encoding", "layout"),
    last=True,
)
