"""Figures in README and docs, from the parts of the pages of results: `python -m benchmarks.figures` updates them.

A figure is enclosed by two comments; `FIGURES` has the functions that write them:

    On test walks the mean error is <!-- figures: walks-mean -->0.13 and 0.034 m<!-- end -->.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.results import PARTS
from radarize.evaluation.benchmark.results import Results

ROOT = Path(__file__).parents[1]
_MARKED = re.compile(r"(<!-- figures: ([\w-]+) -->).*?(<!-- end -->)", re.DOTALL)
#: RadarHD's test walks by place.
PLACES = ((117, 132), (227, 230, 233, 237, 242), (248, 250))
METHODS = {
    "cfar": "CFAR",
    "network": "our network, from simulation alone",
    "radarhd-simulated": "RadarHD's network, width 8, 43 minutes of training, from simulation alone",
    "RadarHD": "RadarHD, from 25 real walks",
}
#: Public lidar logs.
LOGS = ("intel", "csail", "orebro")
Row = Mapping[str, Any]


def rows(part: str, title: str = "") -> list[Row]:
    """Return the rows of a part's first table whose title ends with a text."""
    tables = Results.read(PARTS / f"{part}.json").tables
    return next(table.rows for table in tables if table.title.lower().endswith(title))


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Format a table as Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *lines))


def walks() -> str:
    """Return the table of errors by platform, and of the worst walk."""
    means, each = {row["on"]: row for row in rows("walks", "by platform and building")}, rows("walks", "walk by walk")
    lines = []
    for words, kind in (("odometry", "odometry"), ("SLAM", "SLAM")):
        found = [means[on][f"{kind} m"] for on in ("handheld", "cart", "robot", "all")]
        lines.append([words, *found, f"{max(row[f'{kind} m'] for row in each):.2f}"])
    return table(["mean error, m", "handheld", "cart", "robot", "all", "worst walk"], lines)


def walks_mean() -> str:
    """Return the mean errors of odometry and of SLAM over all walks."""
    mean = next(row for row in rows("walks", "by platform and building") if row["on"] == "all")
    odometry, slam = (float(mean[f"{kind} m"].split()[0]) for kind in ("odometry", "SLAM"))
    return f"{odometry:.2f} and {slam:.3f} m"


def paper() -> str:
    """Return the table of odometry by the paper's protocol, with the paper's results."""
    shown = [row for row in rows("odometry") if isinstance(row["paper: ATE m"], float)]
    lines = [[row["odometry"], f"{row['ATE m']:.2f}", f"{row['paper: ATE m']:.2f}"] for row in shown]
    return table(["odometry", "ATE, m (simulated)", "in the paper (real)"], lines)


def scans() -> str:
    """Return the table of scans and maps by method."""
    head = {"within 10 cm %": 1, "returned %": 1, "ghosts left %": 1, "map F1 %": 1, "SLAM ATE m": 3}
    lines = [
        [row["scans"], *(f"{row[name]:.{digits}f}" for name, digits in head.items())]
        for row in rows("mapping")
        if row["on"] == "all"
    ]
    return table(["scans by", *head], lines)


def multipath() -> str:
    """Return the ranking of scans at the largest severity of multipath."""
    head = {"ghosts, % of returns": 1, "missed surfaces, % of bearings": 1, "map F1, %": 1, "SLAM ATE, m": 3}
    lines = [
        [row["scans"], *(f"{row[name]:.{digits}f}" for name, digits in head.items())]
        for row in rows("multipath")
        if row["levels"] == "most severe"
    ]
    return table(["scans by", *head], lines)


def conditions() -> str:
    """Return the table of plain walks, and of conditions with at least twice their SLAM error."""
    times = "times the plain walks'"
    shown = [row for row in rows("conditions") if row["condition"] == "plain" or row[times] >= 2]
    lines = [[row["condition"], row["odometry m"], row["SLAM m"], f"{row[times]:.1f}"] for row in shown]
    return table(["condition", "odometry, m", "SLAM, m", times], lines)


def radars() -> str:
    """Return the table of each radar without networks, and with its default methods."""
    found, lines = rows("radars"), []
    for radar in dict.fromkeys(row["radar"] for row in found):
        without = next(row for row in found if row["radar"] == radar and row["scans"] == "first-echo")
        chosen = next(row for row in found if row["radar"] == radar and row["chosen"])
        maps = [f"{row['map F1 %']:.0f}" for row in (without, chosen)]
        lines.append([radar, without["SLAM m"], chosen["SLAM m"], *maps])
    return table(["radar", "SLAM without networks, m", "SLAM, m", "map F1 without, %", "map F1, %"], lines)


def real() -> str:
    """Return the table of point-cloud distances on real walks, matched by time, and in brackets by frame index."""
    found, lines = rows("real", "real walks"), []
    for method, words in METHODS.items():
        cells = []
        for place in PLACES:
            some = [row for row in found if row["method"] == method and row["walk"] in place]
            by = [sum(row[f"{way}chamfer_m"] for row in some) / len(place) for way in ("instant_", "")]
            cells.append(f"{by[0]:.2f} ({by[1]:.2f})")
        lines.append([words, *cells])
    return table(["", "building of RadarHD's training", "another building", "standing still"], lines)


def realism() -> str:
    """Return the shares of pictures that a network classifies correctly as real or simulated."""
    shares = rows("realism")[:2]  # the rows of the discriminator: single pictures, pairs
    return " and ".join(f"{row['furnished']:.0f} % of {words}" for row, words in zip(
        shares, ("single pictures", "pairs"), strict=True))  # fmt: skip


def back_end() -> str:
    """Return the table of lidar logs, with Cartographer's results."""
    logs = [row for row in rows("slam_backend") if row["case"] in [f"lidar, {log}" for log in LOGS]]
    lines = [[log, f"{row['ATE m']:.3f} m", row["to beat"].split(",")[0]] for log, row in zip(LOGS, logs, strict=True)]
    return table(["lidar log", "ATE", "Cartographer's at its best settings"], lines)


#: Figures by name.
FIGURES: dict[str, Callable[[], str]] = {
    "walks": walks, "walks-mean": walks_mean, "paper": paper, "scans": scans, "multipath": multipath,
    "conditions": conditions, "radars": radars, "real": real, "realism": realism, "back-end": back_end,
}  # fmt: skip


def written(text: str) -> str:
    """Return the text of a page with its figures updated.

    Raises:
        KeyError: an unknown figure.
    """

    def anew(found: re.Match[str]) -> str:
        figure = FIGURES[found[2]]()
        around = "\n\n" if "\n" in figure else ""  # a table is a paragraph of its own
        return found[1] + around + figure + around + found[3]

    return _MARKED.sub(anew, text)


def pages() -> list[Path]:
    """Return all pages that have figures."""
    return [page for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) if "<!-- figures: " in
            page.read_text()]  # fmt: skip


def main() -> None:
    for page in pages():
        page.write_text(written(page.read_text()))
        print(page.relative_to(ROOT))


if __name__ == "__main__":
    main()
