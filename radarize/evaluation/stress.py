"""Metrics of a run under multipath: wrong returns by path type, missed surfaces, errors of map and trajectory.

A wrong return has a range error of more than 10 cm against the first surface on its bearing. Its path type is that of
the strongest echo of its cell, which simulated recordings contain (``radarsim simulate --sensors ghosts``).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.evaluation.figures import Figure
from radarize.evaluation.mapping import TOLERANCE
from radarize.evaluation.metrics import over
from radarize.evaluation.scans import wrong_by_path_type
from radarize.io.recording import Recording

#: Groups of path types of wrong returns: labels of /truth/cause.
SOURCES = {
    "ghosts": ("ghost", "ghost_1", "ghost_2", "ghost_3"),  # the numbered ones: recordings of release 1.0
    "behind": ("through_slab",),
    "moving": ("moving",),
    "clutter": ("direct", "floor_ceiling"),
    "noise": ("leakage", "noise"),
}
#: Metrics by name, of `radarize.evaluation.benchmark.runs.figures`.
FIGURES = {
    "ghosts": Figure("ghosts", "sources.ghosts", "% of returns", 100),
    "behind": Figure("seen through a slab", "sources.behind", "% of returns", 100),
    "moving": Figure("ghosts and sidebands of moving targets", "sources.moving", "% of returns", 100),
    "clutter": Figure("direct echoes from other directions", "sources.clutter", "% of returns", 100),
    "noise": Figure("noise and leakage", "sources.noise", "% of returns", 100),
    "missed": Figure("missed surfaces", "missed", "% of bearings", 100),
    "map_f1": Figure("map F1", "map.f1", "%", 100),
    "matching": Figure("ATE of scan matching", "matching", "m"),
    "odometry": Figure("odometry ATE", "odometry.ate.position.mean", "m"),
    "slam": Figure("SLAM ATE", "slam.ate.position.mean", "m"),
}


def missed(measured: Float[np.ndarray, "scan beam"], true: Float[np.ndarray, "scan beam"]) -> float:
    """Return the share of bearings with a surface in range but without a return at it or in front of it.

    Args:
        measured: ranges, m; not finite, or 0, without a return.
        true: ranges, m; inf without a surface in range.

    Returns:
        The share; a return within 10 cm behind the surface counts as at it. NaN without surfaces.
    """
    reach = np.isfinite(true)
    seen = np.isfinite(measured) & (measured > 0) & (measured <= true + TOLERANCE)
    return 1 - over(seen[reach])


def sources(scans: Mapping[str, np.ndarray], true: Float[np.ndarray, "scan beam"], recording: Path) -> dict[str, float]:
    """Return the shares of wrong returns by `SOURCES`; empty if the recording has no path types.

    Args:
        scans: scans of a run, as returned by `read_scans`.
        true: true ranges on the same bearings, m.
        recording: recording of the run.

    Raises:
        InputError: unreadable recording.
    """
    with Recording(recording) as source:
        if not source.has("truth/cause") or not source.labels("truth/cause"):
            return {}
        frames = np.searchsorted(source.times, scans["time"]) - 1  # a scan's time is the middle of its burst
        axes = source.read("truth/cause_ranges"), source.read("truth/cause_azimuths")
        cause, names = source.read("truth/cause")[frames], source.labels("truth/cause")
    wrong = wrong_by_path_type(scans["ranges"], true, scans["azimuths"], cause, *axes, names)
    return {source: sum(wrong.get(name, 0.0) for name in names) for source, names in SOURCES.items()}
