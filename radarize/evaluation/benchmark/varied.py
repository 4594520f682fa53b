"""What changes as one thing is varied: the severity of multipath, or a parameter of the radar."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd
from matplotlib.figure import Figure

from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import Table
from radarize.evaluation.report.curves import curves
from radarize.evaluation.report.page import Page
from radarize.evaluation.stress import FIGURES
from radarize.pipeline.methods import CLASSICAL, ODOMETRY, SCANS


@dataclass(frozen=True)
class Panels:
    """How figures are drawn over what was varied.

    Attributes:
        panel, over: attributes of recordings and columns of the table: a panel each, the abscissa.
        line: column of the table with a line each.
        names: figures, of `FIGURES`.
        hint: a command that makes such recordings.
    """

    panel: str
    over: str
    line: str
    names: tuple[str, ...]
    hint: str

    def lacks(self, data: DataSet) -> str:
        """What a data set must have and has not: recordings that say what was varied."""
        if any({self.panel, self.over} <= case.attributes.keys() for case in data.cases):
            return ""
        return (
            f"no recording has attributes {self.panel} and {self.over}, expected a data set such as that of "
            f"`{self.hint}`"
        )

    def rows(self, study: Study) -> pd.DataFrame:
        """A row for each pair and recording that has the attributes, by these; figures by name."""
        parts = []
        for pair in study.pairs:
            runs = study.of(pair)
            about = [[run.case.attributes.get(name) for name in (self.panel, self.over)] for run in runs["run"]]
            label = pd.DataFrame(about, columns=[self.panel, self.over], dtype=object)
            names = {"odometry_by": pair.odometry, "scans": pair.scans, "methods": str(pair)}
            label = label.assign(recording=runs["recording"], **names)
            figures = figures_of(runs, {name: figure.path for name, figure in FIGURES.items()})
            parts.append(pd.concat([label, figures], axis=1)[label[[self.panel, self.over]].notna().all(axis=1)])
        found = pd.concat(parts)
        found[self.panel] = found[self.panel].astype(str)
        kinds = found[self.over].map(lambda value: (type(value).__name__, value))
        order = sorted(range(len(found)), key=lambda k: (found[self.panel].iloc[k], kinds.iloc[k]))
        return found.iloc[order].reset_index(drop=True)

    def means(self, rows: pd.DataFrame, title: str) -> Table:
        """Figures by what was varied and by line, mean over walks; of trajectories with their standard errors."""
        groups = in_words(rows).groupby([rows[self.panel], rows[self.over], rows[self.line]], sort=False)
        found, errors = groups.mean(), groups.sem()
        for figure in {FIGURES["odometry"].title, FIGURES["slam"].title} & {*found}:
            found.insert(found.columns.get_loc(figure) + 1, f"{figure} +-", errors[figure])
        found.insert(0, "walks", groups.size())
        return Table(title, found.reset_index().to_dict("records"), ["Means over walks +- their standard errors."])

    def table(self, rows: pd.DataFrame, title: str) -> Table:
        """Figures by what was varied and by line."""
        labels = rows[[self.panel, self.over, self.line]]
        return Table(title, pd.concat([labels, in_words(rows)], axis=1).to_dict("records"))

    def picture(self, _: Study, tables: Sequence[Table]) -> Figure | None:
        """Curves of the last table; None without any. Values that are no numbers have none."""
        frame = tables[-1].frame.rename(columns={figure.title: name for name, figure in FIGURES.items()})
        frame = frame[frame[self.over].map(lambda value: isinstance(value, int | float))]
        shown = [name for name in self.names if name in frame and frame[name].notna().any()]
        for name in shown:
            frame[name] = frame[name].astype(float) / FIGURES[name].factor
        return curves(frame.to_dict("records"), self.over, self.panel, self.line, shown) if shown else None

    def draw(self, study: Study, page: Page) -> None:
        """The same on a page."""
        if (figure := self.picture(study, study.benchmark.tables(study))) is not None:
            page.section("Curves", f"Figures over {self.over}, a column for each {self.panel}.")
            page.picture(figure)


STRESS = Panels(
    "stress", "severity", "scans", ("ghosts", "missed", "map_f1", "matching", "slam"), "radarsim dataset stress"
)
ABLATION = Panels(
    "ablation", "value", "methods", ("ghosts", "missed", "map_f1", "odometry"), "radarsim dataset ablation/bandwidth"
)
#: Odometry that is as good as its scans.
MATCHING = "scan-matching"


def in_words(rows: pd.DataFrame) -> pd.DataFrame:
    """Figures that there are by their titles, in their units."""
    known = {name: figure for name, figure in FIGURES.items() if rows[name].notna().any()}
    return pd.DataFrame({each.title: each.factor * rows[name] for name, each in known.items()}, index=rows.index)


def classical_pairs(chosen: Chosen) -> list[Pair]:
    """Methods without networks, which read one radar alone: each odometry, and all scans with one of them."""
    plain = Pair(**CLASSICAL)
    return [
        *(Pair(name, plain.scans) for name in chosen.odometry if not ODOMETRY[name].networks),
        *(Pair(plain.odometry, name) for name in chosen.scans if not SCANS[name].networks),
    ]


def ablation_tables(study: Study) -> list[Table]:
    """Figures over the values of each parameter."""
    return [ABLATION.means(ABLATION.rows(study), "By parameter")]


def stress_pairs(chosen: Chosen) -> list[Pair]:
    """Every scan with the odometry of choice, and with odometry that is made of nothing else."""
    matching = [Pair(MATCHING, scans) for scans in chosen.scans if MATCHING in chosen.odometry]
    return [*chosen.by_scans(), *matching]


def stress_tables(study: Study) -> list[Table]:
    """A ranking of scans, then all figures over severity."""
    rows = stress_rows(study)
    levels = {"all": rows, "most severe": rows[rows["severity"] == rows["severity"].max()]}
    ranking = []
    for title, chosen in levels.items():
        means = in_words(chosen).groupby(chosen["scans"], sort=False).mean()
        means.insert(0, "levels", title)
        ranking.append(means.sort_values([title for title in means if title == FIGURES["ghosts"].title] or "levels"))
    note = (
        f"Means over places; odometry: {study.chosen.partner.odometry}, which needs no scans, and by matching these "
        "scans alone. Truth by provenance: a wrong return is more than 10 cm off the first surface on its bearing, and "
        "comes from the strongest cause of its cell. Missed: bearings with a surface in reach that return nothing at "
        "it or before it."
    )
    return [
        Table(
            "Ranking under multipath, fewest ghosts first", pd.concat(ranking).reset_index().to_dict("records"), [note]
        ),
        STRESS.table(rows, "By place and severity"),
    ]


def stress_rows(study: Study) -> pd.DataFrame:
    """Rows of every scan with the odometry of choice; ``matching``: odometry's error by these scans."""
    rows = STRESS.rows(study)
    own = rows[rows["odometry_by"] == study.chosen.partner.odometry]
    matching = rows[rows["odometry_by"] == MATCHING].set_index(["recording", "scans"])["odometry"]
    return own.drop(columns="matching").join(matching.rename("matching"), on=["recording", "scans"])
