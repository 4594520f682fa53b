"""Markdown of tables and docstrings."""

import re
from collections.abc import Iterable, Sequence

from radarize.io.schema import entries, sections


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; cells are Markdown without line breaks."""
    lines = [head, ["---"] * len(head), *([cell(value) for value in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def cell(value: object) -> str:
    """Return the text of a table's cell."""
    return " ".join(str(value).split()).replace("|", "\\|")


def code(text: object) -> str:
    """Return inline code."""
    return f"`{text}`" if str(text) else ""


def plain(text: str) -> str:
    """Return text of a docstring, in which code has two back quotes, as Markdown; angle brackets stay text."""
    return re.sub(r"``([^`]+)``", r"`\1`", text)


def docstring(text: str) -> str:
    """Return a docstring in Google's style as Markdown: sections as lists, examples as code."""
    about, parts = sections(text)
    found = [plain(about.strip())]
    for name, body in parts:
        if name == "Example":
            found.append("```python\n" + "\n".join(line[4:] for line in body.rstrip().splitlines()) + "\n```")
        elif name == "Returns":
            found.append(f"**Returns** {plain(' '.join(body.split()))}")
        else:
            found.append(f"**{name}**\n" + "".join(f"\n- `{names}`: {plain(each)}" for names, each in entries(body)))
    return "\n\n".join(found) + "\n"
