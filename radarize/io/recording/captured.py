"""What came from a radar cannot be made again: it is never replaced unasked, and whatever ends a capture keeps it."""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording.reader import Recording

#: How the attribute ``source`` of such recordings begins.
FROM_RADAR = "radar at "


def spare(output: Path, anything: bool = False) -> None:
    """Refuse to replace a recording of a radar, finished or left behind in a ``.part``.

    Args:
        output: that is to be written.
        anything: refuse also what may be one, as far as anybody can tell: all but recordings that were simulated or
            imported.

    Raises:
        InputError: it would be replaced.
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
                f"{path}: is there already, and what came from a radar cannot be made again{rescue}, expected another "
                "name, or --overwrite of `capture` and `live`"
            )
