"""What a benchmark's page shows below its tables."""

from collections.abc import Callable

from radarize.benchmark.benchmark import Study
from radarize.benchmark.runs import Pair
from radarize.report import comparison
from radarize.report.page import COLORS, OTHERS, Page
from radarize.runfolder import RunFolder

#: Recordings whose maps are shown.
_MAPS = 4


def draw_odometry(study: Study, page: Page) -> None:
    """Trajectories and errors of odometry."""
    _draw(study, page, "odometry", lambda pair: pair.odometry, "trajectories errors")


def draw_slam(study: Study, page: Page) -> None:
    """Trajectories, errors and maps of SLAM."""
    _draw(study, page, "slam", str, "trajectories errors maps")


def draw_maps(study: Study, page: Page) -> None:
    """Maps and errors of SLAM."""
    _draw(study, page, "slam", lambda pair: pair.scans, "maps errors")


def _draw(study: Study, page: Page, which: str, name: Callable[[Pair], str], parts: str) -> None:
    """Parts by name, of trajectories of a sort, with names of pairs; nothing without any run."""
    runs = {name(pair): found for pair in study.pairs if (found := study.once(pair))}
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
            errors[method][run.case.name] = result["quantiles"][which], result[which]["ate"]["position"]["mean"]
    for part in parts.split():
        if part == "trajectories":
            comparison.draw_trajectories(page, folders, colors, which)
        elif part == "maps":
            comparison.draw_maps(page, dict(list(folders.items())[:_MAPS]), colors)
        else:
            comparison.draw_errors(page, errors, colors)
