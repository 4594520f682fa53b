"""Tracks of echoes from frame to frame, predicted from the motion of the sensor."""

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.channels import Waves
from radarize.pipeline.calibration.egomotion import EgoMotion

#: Minimum purity of tracked cells, maximum sine of azimuth, and maximum residual of a static echo, m/s.
_PURE, _EDGE, _STATIC = 0.8, 0.93, 0.1
#: Frames without detection after which a track ends, and minimum number of cells of a track.
_LOST, _FEWEST = 3, 12
#: Standard deviations of an echo about its prediction: range, m; direction cosines to the left and up; speed, m/s; and
#: the gate: maximum sum of the four normalised squares.
_APART, _MOST = np.array([0.03, 0.05, 0.2, 0.15]), 6.0


def tracks_of(
    cells: Cells, waves: Waves, motion: EgoMotion, turning: Float[np.ndarray, "frame"], period: float
) -> list[Int[np.ndarray, "cell"]]:
    """Return the cells of each sufficiently long track, in order of time.

    Args:
        cells, waves, motion: echoes, plane waves and motion of the walk.
        turning: yaw rate at each frame, rad/s.
        period: frame period, s.
    """
    left, up = motion.directions.T
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 0.02))
    static = np.abs(np.nan_to_num(motion.residual, nan=np.inf)) < _STATIC
    chosen = np.flatnonzero(static & (waves.purity > _PURE) & (np.abs(left) < _EDGE))
    velocity = motion.velocity[cells.frame]
    # Rate of a point's azimuth cosine, from the rotation of the sensor and its motion past the point.
    moves = -turning[cells.frame] * ahead - (velocity[:, 1] - cells.speed * left) / np.maximum(cells.range, 0.3)
    live: list[list[int]] = []
    found: list[list[int]] = []
    for here in np.split(chosen, np.flatnonzero(np.diff(cells.frame[chosen])) + 1):
        if not len(here):
            continue
        frame = cells.frame[here[0]]
        found += [track for track in live if frame - cells.frame[track[-1]] > _LOST]
        live = [track for track in live if frame - cells.frame[track[-1]] <= _LOST]
        last = np.array([track[-1] for track in live], int)
        passed = (frame - cells.frame[last]) * period
        expected = np.stack(
            [cells.range[last] - cells.speed[last] * passed, left[last] + moves[last] * passed, up[last],
             cells.speed[last]], axis=1
        )  # fmt: skip
        seen = np.stack([cells.range[here], left[here], up[here], cells.speed[here]], axis=1)
        apart = (((seen[None] - expected[:, None]) / _APART) ** 2).sum(axis=2)
        taken, free = set(), set(range(len(here)))
        for flat in np.argsort(apart, axis=None):
            track, cell = divmod(int(flat), len(here))
            if apart[track, cell] > _MOST:
                break
            if track not in taken and cell in free:
                taken.add(track)
                free.remove(cell)
                live[track].append(int(here[cell]))
        live += [[int(here[cell])] for cell in sorted(free)]
    return [np.array(track) for track in found + live if len(track) >= _FEWEST]
