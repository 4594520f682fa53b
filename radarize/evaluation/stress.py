"""What a run makes of echoes that come from no first surface, figure by figure.

A wrong return is one more than 10 cm off the first surface on its bearing. What it comes from is the strongest cause of
its cell, which a simulated recording knows (``radarsim simulate --sensors ghosts``).
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.evaluation.figures import Figure
from radarize.evaluation.mapping import TOLERANCE
from radarize.evaluation.metrics import over
from radarize.evaluation.scans import wrong_by_cause
from radarize.io.recording import Recording

#: What wrong returns come from, by labels of /truth/cause.
SOURCES = {
    "ghosts": ("ghost", "ghost_1", "ghost_2", "ghost_3"),  # the numbered ones: recordings of release 1.0
    "behind": ("through_slab",),
    "moving": ("moving",),
    "clutter": ("direct", "floor_ceiling"),
    "noise": ("leakage", "noise"),
}
#: Figures by name, of `radarize.evaluation.benchmark.runs.figures`.
FIGURES = {
    "ghosts": Figure("ghosts", "sources.ghosts", "% of returns", 100),
    "behind": Figure("seen through a slab", "sources.behind", "% of returns", 100),
    "moving": Figure("ghosts and skirts of what moves", "sources.moving", "% of returns", 100),
    "clutter": Figure("direct echoes beside, above, below", "sources.clutter", "% of returns", 100),
    "noise": Figure("noise and leakage", "sources.noise", "% of returns", 100),
    "missed": Figure("missed surfaces", "missed", "% of bearings", 100),
    "map_f1": Figure("map F1", "map.f1", "%", 100),
    "matching": Figure("ATE of scan matching", "matching", "m"),
    "odometry": Figure("odometry ATE", "odometry.ate.position.mean", "m"),
    "slam": Figure("SLAM ATE", "slam.ate.position.mean", "m"),
}


def missed(measured: Float[np.ndarray, "scan beam"], true: Float[np.ndarray, "scan beam"]) -> float:
    """Share of bearings with a surface in reach that return nothing at it or before it: it does not exist for them.

    Args:
        measured: ranges, m; not finite, or 0, where nothing was returned.
        true: ranges, m; inf where there is no surface in reach.

    Returns:
        The share, a return within 10 cm behind the surface counting as at it; NaN without surfaces.
    """
    reach = np.isfinite(true)
    seen = np.isfinite(measured) & (measured > 0) & (measured <= true + TOLERANCE)
    return 1 - over(seen[reach])


def sources(scans: Mapping[str, np.ndarray], true: Float[np.ndarray, "scan beam"], recording: Path) -> dict[str, float]:
    """Shares of returned bearings that are wrong, by `SOURCES`; empty where the recording does not know.

    Args:
        scans: of a run, as `read_scans` gives them.
        true: ranges on the same bearings, m.
        recording: that the run was made of.

    Raises:
        InputError: unreadable recording.
    """
    with Recording(recording) as source:
        if not source.has("truth/cause") or not source.labels("truth/cause"):
            return {}
        frames = np.searchsorted(source.times, scans["time"]) - 1  # a scan's instant is in the middle of its burst
        axes = source.read("truth/cause_ranges"), source.read("truth/cause_azimuths")
        cause, names = source.read("truth/cause")[frames], source.labels("truth/cause")
    wrong = wrong_by_cause(scans["ranges"], true, scans["azimuths"], cause, *axes, names)
    return {source: sum(wrong.get(name, 0.0) for name in names) for source, names in SOURCES.items()}
