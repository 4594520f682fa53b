"""Echoes that are followed from frame to frame by the range, speed and direction that the sensor's motion predicts."""

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.channels import Waves
from radarize.pipeline.calibration.egomotion import EgoMotion

#: Purity of cells that are followed, largest sine of azimuth, and m/s that a static world may be off.
_PURE, _EDGE, _STATIC = 0.8, 0.93, 0.1
#: Frames after which an echo that is not seen is given up, and the fewest that make a track.
_LOST, _FEWEST = 3, 12
#: By how much an echo differs from its prediction: range, m; direction cosines to the left and up; speed, m/s; and the
#: most that the squares of all four add up to.
_APART, _MOST = np.array([0.03, 0.05, 0.2, 0.15]), 6.0


def tracks_of(
    cells: Cells, waves: Waves, motion: EgoMotion, turning: Float[np.ndarray, "frame"], period: float
) -> list[Int[np.ndarray, "cell"]]:
    """Cells of each echo that is followed long enough, in order of time.

    Args:
        cells, waves, motion: of the walk.
        turning: yaw rate at each frame, rad/s.
        period: of frames, s.
    """
    left, up = motion.directions.T
    ahead = np.sqrt(np.maximum(1 - left**2 - up**2, 0.02))
    static = np.abs(np.nan_to_num(motion.residual, nan=np.inf)) < _STATIC
    chosen = np.flatnonzero(static & (waves.purity > _PURE) & (np.abs(left) < _EDGE))
    velocity = motion.velocity[cells.frame]
    # By how much a point's direction moves: it turns with the sensor and passes by.
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
