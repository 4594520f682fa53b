"""The page of trials names existing tests."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_row_names_its_test():
    rows = [line for line in (ROOT / "docs/about/trials.md").read_text().splitlines() if line.startswith("| ")]
    rows = [row for row in rows if not row.startswith("| trial |")]
    assert len(rows) > 30
    for row in rows:
        named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", row)
        assert named, row
        for path, test in named:
            assert f"def {test}" in (ROOT / path).read_text(), row
