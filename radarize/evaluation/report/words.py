"""Tables of the errors of runs, for reports and for the terminal."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from radarize.evaluation.figures import Figure
from radarize.odometry.observability import UnobservableSpans
from radarize.pipeline.health import Condition

_TRAJECTORY = (
    Figure("ATE position, mean", "ate.position.mean", "m", 1, ".3f",
           "position error after alignment without scale"),
    Figure("ATE position, rmse", "ate.position.rmse", "m", 1, ".3f"),
    Figure("ATE position, max", "ate.position.max", "m", 1, ".3f"),
    Figure("ATE rotation, mean", "ate.rotation.mean", "rad", 1, ".3f"),
    *(Figure(f"RE {what} over a {delta}, mean", f"re.{delta}.{what}.mean", unit, 1, ".4f",
             "error of relative poses, without alignment" if (delta, unit) == ("frame", "m") else "")
      for delta in ("frame", "second", "metre") for what, unit in (("position", "m"), ("rotation", "rad"))),
    Figure("mean ATE / distance", "ate_share", "%", 100, ".2f"),
    Figure("end drift / distance", "drift", "%", 100, ".2f", "error of the last pose if the first poses are aligned"),
    Figure("distance travelled", "distance", "m", 1, ".1f"),
    Figure("NEES", "nees", "", 1, ".2f",
           "of the motion since the start, per dimension: 1 if covariances are consistent"),
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
        Figure("returned ranges within 10 cm of the truth", "within_10cm", "%", 100),
        Figure("returned ranges too short by more than 10 cm", "short", "%", 100),
        Figure("returned ranges too long by more than 10 cm", "beyond", "%", 100),
        Figure("bearings in range with a return", "returned", "%", 100),
        Figure("bearings in range with a return behind the surface", "through", "%", 100),
        Figure("median range error", "median", "m"),
    ),
    "velocity": (
        Figure("median error", "median", "m/s"),
        Figure("90th percentile of the error", "p90", "m/s"),
        Figure("RMS error, forward", "forward", "m/s"),
        Figure("RMS error, left", "left", "m/s"),
        Figure("frames without an estimate", "missing", "%", 100),
        Figure("mean error along the motion", "bias", "m/s"),
        Figure("NEES, mean over its expectation (1: consistent)", "nees"),
        Figure("NEES, median over its expectation (1: consistent)", "nees_median"),
    ),
}
#: Columns of the comparison of methods.
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
    """A table of text; `numbers` are the columns that hold figures."""

    head: Sequence[str]
    rows: Sequence[tuple[str, ...]]
    numbers: Sequence[int] = (1,)


def trajectories(metrics: Mapping[str, Any]) -> PrintedTable:
    """Return the table of trajectory errors of a run; the last column explains the rows."""
    names = [name for name in ("odometry", "slam") if name in metrics]
    rows = [(f.words, *(f.text(metrics[name]) for name in names), f.meaning) for f in _TRAJECTORY]
    return PrintedTable(("trajectory", *names, "meaning"), rows, range(1, 1 + len(names)))


def parts(metrics: Mapping[str, Any]) -> Iterator[PrintedTable]:
    """Yield tables of errors of a run's map, scans and velocities, if they have a truth."""
    for name, figures in _PARTS.items():
        if name in metrics:
            yield PrintedTable((name, "value"), [(figure.words, figure.text(metrics[name])) for figure in figures])


def everything(metrics: Mapping[str, object]) -> Iterator[PrintedTable | str]:
    """Yield tables and sentences of all metrics of `radarize.evaluation.evaluate`, without the explanations."""
    head, rows, numbers = trajectories(metrics)
    yield PrintedTable(head[:-1], [row[:-1] for row in rows], numbers)
    yield from parts(metrics)
    if "blind" in metrics:
        sentence, spans = unobservable(UnobservableSpans.model_validate(metrics["blind"]))
        yield sentence
        if spans.rows:
            yield spans


def beside(runs: Sequence[tuple[str, Mapping[str, object]]]) -> PrintedTable:
    """Return the table that compares runs of one recording, by their methods."""
    head = ("method", *(figure.title for figure in _BESIDE))
    rows = [(name, *(figure.text(metrics, unit=False) for figure in _BESIDE)) for name, metrics in runs]
    return PrintedTable(head, rows, range(1, len(head)))


def health(found: Sequence[Condition]) -> PrintedTable:
    """Return the table of spans with conditions that degrade odometry, with advice."""
    rows = [(f"{each.start_s:.1f}", f"{each.stop_s:.1f}", each.kind, each.advice) for each in found]
    return PrintedTable(("from, s", "to, s", "condition", "advice"), rows, (0, 1))


def unobservable(found: UnobservableSpans) -> tuple[str, PrintedTable]:
    """Return a sentence on the share of the path on which motion was unobservable, and a table of these spans."""
    rows = [(f"{s.start_s:.1f}", f"{s.stop_s:.1f}", f"{s.way_m:.2f}", s.why) for s in found.spans]
    share = f"on {found.way_m:.1f} m, {100 * found.share_of_way:.0f} % of the path; poses there are predictions"
    table = PrintedTable(("unobservable from, s", "to, s", "path, m", "cause"), rows, (0, 1, 2))
    if not rows:
        return "Heading and velocity were observable on the whole path.", table
    return f"Heading or velocity was unobservable {share}.", table
