"""Plan of a data set: its distributions and the values drawn for each recording."""

from radarize.io.console import print_table
from radarsim.dataset.specification import Specification

#: Columns and their fields. Materials, which have two numbers each, are in the index beside the recordings.
_COLUMNS = {
    "clutter": "clutter", "unevenness": "unevenness", "furniture": "furniture", "height, m": "height",
    "pitch, deg": "pitch", "roll, deg": "roll",
}  # fmt: skip


def print_plan(specification: Specification) -> None:
    """Print the distributions of a data set and one line per recording; ``-``: not drawn."""
    print_table(("field", "platform", "distribution"), specification.randomise.rows())
    rows = []
    for task in specification.tasks:
        drawn = (task.randomised.get(field) for field in _COLUMNS.values())
        rows.append((task.name, f"{task.duration:g}", *("-" if value is None else f"{value:.2f}" for value in drawn)))
    print_table(("recording", "s", *_COLUMNS), rows, numbers=range(1, 2 + len(_COLUMNS)))
    print(f"{len(rows)} recordings, {sum(task.duration for task in specification.tasks) / 60:.1f} min in all")
