"""What a benchmark's page shows below its tables, read from its runs."""

from collections.abc import Callable

import numpy as np

from radarize.benchmark.dataset import Case
from radarize.benchmark.runs import Pair, Run
from radarize.benchmark.study import Study
from radarize.evaluation.evaluate import TRAJECTORIES
from radarize.evaluation.runfiles import read_map, read_scans
from radarize.evaluation.trajectory import fitted, load, moved
from radarize.report import comparison
from radarize.report.page import COLORS, OTHERS, Page

#: Recordings whose maps are shown.
_MAPS = 4


def draw_odometry(study: Study, page: Page) -> None:
    """Trajectories and errors of odometry."""
    drawn = _Drawn(study, lambda pair: pair.odometry)
    drawn.trajectories(page, "odometry")
    drawn.errors(page, "odometry")


def draw_slam(study: Study, page: Page) -> None:
    """Trajectories, errors and maps of SLAM."""
    drawn = _Drawn(study, str)
    drawn.trajectories(page, "slam")
    drawn.errors(page, "slam")
    drawn.maps(page)


def draw_maps(study: Study, page: Page) -> None:
    """Maps and errors of SLAM."""
    drawn = _Drawn(study, lambda pair: pair.scans)
    drawn.maps(page)
    drawn.errors(page, "slam")


class _Drawn:
    """A study's runs by names that pairs are given; nothing is drawn without any."""

    def __init__(self, study: Study, name: Callable[[Pair], str]):
        self._study = study
        self._runs = {name(pair): runs for pair in study.pairs if (runs := study.once(pair))}
        ours = study.chosen.partner
        others = enumerate(study.pairs)
        self._colors = {name(p): COLORS["slam"] if p == ours else OTHERS[k % len(OTHERS)] for k, p in others}

    @property
    def _cases(self) -> dict[Case, dict[str, Run]]:
        """Runs by recording."""
        found: dict[Case, dict[str, Run]] = {}
        for name, runs in self._runs.items():
            for run in runs:
                found.setdefault(run.case, {})[name] = run
        return found

    def trajectories(self, page: Page, which: str) -> None:
        """Of all recordings."""
        paths = {}
        for case, runs in self._cases.items():
            truth = load(self._study.output / next(iter(runs.values())).place / "reference.tum")
            paths[case.name] = {"truth": truth.positions_xyz[:, :2]}
            for name, run in runs.items():
                path = load(self._study.output / run.place / TRAJECTORIES[which])
                paths[case.name][name] = moved(path, *fitted(path, truth)).positions_xyz[:, :2]
        if paths:
            comparison.draw_trajectories(page, paths, self._colors)

    def errors(self, page: Page, which: str) -> None:
        """Of all poses, and means of recordings."""
        found, errors, means = self._study.results, {}, {}
        for name, runs in self._runs.items():
            errors[name] = np.concatenate([found[run]["quantiles"][which] for run in runs])
            means[name] = {run.case.name: found[run][which]["ate"]["position"]["mean"] for run in runs}
        if errors:
            comparison.draw_errors(page, errors, means, self._colors)

    def maps(self, page: Page) -> None:
        """Of the first recordings."""
        floors = {}
        for case, runs in list(self._cases.items())[:_MAPS]:
            cells = {}
            for name, run in runs.items():
                folder = self._study.output / run.place
                truth, grid = load(folder / "reference.tum"), read_map(folder / "map.yaml")
                turn, shift = fitted(load(folder / TRAJECTORIES["slam"]), truth)
                cells[name] = grid.centers(grid.occupied) @ turn[:2, :2].T + shift[:2]
            plan = read_scans(folder / "scans.h5").get("truth/floor_plan")
            floors[case.name] = comparison.Floor(plan, truth.positions_xyz[:, :2], cells)
        if floors:
            comparison.draw_maps(page, floors, self._colors)
