"""How far RadarHD's radar and lidar pictures of one number are apart in time, walk by walk.

Clocks are estimated by how alike pictures are (`radarize.baselines.walks.clock`). An independent check: turns
by shifting the radar's pictures against each other, compared with those of the lidar's poses, matched by
frame index and by time.
"""

import argparse

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.ndimage import gaussian_filter1d

from benchmarks.results import CLONE, POSES, Page, radarhd, script, tracked
from radarize.baselines.real.motion import shifted_turns, smoothed
from radarize.baselines.real.real import clocked_turn_errors
from radarize.baselines.walks.clock import APART, Alike, Clock, alike
from radarize.baselines.walks.poses import poses_of
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.evaluation.benchmark.choices import TRAINING

#: Walks that are drawn: two of the building of the training, two of another.
SHOWN = (118, 132, 227, 237)
#: Frames, standard deviation, of what is drawn.
_SMOOTH = 3


def draw(shown: list[tuple[Walk, Clock, Alike]]) -> Figure:
    """How alike pictures are, over the walk and over how much later the lidar's is."""
    figure, axes = plt.subplots(1, len(shown), figsize=(11, 3), sharey=True)
    for axis, (walk, clock, known) in zip(axes, shown, strict=True):
        found = gaussian_filter1d(np.nan_to_num(known), _SMOOTH, axis=1)
        end, most = PERIOD * walk.frames, PERIOD * APART
        # A lidar's picture of a larger number is taken earlier than its number says.
        axis.imshow(found[::-1], aspect="auto", origin="lower", extent=(0, end, -most, most), vmin=0, vmax=0.5)
        frames = np.array([0, walk.frames - 1])
        axis.plot(PERIOD * frames, PERIOD * (frames - clock.lidar(frames)), "w--", lw=1)
        axis.axhline(0, color="w", lw=0.5)
        axis.set(title=f"walk {walk.number}", xlabel="s", ylim=(-most, most))
    axes[0].set_ylabel("lidar's picture later by, s")
    figure.tight_layout()
    return figure


@script("Clocks of real walks", data=CLONE, poses=POSES)
def main(options: argparse.Namespace) -> Page:
    """All walks, training and test."""
    walks = [Walk.find(options.data, number) for number in TRAINING] + Walk.tests(options.data)
    rows, shown = [], []
    for walk in tracked(walks, "walks"):
        known = alike(walk)
        clock = Clock.along(known)
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
            "By how many seconds the lidar's picture is later than the radar's of the same number, at a walk's start "
            "and end; mean correlation of pictures of one number, and of one instant; by how much two halves of the "
            "walk differ. Without figures: too short, or nothing moved.",
            "Yaw over 0.2 s by shifting the radar's pictures against each other, smoothed over 0.3 s: error against "
            "the lidar's poses, by number and by instant. The clocks do not know it.",
        ],
    )
