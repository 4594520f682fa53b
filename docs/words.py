"""Find words that are not the field's (words.yaml) in code, docs and help; `make lint` runs it.

python docs/words.py [FILE ...]
"""

import re
import subprocess
import sys
from pathlib import Path

import yaml

HERE = Path(__file__).parent
#: Text by people. Pages of results are written by scripts; words.yaml has the words themselves, and so has CHANGELOG,
#: which lists old names.
FILES = (
    "*.py",
    "*.md",
    "*.yaml",
    "*.toml",
    "Makefile",
    ":!benchmarks/results",
    ":!docs/words.*",
    ":!tests/documents/test_words.py",
    ":!CHANGELOG.md",
)
#: First words of a page that `python -m docs.reference` writes from docstrings, which are checked where they are.
_WRITTEN = "<!-- Written by"


def findings(path: Path, words: dict[re.Pattern[str], str], excepted: re.Pattern[str]) -> list[str]:
    """One line per word found: file, line number, word and what to write instead."""
    found: list[str] = []
    lines = path.read_text().splitlines()
    if lines and lines[0].startswith(_WRITTEN):
        return found
    for number, line in enumerate(lines, 1):
        text = excepted.sub("", line)
        for pattern, instead in words.items():
            found += [f"{path}:{number}: {word[0]!r}: write {instead}" for word in pattern.finditer(text)]
    return found


def rules() -> tuple[dict[re.Pattern[str], str], re.Pattern[str]]:
    """Return the patterns of words with what to write instead, and the pattern of exceptions."""
    known = yaml.safe_load((HERE / "words.yaml").read_text())
    words = {re.compile(pattern, re.IGNORECASE): instead for pattern, instead in known["words"].items()}
    return words, re.compile("|".join(map(re.escape, known["except"])), re.IGNORECASE)


def main(files: list[str]) -> int:
    """Print the words found in these files, or in all of the repository; the exit status is 1 if there are any."""
    words, excepted = rules()
    files = files or subprocess.check_output(["git", "ls-files", "--", *FILES], text=True).split("\n")[:-1]
    found = [each for file in files for each in findings(Path(file), words, excepted)]
    print("\n".join(found[:200]) or "words: nothing found")
    if found:
        print(f"{len(found)} words that words.yaml replaces")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
