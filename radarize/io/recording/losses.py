"""How much of a recording never arrived."""

import numpy as np
from jaxtyping import Bool, Float

from radarize.radar.numbering import Numbering


class Losses:
    """Counts of chirps and frames with lost samples, and of frames that never came.

    Args:
        period: between frames, s.

    Attributes:
        frames, chirps: seen in all.
        lost_chirps: with lost samples.
        hit_frames, lost_frames: frames with such chirps, and with nothing else.
    """

    def __init__(self, period: float):
        self.frames = self.chirps = self.lost_chirps = self.hit_frames = self.lost_frames = 0
        self._numbering = Numbering(period)

    def add(self, valid: Bool[np.ndarray, "frame loop tx"], stamps: Float[np.ndarray, "frame"]) -> None:
        """Count more frames."""
        self._numbering.of(stamps)
        whole = valid.reshape(len(valid), int(np.prod(valid.shape[1:])))
        self.frames += len(valid)
        self.chirps += whole.size
        self.lost_chirps += whole.size - int(np.count_nonzero(whole))
        self.hit_frames += int((~whole.all(axis=1)).sum())
        self.lost_frames += int((~whole.any(axis=1)).sum())

    def warnings(self) -> list[str]:
        """A sentence on missing frames, and one on lost samples, where there are any."""
        missing, share = self._numbering.missing, self.lost_chirps / max(self.chirps, 1)
        told = [f"{missing} frames are missing between others"] if missing else []
        if self.lost_chirps:
            told.append(
                f"{self.lost_chirps} of {self.chirps} chirps ({share:.2%}) in {self.hit_frames} of {self.frames} "
                f"frames lost samples, {self.lost_frames} frames all of them; these are zero and the chirps marked in "
                "/radar/valid"
            )
        return told
