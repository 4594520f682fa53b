"""Figures of runs in the terminal."""

from collections.abc import Mapping

from radarize.console import print_table
from radarize.evaluation.blindness import BlindSpans
from radarize.report import words


def print_metrics(metrics: Mapping[str, object]) -> None:
    """Print what `radarize.evaluation.evaluate` returned as tables."""
    table = words.trajectories(metrics)
    print_table(table.head[:-1], [row[:-1] for row in table.rows], table.numbers)
    for table in words.parts(metrics):
        print_table(*table)
    if "blind" in metrics:
        sentence, spans = words.blindness(BlindSpans.model_validate(metrics["blind"]))
        print(sentence)
        if spans.rows:
            print_table(*spans)
