"""Figures of a benchmark's page, below its tables."""

from collections.abc import Callable

from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.report import comparison
from radarize.evaluation.report.page import COLORS, OTHERS, Page
from radarize.pipeline.runfolder import RunFolder

#: Number of recordings whose maps are shown.
_MAPS = 4


def draw(
    study: Study,
    page: Page,
    which: str = "slam",
    parts: str = "trajectories errors maps",
    name: Callable[[Pair], str] = str,
) -> None:
    """Add figures of trajectories, errors and maps to a page; nothing without any run.

    Args:
        study: benchmark that has run.
        page: page to extend.
        which: kind of the trajectories, ``odometry`` or ``slam``.
        parts: figures to draw, some of ``trajectories errors maps``.
        name: returns the shown name of a pair of methods.
    """
    runs = {name(pair): found for pair in study.pairs if (found := study.of(pair)["run"].to_list())}
    if not runs:
        return
    ours = study.chosen.partner
    others = enumerate(study.pairs)
    colors = {name(pair): COLORS["slam"] if pair == ours else OTHERS[k % len(OTHERS)] for k, pair in others}
    folders: dict[str, dict] = {}
    errors: dict[str, dict] = {method: {} for method in runs}
    for method, found in runs.items():
        for run in found:
            folders.setdefault(run.case.name, {})[method] = RunFolder(study.output / run.place)
            result = study.results[run]
            assert isinstance(result, dict)  # `Study.of` has successful runs only
            errors[method][run.case.name] = result["quantiles"][which], result[which]["ate"]["position"]["mean"]
    for part in parts.split():
        if part == "trajectories":
            comparison.draw_trajectories(page, folders, colors, which)
        elif part == "maps":
            comparison.draw_maps(page, dict(list(folders.items())[:_MAPS]), colors)
        else:
            comparison.draw_errors(page, errors, colors)
