"""Commands and scripts that README and docs show for typing."""

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: What is read first, and then, by two readers who each have what it left behind, in this order.
FIRST = "README.md"
THEN = tuple(
    tuple(
        f"docs/{folder}/{name}.md" if folder else f"docs/{name}.md"
        for folder, names in reader
        for name in names.split()
    )
    for reader in (
        (
            ("start", "install simulation map radar"),
            ("howto", "hardware trajectory building clutter people sensors twin board calibrate capture emulate check"),
            ("howto", "import export ros2"),
            ("explain", "simulator odometry slam truth frames"),
            ("", "physics"),
            ("about", "results limits faq others trials"),
        ),
        (("howto", "python datasets gpu train method compare radarhd sizes troubleshooting"),),
    )
)
#: Pages that are generated, or hold nothing to type.
APART = ("docs/reference/", "docs/notebooks/")
PAGES = (FIRST, *THEN[0], *THEN[1])
_FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
_OWN = re.compile(r"`((?:radarize|radarsim|torchrun|make|python) [^`]+)`")
#: What a command has that can be typed: an option, a file, or a name in capitals.
_WHOLE = re.compile(r" -|[./A-Z]|^make")
#: First line of the block that is no command: the tree of the house.
_TREE = "radarize/ "


@dataclass(frozen=True)
class Command:
    """A line to type, or a script.

    Attributes:
        text: the line, without its comment; of a script all of it.
        script: it is Python.
        mentioned: it is a command's name alone, in a sentence.
    """

    text: str
    script: bool = False
    mentioned: bool = False


def commands(page: str) -> list[Command]:
    """Commands of a page: those of its code blocks in order, then those within sentences that no block has."""
    text = (ROOT / page).read_text()
    found = [command for block in _FENCE.finditer(text) for command in _of(block)]
    known = {command.text for command in found}
    sentences = dict.fromkeys(" ".join(words.split()) for words in _OWN.findall(_FENCE.sub("", text)))
    return found + [Command(words, mentioned=not _WHOLE.search(words)) for words in sentences if words not in known]


def _of(block: re.Match) -> Iterator[Command]:
    indent, language, body = block.groups()
    if language == "python":
        yield Command("\n".join(line.removeprefix(indent) for line in body.splitlines()), script=True)
    elif language in ("", "sh") and not body.startswith(_TREE):
        for line in body.splitlines():
            for part in re.split(r"\s+#\s", line)[0].split("&&"):
                if part.strip():
                    yield from _expanded(part.strip())


def _expanded(line: str) -> Iterator[Command]:
    """`make demo` as what it runs."""
    if line != "make demo":
        yield Command(line)
        return
    recipe = subprocess.run(["make", "-n", "-C", ROOT, "demo"], capture_output=True, text=True, check=True).stdout
    for line in recipe.splitlines():
        if line.startswith(".venv/bin/"):
            yield Command(line.removeprefix(".venv/bin/"))
