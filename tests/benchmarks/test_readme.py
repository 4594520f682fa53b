"""Figures in the pages are those of the results."""

import json
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Columns of the ranking, of the results' and in the page.
COLUMNS = {
    "ghosts, % of returns": "ghosts, % of returns",
    "missed surfaces, % of bearings": "surfaces missed, %",
    "map F1, %": "map F1, %",
    "ATE of scan matching, m": "odometry by these scans, m",
    "SLAM ATE, m": "SLAM, m",
}


def test_the_ranking_is_that_of_the_stress_test():
    results = json.loads((ROOT / "benchmarks" / "results" / "multipath.json").read_text())
    rows = [row for row in results["tables"][0]["rows"] if row["levels"] == "most severe"]
    lines = ["| scans by | " + " | ".join(COLUMNS.values()) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for row in rows:
        digits = {name: 3 if name.endswith(", m") else 1 for name in COLUMNS}
        lines.append(f"| {row['scans']} | " + " | ".join(f"{row[name]:.{digits[name]}f}" for name in COLUMNS) + " |")
    assert "\n".join(lines) in (ROOT / "docs" / "about" / "results.md").read_text(), "\n".join(lines)
