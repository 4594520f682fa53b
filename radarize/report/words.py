"""Figures of runs in words: the rows of tables, on a page and in the terminal alike."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from radarize.evaluation.blindness import Blindness
from radarize.evaluation.metrics import at

#: What stands where there is no figure.
NONE = "-"


class Figure(NamedTuple):
    """A figure that `radarize.evaluation.evaluate` makes.

    Attributes:
        words: what it is.
        unit, factor: of what is shown.
        path: where it stands.
        form: format of the number.
        meaning: in a sentence, where words do not say it.
    """

    words: str
    unit: str
    factor: float
    path: tuple[str, ...]
    form: str = ".3g"
    meaning: str = ""

    def text(self, metrics: Mapping[str, object]) -> str:
        """Value and unit."""
        value = at(metrics, *self.path)
        return NONE if value is None else f"{self.factor * value:{self.form}} {self.unit}".strip()


_TRAJECTORY = (
    Figure("ATE position, mean", "m", 1, ("ate", "position", "mean"), ".3f", "distance to the truth after laying both "
           "trajectories upon each other"),
    Figure("ATE position, rmse", "m", 1, ("ate", "position", "rmse"), ".3f"),
    Figure("ATE position, max", "m", 1, ("ate", "position", "max"), ".3f"),
    Figure("ATE rotation, mean", "rad", 1, ("ate", "rotation", "mean"), ".3f"),
    Figure("RE position over a frame, mean", "m", 1, ("re", "frame", "position", "mean"), ".4f",
           "error of the way from pose to pose, no alignment"),
    Figure("RE rotation over a frame, mean", "rad", 1, ("re", "frame", "rotation", "mean"), ".4f"),
    Figure("RE position over a second, mean", "m", 1, ("re", "second", "position", "mean"), ".4f"),
    Figure("RE rotation over a second, mean", "rad", 1, ("re", "second", "rotation", "mean"), ".4f"),
    Figure("RE position over a metre, mean", "m", 1, ("re", "metre", "position", "mean"), ".4f"),
    Figure("RE rotation over a metre, mean", "rad", 1, ("re", "metre", "rotation", "mean"), ".4f"),
    Figure("mean ATE / distance", "%", 100, ("ate_share",), ".2f"),
    Figure("end drift / distance", "%", 100, ("drift",), ".2f", "how far the ends are apart if the starts agree"),
    Figure("distance travelled", "m", 1, ("distance",), ".1f"),
)  # fmt: skip
_OTHERS = {
    "map": (
        Figure("occupied cells within 10 cm of a wall (precision)", "%", 100, ("precision",)),
        Figure("visible wall within 10 cm of an occupied cell (recall)", "%", 100, ("recall",)),
        Figure("F1", "%", 100, ("f1",)),
        Figure("Chamfer distance", "m", 1, ("chamfer",)),
        Figure("free space, intersection over union", "%", 100, ("free_iou",)),
    ),
    "scans": (
        Figure("returned bearings within 10 cm of the truth", "%", 100, ("within_10cm",)),
        Figure("too near by more", "%", 100, ("short",)),
        Figure("too far by more", "%", 100, ("beyond",)),
        Figure("bearings in reach that return anything", "%", 100, ("returned",)),
        Figure("bearings in reach that carve through a surface", "%", 100, ("through",)),
        Figure("median range error", "m", 1, ("median",)),
    ),
    "velocity": (
        Figure("median error", "m/s", 1, ("median",)),
        Figure("90 % within", "m/s", 1, ("p90",)),
        Figure("forward, rms", "m/s", 1, ("forward",)),
        Figure("left, rms", "m/s", 1, ("left",)),
        Figure("frames without an estimate", "%", 100, ("missing",)),
        Figure("mean along the motion", "m/s", 1, ("bias",)),
        Figure("mean squared error over covariance (1 if it is honest)", "", 1, ("nees",)),
        Figure("its median over that of honest ones", "", 1, ("nees_median",)),
    ),
}
#: What methods are compared by.
_BESIDE = (
    Figure("velocity RMSE", "m/s", 1, ("velocity", "rmse")),
    Figure("odometry ATE", "m", 1, ("odometry", "ate", "position", "mean")),
    Figure("odometry ATE", "rad", 1, ("odometry", "ate", "rotation", "mean")),
    Figure("SLAM ATE", "m", 1, ("slam", "ate", "position", "mean")),
    Figure("SLAM ATE", "rad", 1, ("slam", "ate", "rotation", "mean")),
    Figure("bearings within 10 cm", "%", 100, ("scans", "within_10cm")),
    Figure("map F1", "%", 100, ("map", "f1")),
)


class Table(NamedTuple):
    """Words in columns.

    Attributes:
        head, rows: of as many columns each.
        numbers: columns that hold figures.
    """

    head: Sequence[str]
    rows: list[tuple[str, ...]]
    numbers: Sequence[int] = (1,)


def trajectories(metrics: Mapping[str, object]) -> Table:
    """Errors of a run's trajectories; the last column says what they mean."""
    names = [name for name in ("odometry", "slam") if name in metrics]
    rows = [(f.words, *(f.text(metrics[name]) for name in names), f.meaning) for f in _TRAJECTORY]
    return Table(("trajectory", *names, "what it means"), rows, range(1, 1 + len(names)))


def parts(metrics: Mapping[str, object]) -> Iterator[Table]:
    """Errors of a run's map, scans and velocities, as far as they are known."""
    for name, figures in _OTHERS.items():
        if name in metrics:
            yield Table((name, "value"), [(figure.words, figure.text(metrics[name])) for figure in figures])


def beside(runs: Sequence[tuple[str, Mapping[str, object]]]) -> Table:
    """Runs of one recording beside each other, by what they were made with."""
    head = ("method", *(f"{figure.words}, {figure.unit}" for figure in _BESIDE))
    rows = [(name, *(figure._replace(unit="").text(metrics) for figure in _BESIDE)) for name, metrics in runs]
    return Table(head, rows, range(1, len(head)))


def blindness(found: Blindness) -> str:
    """A sentence on how much of the way odometry was blind."""
    if not found.spans:
        return "Odometry was blind nowhere."
    return (
        f"Odometry was blind (no match believed, no velocity) over {found.way_m:.1f} m, "
        f"{100 * found.share_of_way:.0f} % of the way."
    )


def blind_spans(found: Blindness) -> Table:
    """Where odometry was blind."""
    rows = [(f"{s.start_s:.1f}", f"{s.stop_s:.1f}", f"{s.way_m:.2f}", s.why) for s in found.spans]
    return Table(("blind from, s", "to, s", "way, m", "why"), rows, (0, 1, 2))
