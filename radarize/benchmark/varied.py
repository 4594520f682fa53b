"""What changes as one thing is varied: the severity of multipath, or a parameter of the radar."""

from collections.abc import Sequence

from radarize.benchmark.benchmark import Chosen, Study
from radarize.benchmark.dataset import DataSet
from radarize.benchmark.runs import Pair
from radarize.benchmark.table import Table, at, mean
from radarize.evaluation.page import Page
from radarize.evaluation.stress import FIGURES, SOURCES, curves
from radarize.methods import CLASSICAL, ODOMETRY, SCANS

#: Where figures of `radarize.evaluation.stress` stand in those of a run.
PLACES = {
    **{name: ("sources", name) for name in SOURCES},
    "missed": ("missed",),
    "map_f1": ("map", "f1"),
    "odometry": ("odometry", "ate", "position", "mean"),
    "slam": ("slam", "ate", "position", "mean"),
}
#: Those that are drawn.
DRAWN = ("ghosts", "missed", "map_f1", "odometry")


def lacks_stress(data: DataSet) -> str:
    """Whether recordings say how severe their multipath is."""
    return _lacks(data, "stress", "severity", "radarsim dataset stress")


def lacks_ablation(data: DataSet) -> str:
    """Whether recordings say what is varied."""
    return _lacks(data, "ablation", "value", "radarsim dataset ablation/bandwidth")


def _lacks(data: DataSet, panel: str, over: str, hint: str) -> str:
    if any({panel, over} <= case.attributes.keys() for case in data.cases):
        return ""
    return f"no recording has attributes {panel} and {over}, expected a data set such as that of `{hint}`"


def classical_pairs(chosen: Chosen) -> list[Pair]:
    """Methods without networks, which read one radar alone: each odometry, and all scans with one of them."""
    plain = Pair(**CLASSICAL)
    return [
        *(Pair(name, plain.scans) for name in chosen.odometry if not ODOMETRY[name].networks),
        *(Pair(plain.odometry, name) for name in chosen.scans if not SCANS[name].networks),
    ]


def stress_tables(study: Study) -> list[Table]:
    """A ranking of scans, then all figures over severity."""
    rows = varied(study, "stress", "severity")
    ranking = []
    for pair in study.pairs:
        own = [row for row in rows if row["scans"] == pair.scans]
        worst = max((row["severity"] for row in own), default=0)
        for title, chosen in (("all", own), ("most severe", [row for row in own if row["severity"] == worst])):
            ranking.append(
                {"scans": pair.scans, "levels": title} | _words({n: mean([r[n] for r in chosen]) for n in PLACES})
            )
    ranking.sort(key=lambda row: (row["levels"], row[_title("ghosts")]))
    notes = [
        f"Means over places; odometry: {study.chosen.partner.odometry}. Truth by provenance: a wrong return is more "
        "than 10 cm off the first surface on its bearing, and comes from the strongest cause of its cell. Missed: "
        "bearings with a surface in reach that return nothing at it or before it."
    ]
    return [
        Table("Ranking under multipath, fewest ghosts first", ranking, notes),
        _table(rows, "By place and severity"),
    ]


def ablation_tables(study: Study) -> list[Table]:
    """Figures over the values of each parameter."""
    return [_table(varied(study, "ablation", "value"), "By parameter")]


def varied(study: Study, panel: str, over: str) -> list[dict[str, object]]:
    """A row for each pair and recording that has the attributes, by these."""
    rows = []
    for pair in study.pairs:
        for run in study.once(pair):
            about = run.case.attributes
            if panel in about and over in about:
                figures = {name: at(study.results[run], *path) for name, path in PLACES.items()}
                label = {panel: str(about[panel]), over: about[over], "odometry": pair.odometry, "scans": pair.scans}
                rows.append({**label, "methods": str(pair), **figures})
    return sorted(rows, key=lambda row: (row[panel], str(type(row[over])), row[over]))


def _table(rows: Sequence[dict[str, object]], title: str) -> Table:
    named = [name for name in FIGURES if any(row[name] is not None for row in rows)]
    return Table(
        title,
        [
            {k: v for k, v in row.items() if k not in FIGURES and k != "methods"} | _words({n: row[n] for n in named})
            for row in rows
        ],
    )


def _words(figures: dict[str, float | None]) -> dict[str, float | None]:
    """Figures by their titles, in their units."""
    return {_title(name): None if value is None else FIGURES[name][2] * value for name, value in figures.items()}


def _title(name: str) -> str:
    words, unit, _ = FIGURES[name]
    return f"{words}, {unit}"


def draw_stress(study: Study, page: Page) -> None:
    """Curves over severity."""
    _draw(study, page, "stress", "severity", "scans")


def draw_ablation(study: Study, page: Page) -> None:
    """Curves over values; values that are no numbers have none."""
    _draw(study, page, "ablation", "value", "methods")


def _draw(study: Study, page: Page, panel: str, over: str, line: str) -> None:
    rows = [row for row in varied(study, panel, over) if isinstance(row[over], int | float)]
    names = [name for name in DRAWN if any(row[name] is not None for row in rows)]
    if rows and names:
        page.section("Curves", f"Figures over {over}, a column for each {panel}.")
        page.picture(curves(rows, over, panel, line, names))
