"""What changes as one thing is varied: the severity of multipath, or a parameter of the radar."""

from collections.abc import Sequence
from dataclasses import dataclass

from radarize.benchmark.benchmark import Chosen, Study
from radarize.benchmark.dataset import DataSet
from radarize.benchmark.runs import Pair
from radarize.benchmark.table import Table, at, mean
from radarize.evaluation.stress import FIGURES, SOURCES
from radarize.methods.registry import CLASSICAL, ODOMETRY, SCANS
from radarize.report.curves import curves
from radarize.report.page import Page

#: Where figures of `radarize.evaluation.stress` stand in those of a run.
PLACES = {
    **{name: ("sources", name) for name in SOURCES},
    "missed": ("missed",),
    "map_f1": ("map", "f1"),
    "odometry": ("odometry", "ate", "position", "mean"),
    "slam": ("slam", "ate", "position", "mean"),
}


@dataclass(frozen=True)
class Panels:
    """How figures are drawn over what was varied.

    Attributes:
        panel, over, line: columns of the table: a panel each, the abscissa, a line each.
        names: figures, of `FIGURES`.
    """

    panel: str
    over: str
    line: str
    names: tuple[str, ...]


STRESS = Panels("stress", "severity", "scans", ("ghosts", "missed", "map_f1", "matching", "slam"))
ABLATION = Panels("ablation", "value", "methods", ("ghosts", "missed", "map_f1", "odometry"))
#: Odometry that is as good as its scans.
MATCHING = "scan-matching"


def lacks_stress(data: DataSet) -> str:
    """Whether recordings say how severe their multipath is."""
    return _lacks(data, STRESS, "radarsim dataset stress")


def lacks_ablation(data: DataSet) -> str:
    """Whether recordings say what is varied."""
    return _lacks(data, ABLATION, "radarsim dataset ablation/bandwidth")


def _lacks(data: DataSet, panels: Panels, hint: str) -> str:
    panel, over = panels.panel, panels.over
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


def stress_pairs(chosen: Chosen) -> list[Pair]:
    """Every scan with the odometry of choice, and with odometry that is made of nothing else."""
    return [
        *(Pair(chosen.partner.odometry, scans) for scans in chosen.scans),
        *(Pair(MATCHING, scans) for scans in chosen.scans if MATCHING in chosen.odometry),
    ]


def stress_tables(study: Study) -> list[Table]:
    """A ranking of scans, then all figures over severity."""
    rows, ranking = stress_rows(study), []
    names = [name for name in FIGURES if any(row[name] is not None for row in rows)]
    for scans in study.chosen.scans:
        own = [row for row in rows if row["scans"] == scans]
        worst = max((row["severity"] for row in own), default=0)
        for title, chosen in (("all", own), ("most severe", [row for row in own if row["severity"] == worst])):
            ranking.append({"scans": scans, "levels": title} | _words({n: mean([r[n] for r in chosen]) for n in names}))
    ranking.sort(key=lambda row: (row["levels"], row.get(_title("ghosts"), 0.0)))
    notes = [
        f"Means over places; odometry: {study.chosen.partner.odometry}, which needs no scans, and by matching these "
        "scans alone. Truth by provenance: a wrong return is more "
        "than 10 cm off the first surface on its bearing, and comes from the strongest cause of its cell. Missed: "
        "bearings with a surface in reach that return nothing at it or before it."
    ]
    return [
        Table("Ranking under multipath, fewest ghosts first", ranking, notes),
        _table(rows, "By place and severity"),
    ]


def stress_rows(study: Study) -> list[dict[str, object]]:
    """Rows of `varied` for every scan with the odometry of choice; ``matching``: odometry's error by these scans."""
    rows, partner = varied(study, STRESS), study.chosen.partner.odometry

    def of(odometry: str) -> dict[tuple, dict[str, object]]:
        own = [row for row in rows if row["methods"] == f"{odometry}+{row['scans']}"]
        return {(row["recording"], row["scans"]): row for row in own}

    matching = of(MATCHING)
    rows = [row | {"matching": matching.get(key, {}).get("odometry")} for key, row in of(partner).items()]
    return [_without(row, "methods", "recording") for row in rows]


def ablation_tables(study: Study) -> list[Table]:
    """Figures over the values of each parameter."""
    return [_table(ablation_rows(study), "By parameter")]


def ablation_rows(study: Study) -> list[dict[str, object]]:
    """Rows of `varied` for every pair."""
    return [_without(row, "scans", "recording") for row in varied(study, ABLATION)]


def varied(study: Study, panels: Panels) -> list[dict[str, object]]:
    """A row for each pair and recording that has the attributes, by these."""
    rows, panel, over = [], panels.panel, panels.over
    for pair in study.pairs:
        for run in study.once(pair):
            about = run.case.attributes
            if panel in about and over in about:
                figures = {name: at(study.results[run], *path) for name, path in PLACES.items()}
                label = {panel: str(about[panel]), over: about[over], "recording": run.case.name}
                rows.append(label | {"scans": pair.scans, "methods": str(pair)} | figures)
    return sorted(rows, key=lambda row: (row[panel], str(type(row[over])), row[over]))


def _table(rows: Sequence[dict[str, object]], title: str) -> Table:
    named = [name for name in FIGURES if any(row.get(name) is not None for row in rows)]
    return Table(
        title,
        [_without(row, *FIGURES) | _words({name: row[name] for name in named}) for row in rows],
    )


def _without(row: dict[str, object], *keys: str) -> dict[str, object]:
    return {key: value for key, value in row.items() if key not in keys}


def _words(figures: dict[str, float | None]) -> dict[str, float | None]:
    """Figures by their titles, in their units."""
    return {_title(name): None if value is None else FIGURES[name][2] * value for name, value in figures.items()}


def _title(name: str) -> str:
    words, unit, _ = FIGURES[name]
    return f"{words}, {unit}"


def draw_stress(study: Study, page: Page) -> None:
    """Curves over severity."""
    _draw(page, stress_tables(study)[-1], STRESS)


def draw_ablation(study: Study, page: Page) -> None:
    """Curves over values."""
    _draw(page, ablation_tables(study)[-1], ABLATION)


def _draw(page: Page, table: Table, panels: Panels) -> None:
    if (figure := picture(table, panels)) is not None:
        page.section("Curves", f"Figures over {panels.over}, a column for each {panels.panel}.")
        page.picture(figure)


def picture(table: Table, panels: Panels):
    """Curves of a table's figures, a matplotlib figure; None without any. Values that are no numbers have none."""
    names = {_title(name): name for name in FIGURES}
    rows = [
        {names.get(k, k): v / FIGURES[names[k]][2] if k in names and v is not None else v for k, v in row.items()}
        for row in table.rows
        if isinstance(row[panels.over], int | float)
    ]
    shown = [name for name in panels.names if any(row.get(name) is not None for row in rows)]
    return curves(rows, panels.over, panels.panel, panels.line, shown) if shown else None
