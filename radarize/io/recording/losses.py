"""Statistics of frames and chirps that were lost."""

import numpy as np
from jaxtyping import Bool, Float

from radarize.radar.numbering import Numbering


class Losses:
    """Counts chirps and frames with lost samples, and missing frames.

    Args:
        period: frame period, s.

    Attributes:
        frames, chirps: total numbers.
        lost_chirps: number of chirps with lost samples.
        hit_frames, lost_frames: number of frames with some such chirps, and with only such chirps.
    """

    def __init__(self, period: float):
        self.frames = self.chirps = self.lost_chirps = self.hit_frames = self.lost_frames = 0
        self._numbering = Numbering(period)

    def add(self, valid: Bool[np.ndarray, "frame loop tx"], stamps: Float[np.ndarray, "frame"]) -> None:
        """Add frames to the counts."""
        self._numbering.of(stamps)
        whole = valid.reshape(len(valid), int(np.prod(valid.shape[1:])))
        self.frames += len(valid)
        self.chirps += whole.size
        self.lost_chirps += whole.size - int(np.count_nonzero(whole))
        self.hit_frames += int((~whole.all(axis=1)).sum())
        self.lost_frames += int((~whole.any(axis=1)).sum())

    def warnings(self) -> list[str]:
        """Return a sentence on missing frames, and one on lost samples, if there are any."""
        missing, share = self._numbering.missing, self.lost_chirps / max(self.chirps, 1)
        warnings = [f"{missing} frames are missing between others"] if missing else []
        if self.lost_chirps:
            warnings.append(
                f"{self.lost_chirps} of {self.chirps} chirps ({share:.2%}) in {self.hit_frames} of {self.frames} "
                f"frames lost samples, {self.lost_frames} frames all of them; these are zero and the chirps marked in "
                "/radar/valid"
            )
        return warnings
