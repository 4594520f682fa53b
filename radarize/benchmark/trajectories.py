"""Tables of trajectory errors, a row a method, by each protocol."""

from radarize.benchmark.benchmark import Study
from radarize.benchmark.protocol import PROTOCOLS
from radarize.benchmark.runs import Pair
from radarize.benchmark.table import Table, ahead

#: Odometry that is this project's; what is compared with the paper's own.
OURS = ("fused", "learned")
PAPER_COLUMNS = ("paper: ATE m", "paper: ATE rad", "paper: RE frame m")


def trajectory_tables(
    study: Study,
    trajectory: str,
    labels: dict[Pair, dict[str, object]],
    paper: dict[Pair, tuple[float, ...]],
    about: str = "",
) -> list[Table]:
    """A table for each protocol of a study.

    Args:
        study: carried out.
        trajectory: ``odometry`` or ``slam``.
        labels: first columns of a pair's row; pairs that are not in it have none.
        paper: its figures of a pair: ATE in m and rad, RE between frames in m.
        about: what the titles begin with; by default the trajectory.
    """
    found = []
    for name in study.protocols:
        protocol = PROTOCOLS[name]
        rows = []
        for pair, label in labels.items():
            which = trajectory
            if trajectory == "slam" and not protocol.equal_loops and pair.odometry not in OURS:
                which = "open"
            figures = protocol.average(study, pair, which)
            beside = dict(zip(PAPER_COLUMNS, paper.get(pair, (None,) * len(PAPER_COLUMNS)), strict=True))
            rows.append({**label, "recordings": len(study.once(pair)), **figures, **beside})
        notes = list(protocol.notes)
        ours = [k for k, pair in enumerate(labels) if pair == study.chosen.partner]
        if ours and len(rows) > 1:
            notes.append(
                ahead(
                    rows,
                    ours[0],
                    " + ".join(map(str, list(labels.values())[ours[0]].values())),
                    [column for column in rows[0] if column.startswith(("ATE", "RE"))],
                )
            )
        found.append(Table(f"{about or trajectory.capitalize()}, {protocol.title}", rows, notes))
    return found
