"""Figures in the pages are those of the results."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: Columns of the ranking, of the results' and in the page.
COLUMNS = {
    "ghosts, % of returns": "ghosts, % of returns",
    "missed surfaces, % of bearings": "surfaces missed, %",
    "map F1, %": "map F1, %",
    "ATE of scan matching, m": "odometry by these scans, m",
    "SLAM ATE, m": "SLAM, m",
}


def rows(page: str, title: str | None = None) -> list[dict]:
    """Of a page's table; of its first one unless told."""
    tables = json.loads((ROOT / "benchmarks" / "results" / f"{page}.json").read_text())["tables"]
    return next(table["rows"] for table in tables if title in (None, table["title"]))


def test_the_ranking_is_that_of_the_stress_test():
    ranking = [row for row in rows("multipath") if row["levels"] == "most severe"]
    lines = ["| scans by | " + " | ".join(COLUMNS.values()) + " |", "|---" * (1 + len(COLUMNS)) + "|"]
    for row in ranking:
        digits = {name: 3 if name.endswith(", m") else 1 for name in COLUMNS}
        lines.append(f"| {row['scans']} | " + " | ".join(f"{row[name]:.{digits[name]}f}" for name in COLUMNS) + " |")
    assert "\n".join(lines) in (ROOT / "docs" / "about" / "results.md").read_text(), "\n".join(lines)


#: Test walks by place, as columns of the pages' tables.
PLACES = ((117, 132), (227, 230, 233, 237, 242), (248, 250))


def mean(found: list[dict], method: str, column: str, walks: tuple[int, ...]) -> float:
    values = [row[column] for row in found if row["method"] == method and row["walk"] in walks]
    assert len(values) == len(walks)
    return sum(values) / len(values)


def cells(method: str, column: str, places: Sequence[tuple[int, ...]]) -> str:
    """By instant, and in brackets by number."""
    found = rows("real", "Real walks")
    both = [[mean(found, method, by + column, walks) for by in ("instant_", "")] for walks in places]
    return " | ".join(f"{instant:.2f} ({number:.2f})" for instant, number in both)


@pytest.mark.parametrize(("page", "methods"), [
    ("README.md", ("cfar", "network", "radarhd-simulated", "RadarHD")),
    ("docs/about/results.md", ("picture", "cfar", "network", "radarhd-simulated", "RadarHD")),
])  # fmt: skip
def test_distances_on_real_walks_are_those_of_the_results(page, methods):
    text = (ROOT / page).read_text().replace("**", "")
    for method in methods:
        assert f"| {cells(method, 'chamfer_m', PLACES)} |" in text, method


def test_turns_and_maps_of_real_walks_are_those_of_the_results():
    text = (ROOT / "docs/about/results.md").read_text()
    for method in ("network", "network, smoothed", "shifted pictures, smoothed"):
        assert f"| {cells(method, 'yaw_rmse_deg', PLACES[:2])} |" in text, method
    moving, maps = PLACES[0] + PLACES[1], rows("real", "SLAM and maps")
    for method in ("network", "radarhd-simulated", "RadarHD", "lidar"):
        off, f1 = (mean(maps, method, column, moving) for column in ("ate_m", "map_f1_20cm"))
        assert f"| {off:.2f} | {100 * f1:.0f} |" in text, method


def test_other_radars_are_those_of_the_results():
    """Without networks, and what is chosen for each radar."""
    text = (ROOT / "docs/about/results.md").read_text()
    found = rows("radars")
    for radar in {row["radar"] for row in found}:
        without = next(row for row in found if row["radar"] == radar and row["scans"] == "first-echo")
        chosen = next(row for row in found if row["radar"] == radar and row["chosen"])
        figures = [f"{row[name]:.0f}" for name in ("map F1 %", "within 10 cm %") for row in (without, chosen)]
        line = " | ".join([without["SLAM m"], chosen["SLAM m"], *figures])
        assert f"| {line} |" in text, (radar, line)


def test_walks_in_unseen_buildings_are_those_of_the_results():
    text = (ROOT / "docs/about/results.md").read_text()
    by_platform = rows("odometry", "Steps and trajectories, by platform and building")
    slam = rows("buildings", "SLAM in each building, slips mended")
    for title, method in (("fused", "fused"), ("without networks", "doppler")):
        off = {row["on"]: row["ATE m"] for row in by_platform if row["odometry"] == method}
        figures = [off[on] for on in ("handheld", "cart", "robot", "all")]
        figures += [row["ATE m"] for row in slam if row["odometry"] == method and row["building"] == "mean"]
        line = " | ".join(f"{figure:.3f}" for figure in figures)
        assert f"| {title} | {line} |" in text, line
    shares = ("within 10 cm %", "returned %", "through a wall %", "ghosts left %", "map F1 %")
    for row in rows("mapping"):
        if row["on"] == "all":
            line = " | ".join(f"{row[share]:.1f}" for share in shares)
            assert f"| {row['scans']} | {line} | {row['SLAM ATE m']:.3f} |" in text, line


def test_hard_conditions_are_those_of_the_results():
    text = (ROOT / "docs/about/results.md").read_text()
    shown = text.partition("## Under hard conditions")[2].partition("\n## ")[0]
    times = "times the plain walks'"
    lines = {
        f"| {row['condition']} | {row['odometry m']} | {row['SLAM m']} | {row[times]:.1f} |"
        for row in rows("conditions")
    }
    table = [line for line in shown.splitlines() if " +- " in line]
    assert len(table) > 10 and lines.issuperset(table)


def test_every_second_frame_is_that_of_the_results():
    text = (ROOT / "docs" / "about" / "results.md").read_text()
    for row in rows("every"):
        told = row["odometry, scans"], row["frames"], row["odometry m"], row["SLAM m"], f"{row['map F1 %']:.1f}"
        assert "| " + " | ".join(told) + " |" in text, told


def test_walks_never_looked_at_are_those_of_the_results():
    means = {row["on"]: row for row in rows("unseen")}
    page, readme = ((ROOT / name).read_text() for name in ("docs/about/results.md", "README.md"))
    for title, kind in (("fused odometry", "odometry"), ("SLAM with it", "SLAM")):
        line = " | ".join(means[on][f"{kind} m"] for on in ("handheld", "cart", "robot", "all"))
        worst = max(row[f"{kind} m"] for row in rows("unseen", "Walk by walk"))
        assert f"| {title} | {line} | {worst:.3f} |" in page
    odometry, slam = (float(means["all"][f"{kind} m"].split()[0]) for kind in ("odometry", "SLAM"))
    assert f"{odometry:.2f} and {slam:.3f} m" in readme.replace("\n", " ")


def test_how_strong_echoes_move_is_that_of_the_results():
    (row,) = rows("parallax")
    text = " ".join((ROOT / "docs/about/results.md").read_text().split())
    posts, flashes, between = (row[f"{share}, %"] for share in ("0.75 to 1.25", "-0.2 to 0.2", "0.2 to 0.5"))
    assert f"{row['echoes']} strong echoes" in text
    for words in (
        f"For {posts:.0f} % of their frames",
        f"for {flashes:.0f} % by none",
        f"for {between:.0f} % by 0.2 to 0.5",
    ):
        assert words in text, words
