"""The page of troubleshooting quotes messages that this project prints."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "howto" / "troubleshooting.md"


def test_every_message_is_in_the_code():
    files = [path for package in ("radarize", "radarsim") for path in (ROOT / package).rglob("*.py")]
    joined = re.compile(r'"\s*f?"')  # literals that Python joins
    code = re.sub(r"\s+", " ", "\n".join(joined.sub("", path.read_text()) for path in files))
    tables = PAGE.read_text().split("## Results look wrong")[0]
    first = re.findall(r"^\| (`.*?) \|", tables, re.MULTILINE)
    quoted = [text for cell in first for text in re.findall("`([^`]+)`", cell)]
    assert len(quoted) > 30
    assert not [text for text in quoted if text not in code]
