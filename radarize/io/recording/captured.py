"""Protection of recordings of a real radar, which cannot be repeated, against being replaced."""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording.reader import Recording

#: Start of the attribute ``source`` of recordings of a radar.
FROM_RADAR = "radar at "


def spare(output: Path, anything: bool = False) -> None:
    """Refuse to replace a recording of a radar, complete or interrupted (``.part``).

    Args:
        output: recording to be written.
        anything: refuse also files that may be one, i.e. all but simulated or imported recordings.

    Raises:
        InputError: the output is such a recording.
    """
    part = output.with_name(output.name + ".part")
    for path in (output, part):
        if not path.exists():
            continue
        try:
            with Recording(path) as recording:
                source = recording.attributes.get("source", FROM_RADAR if anything else "")
                real = str(source).startswith(FROM_RADAR)
        except InputError:
            real = anything
        if real:
            rescue = f" (radarize recover {path} makes a recording of it)" if path == part else ""
            raise InputError(
                f"{path}: already exists, and a recording of a radar cannot be repeated{rescue}, expected another "
                "name, or --overwrite of `capture` and `live`"
            )
