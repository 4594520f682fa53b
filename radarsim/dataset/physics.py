"""Version of the simulated physics: a digest of the sources that determine samples and truth of a recording."""

from functools import cache
from hashlib import sha256
from pathlib import Path

#: Parts of the simulator without influence on a recording, and scenes, which have digests of their own.
_OTHERS = {"__init__.py", "cli.py", "doctor.py", "webpreview.py", "dataset", "emulator", "machine", "scenes", "twin"}
#: Other sources with influence: the task, which modifies its radar, and the radar model.
_BESIDES = ("radarsim/dataset/variant.py", "radarize/radar")


@cache
def digest(root: Path = Path(__file__).parents[2]) -> str:
    """Return a digest of sources and tables that is the same wherever they are installed.

    Args:
        root: folder of the packages `radarsim` and `radarize`.
    """
    places = [path for path in (root / "radarsim").iterdir() if path.name not in _OTHERS]
    places += [root / path for path in _BESIDES]
    found = sha256()
    for file in sorted(file for place in places for file in ([place] if place.is_file() else place.rglob("*"))):
        if file.suffix in (".py", ".yaml"):
            found.update(f"{file.relative_to(root).as_posix()}\n".encode() + file.read_bytes())
    return found.hexdigest()[:16]
