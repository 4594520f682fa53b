"""Version of the simulated physics: a digest of the sources that determine samples and truth of a recording.

Comments, docstrings and blank lines of Python sources have no influence on it.
"""

import ast
import io
import tokenize
from functools import cache
from hashlib import sha256
from pathlib import Path

#: Parts of the simulator without influence on a recording, and scenes, which have digests of their own.
_OTHERS = {"__init__.py", "cli.py", "doctor.py", "webpreview.py", "dataset", "emulator", "machine", "scenes", "twin"}
#: Other sources with influence: the task, which modifies its radar, and the radar model.
_BESIDES = ("radarsim/dataset/variant.py", "radarize/radar")
_DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


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
            text = file.read_text(encoding="utf-8")
            text = _code(text) if file.suffix == ".py" else text
            found.update(f"{file.relative_to(root).as_posix()}\n{text}\n".encode())
    return found.hexdigest()[:16]


def _code(source: str) -> str:
    """Return the lines of a Python source without comments and docstrings."""
    lines = source.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            row, column = token.start
            lines[row - 1] = lines[row - 1][:column]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, _DOCUMENTED) and ast.get_docstring(node, clean=False) is not None:
            first, last = node.body[0].lineno, node.body[0].end_lineno or node.body[0].lineno
            lines[first - 1 : last] = [""] * (last - first + 1)
    return "\n".join(line.rstrip() for line in lines if line.strip())
