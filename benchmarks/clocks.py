"""Time offset between RadarHD's radar and lidar pictures of equal frame index, for each walk.

Clocks are estimated from the correlation of the pictures (`radarize.baselines.walks.clock`). Changes of yaw are an
independent check: those of the radar, by shifting its pictures against each other, are compared with those of the
lidar's poses, matched by frame index and by time.
"""

import argparse

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.ndimage import gaussian_filter1d

from benchmarks.results import CLONE, POSES, Page, radarhd, script, tracked
from radarize.baselines.real.motion import shifted_turns, smoothed
from radarize.baselines.real.real import clocked_turn_errors
from radarize.baselines.walks.clock import MAX_SHIFT, Clock, PictureCorrelation, picture_correlation
from radarize.baselines.walks.poses import poses_of
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.evaluation.benchmark.choices import TRAINING

#: Walks in the figure: two of the building of the training walks, two of another building.
SHOWN = (118, 132, 227, 237)
#: Standard deviation of the Gaussian that smooths the figure along the walk, frames.
_SMOOTH = 3


def draw(shown: list[tuple[Walk, Clock, PictureCorrelation]]) -> Figure:
    """Draw the correlation of pictures over time and over the delay of the lidar, with the estimated clock."""
    figure, axes = plt.subplots(1, len(shown), figsize=(11, 3), sharey=True)
    for axis, (walk, clock, known) in zip(axes, shown, strict=True):
        found = gaussian_filter1d(np.nan_to_num(known), _SMOOTH, axis=1)
        end, most = PERIOD * walk.frames, PERIOD * MAX_SHIFT
        # Rows ascend with the shift of the lidar's frame index, and so descend with its delay.
        axis.imshow(found[::-1], aspect="auto", origin="lower", extent=(0, end, -most, most), vmin=0, vmax=0.5)
        frames = np.array([0, walk.frames - 1])
        axis.plot(PERIOD * frames, PERIOD * (frames - clock.lidar(frames)), "w--", lw=1)
        axis.axhline(0, color="w", lw=0.5)
        axis.set(title=f"walk {walk.number}", xlabel="time, s", ylim=(-most, most))
    axes[0].set_ylabel("delay of the lidar's picture, s")
    figure.tight_layout()
    return figure


@script("Clocks of real walks", data=CLONE, poses=POSES)
def main(options: argparse.Namespace) -> Page:
    """Estimate the clocks of all walks, training and test."""
    walks = [Walk.find(options.data, number) for number in TRAINING] + Walk.tests(options.data)
    rows, shown = [], []
    for walk in tracked(walks, "walks"):
        known = picture_correlation(walk)
        clock = Clock.fit(known)
        if walk.number in SHOWN:
            shown.append((walk, clock, known))
        turns = smoothed(shifted_turns(np.stack([walk.radar(frame) for frame in range(walk.frames)])))
        errors = clocked_turn_errors(turns, poses_of(walk, options.poses), clock)
        yaw = {name: errors[name] for name in ("yaw_rmse_deg", "instant_yaw_rmse_deg")}
        rows.append({"walk": walk.number, "part": walk.folder.name, **clock.row(walk.frames), **yaw})
    return Page(
        rows,
        figure=draw(shown),
        data=radarhd("RadarHD's walks", walks),
        notes=[
            "start_s, end_s: delay of the lidar's picture against the radar's of equal frame index, at start and end "
            "of a walk; mean correlation of pictures matched by frame index and by time; halves differ_s: largest "
            "difference between the clocks of two halves of the walk. Rows without figures: the walk is too short or "
            "has no motion.",
            "yaw_rmse_deg, instant_yaw_rmse_deg: RMSE of changes of yaw over 0.2 s against the lidar's poses, matched "
            "by frame index and by time. They are estimated by shifting the radar's pictures against each other, "
            "smoothed over 0.3 s; the estimate of the clocks does not use them.",
        ],
    )
