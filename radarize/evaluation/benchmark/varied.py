"""Metrics over one varied quantity: the severity of multipath, or a parameter of the radar."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

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
    """Plots of metrics over a varied quantity.

    Attributes:
        panel: attribute of recordings, and column of the table, with a value for each panel.
        over: attribute of recordings, and column of the table, of the abscissa.
        line: column of the table with a value for each line.
        names: names of metrics in `FIGURES`.
        hint: a command that makes such recordings.
        quantities: by panel, label of the abscissa with its unit and factor from the values to that unit.
    """

    panel: str
    over: str
    line: str
    names: tuple[str, ...]
    hint: str
    quantities: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def lacks(self, data: DataSet) -> str:
        """Return a sentence if no recording of a data set has the attributes `panel` and `over`; else an empty
        string."""
        if any({self.panel, self.over} <= case.attributes.keys() for case in data.cases):
            return ""
        return (
            f"no recording has attributes {self.panel} and {self.over}, expected a data set such as that of "
            f"`{self.hint}`"
        )

    def rows(self, study: Study) -> pd.DataFrame:
        """Return a row for each pair of methods and recording with the attributes, sorted by them; metrics by name."""
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
        """Return a table of metrics by panel, abscissa and line: means over walks; of ATE with standard errors."""
        groups = in_words(rows).groupby([rows[self.panel], rows[self.over], rows[self.line]], sort=False)
        found, errors = groups.mean(), groups.sem()
        for figure in {FIGURES["odometry"].title, FIGURES["slam"].title} & {*found}:
            found.insert(found.columns.get_loc(figure) + 1, f"{figure} +-", errors[figure])
        found.insert(0, "walks", groups.size())
        return Table(title, found.reset_index().to_dict("records"), ["Means over walks +- their standard errors."])

    def table(self, rows: pd.DataFrame, title: str) -> Table:
        """Return a table of metrics by panel, abscissa and line."""
        labels = rows[[self.panel, self.over, self.line]]
        return Table(title, pd.concat([labels, in_words(rows)], axis=1).to_dict("records"))

    def picture(self, _: Study, tables: Sequence[Table]) -> Figure | None:
        """Plot the last table, except rows whose abscissa is not a number; None if nothing is left."""
        frame = tables[-1].frame.rename(columns={figure.title: name for name, figure in FIGURES.items()})
        frame = frame[frame[self.over].map(lambda value: isinstance(value, int | float))]
        shown = [name for name in self.names if name in frame and frame[name].notna().any()]
        for name in shown:
            frame[name] = frame[name].astype(float) / FIGURES[name].factor
        rows = frame.to_dict("records")
        return curves(rows, self.over, self.panel, self.line, shown, self.quantities) if shown else None

    def draw(self, study: Study, page: Page) -> None:
        """Add the plots to a page."""
        if (figure := self.picture(study, study.benchmark.tables(study))) is not None:
            page.section("Plots", f"Metrics over {self.over}; one column for each {self.panel}, one line per method.")
            page.picture(figure)


STRESS = Panels(
    "stress", "severity", "scans", ("ghosts", "missed", "map_f1", "matching", "slam"), "radarsim dataset stress"
)
ABLATION = Panels(
    "ablation",
    "value",
    "methods",
    ("ghosts", "missed", "map_f1", "odometry"),
    "radarsim dataset ablation/bandwidth",
    {
        "antennas": ("virtual antennas", 1.0),
        "bandwidth": ("bandwidth, GHz", 1e-9),
        "frame rate": ("frame rate, Hz", 1.0),
        "loops": ("loops per frame", 1.0),
        "noise figure": ("noise figure, dB", 1.0),
        "sensor height": ("sensor height, m", 1.0),
        "tilt": ("downward pitch, deg", 1.0),
    },
)
#: Odometry that depends on scans alone.
MATCHING = "scan-matching"


def in_words(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a table of all metrics with a value, in their units, with their titles as columns."""
    known = {name: figure for name, figure in FIGURES.items() if rows[name].notna().any()}
    return pd.DataFrame({each.title: each.factor * rows[name] for name, each in known.items()}, index=rows.index)


def classical_pairs(chosen: Chosen) -> list[Pair]:
    """Return all methods without networks: each odometry, and all scans with one odometry. Networks are left out,
    because they are trained for one radar."""
    plain = Pair(**CLASSICAL)
    return [
        *(Pair(name, plain.scans) for name in chosen.odometry if not ODOMETRY[name].networks),
        *(Pair(plain.odometry, name) for name in chosen.scans if not SCANS[name].networks),
    ]


def ablation_tables(study: Study) -> list[Table]:
    """Return metrics over the values of each parameter."""
    return [ABLATION.means(ABLATION.rows(study), "By parameter")]


def stress_pairs(chosen: Chosen) -> list[Pair]:
    """Return all scans with the default odometry, and with odometry by matching these scans."""
    matching = [Pair(MATCHING, scans) for scans in chosen.scans if MATCHING in chosen.odometry]
    return [*chosen.by_scans(), *matching]


def stress_tables(study: Study) -> list[Table]:
    """Return a ranking of scans, then all metrics over severity."""
    rows = stress_rows(study)
    levels = {"all": rows, "most severe": rows[rows["severity"] == rows["severity"].max()]}
    ranking = []
    for title, chosen in levels.items():
        means = in_words(chosen).groupby(chosen["scans"], sort=False).mean()
        means.insert(0, "levels", title)
        ranking.append(means.sort_values([title for title in means if title == FIGURES["ghosts"].title] or "levels"))
    note = (
        f"Means over places. Odometry: {study.chosen.partner.odometry}, which does not use scans, and scan matching "
        "with these scans. A wrong return has a range error of more than 10 cm against the first surface on its "
        "bearing; its path type is that of the strongest echo of its cell in the simulation. Missed surfaces: bearings "
        "with a surface in range but without a return at it or in front of it."
    )
    return [
        Table(
            "Ranking under multipath, fewest ghosts first", pd.concat(ranking).reset_index().to_dict("records"), [note]
        ),
        STRESS.table(rows, "By place and severity"),
    ]


def stress_rows(study: Study) -> pd.DataFrame:
    """Return rows of all scans with the default odometry; ``matching``: ATE of scan matching with these scans, m."""
    rows = STRESS.rows(study)
    own = rows[rows["odometry_by"] == study.chosen.partner.odometry]
    matching = rows[rows["odometry_by"] == MATCHING].set_index(["recording", "scans"])["odometry"]
    return own.drop(columns="matching").join(matching.rename("matching"), on=["recording", "scans"])
