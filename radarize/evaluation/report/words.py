"""Figures of runs in words: the rows of tables, on a page and in the terminal alike."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from radarize.evaluation.figures import Figure
from radarize.odometry.observability import UnobservableSpans
from radarize.pipeline.health import Condition

_TRAJECTORY = (
    Figure("ATE position, mean", "ate.position.mean", "m", 1, ".3f",
           "distance to the truth after laying both trajectories upon each other"),
    Figure("ATE position, rmse", "ate.position.rmse", "m", 1, ".3f"),
    Figure("ATE position, max", "ate.position.max", "m", 1, ".3f"),
    Figure("ATE rotation, mean", "ate.rotation.mean", "rad", 1, ".3f"),
    *(Figure(f"RE {what} over a {delta}, mean", f"re.{delta}.{what}.mean", unit, 1, ".4f",
             "error of the way from pose to pose, no alignment" if (delta, unit) == ("frame", "m") else "")
      for delta in ("frame", "second", "metre") for what, unit in (("position", "m"), ("rotation", "rad"))),
    Figure("mean ATE / distance", "ate_share", "%", 100, ".2f"),
    Figure("end drift / distance", "drift", "%", 100, ".2f", "how far the ends are apart if the starts agree"),
    Figure("distance travelled", "distance", "m", 1, ".1f"),
    Figure("squared error over the claimed", "nees", "", 1, ".2f",
           "of the way since the start, per dimension: 1 if claims are honest"),
)  # fmt: skip
_PARTS = {
    "map": (
        Figure("occupied cells within 10 cm of a wall (precision)", "precision", "%", 100),
        Figure("visible wall within 10 cm of an occupied cell (recall)", "recall", "%", 100),
        Figure("F1", "f1", "%", 100),
        Figure("Chamfer distance", "chamfer", "m"),
        Figure("free space, intersection over union", "free_iou", "%", 100),
    ),
    "scans": (
        Figure("returned bearings within 10 cm of the truth", "within_10cm", "%", 100),
        Figure("too near by more", "short", "%", 100),
        Figure("too far by more", "beyond", "%", 100),
        Figure("bearings in reach that return anything", "returned", "%", 100),
        Figure("bearings in reach that carve through a surface", "through", "%", 100),
        Figure("median range error", "median", "m"),
    ),
    "velocity": (
        Figure("median error", "median", "m/s"),
        Figure("90 % within", "p90", "m/s"),
        Figure("forward, rms", "forward", "m/s"),
        Figure("left, rms", "left", "m/s"),
        Figure("frames without an estimate", "missing", "%", 100),
        Figure("mean along the motion", "bias", "m/s"),
        Figure("mean squared error over covariance (1 if it is honest)", "nees"),
        Figure("its median over that of honest ones", "nees_median"),
    ),
}
#: What methods are compared by.
_BESIDE = (
    Figure("velocity RMSE", "velocity.rmse", "m/s"),
    Figure("odometry ATE", "odometry.ate.position.mean", "m"),
    Figure("odometry ATE", "odometry.ate.rotation.mean", "rad"),
    Figure("SLAM ATE", "slam.ate.position.mean", "m"),
    Figure("SLAM ATE", "slam.ate.rotation.mean", "rad"),
    Figure("bearings within 10 cm", "scans.within_10cm", "%", 100),
    Figure("map F1", "map.f1", "%", 100),
)


class PrintedTable(NamedTuple):
    """Words in columns; `numbers` are the columns that hold figures."""

    head: Sequence[str]
    rows: Sequence[tuple[str, ...]]
    numbers: Sequence[int] = (1,)


def trajectories(metrics: Mapping[str, Any]) -> PrintedTable:
    """Errors of a run's trajectories; the last column says what they mean."""
    names = [name for name in ("odometry", "slam") if name in metrics]
    rows = [(f.words, *(f.text(metrics[name]) for name in names), f.meaning) for f in _TRAJECTORY]
    return PrintedTable(("trajectory", *names, "what it means"), rows, range(1, 1 + len(names)))


def parts(metrics: Mapping[str, Any]) -> Iterator[PrintedTable]:
    """Errors of a run's map, scans and velocities, as far as they are known."""
    for name, figures in _PARTS.items():
        if name in metrics:
            yield PrintedTable((name, "value"), [(figure.words, figure.text(metrics[name])) for figure in figures])


def everything(metrics: Mapping[str, object]) -> Iterator[PrintedTable | str]:
    """Tables and sentences of all that `radarize.evaluation.evaluate` returned, without what figures mean."""
    head, rows, numbers = trajectories(metrics)
    yield PrintedTable(head[:-1], [row[:-1] for row in rows], numbers)
    yield from parts(metrics)
    if "blind" in metrics:
        sentence, spans = blindness(UnobservableSpans.model_validate(metrics["blind"]))
        yield sentence
        if spans.rows:
            yield spans


def beside(runs: Sequence[tuple[str, Mapping[str, object]]]) -> PrintedTable:
    """Runs of one recording beside each other, by what they were made with."""
    head = ("method", *(figure.title for figure in _BESIDE))
    rows = [(name, *(figure.text(metrics, unit=False) for figure in _BESIDE)) for name, metrics in runs]
    return PrintedTable(head, rows, range(1, len(head)))


def health(found: Sequence[Condition]) -> PrintedTable:
    """Where odometry had a hard time, and what would help."""
    rows = [(f"{each.start_s:.1f}", f"{each.stop_s:.1f}", each.kind, each.advice) for each in found]
    return PrintedTable(("from, s", "to, s", "what", "advice"), rows, (0, 1))


def blindness(found: UnobservableSpans) -> tuple[str, PrintedTable]:
    """A sentence on how much of the way odometry was blind, and where it was."""
    rows = [(f"{s.start_s:.1f}", f"{s.stop_s:.1f}", f"{s.way_m:.2f}", s.why) for s in found.spans]
    over = f"(no match believed, no velocity) over {found.way_m:.1f} m, {100 * found.share_of_way:.0f} % of the way"
    table = PrintedTable(("blind from, s", "to, s", "way, m", "why"), rows, (0, 1, 2))
    return f"Odometry was blind {over if rows else 'nowhere'}.", table
