"""How much of a recording never arrived."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool


@dataclass
class Losses:
    """Counts of chirps and frames with lost samples.

    Attributes:
        frames, chirps: seen in all.
        lost_chirps: with lost samples.
        hit_frames, lost_frames: frames with such chirps, and with nothing else.
    """

    frames: int = 0
    chirps: int = 0
    lost_chirps: int = 0
    hit_frames: int = 0
    lost_frames: int = 0

    def add(self, valid: Bool[np.ndarray, "frame loop tx"]) -> None:
        """Count more frames."""
        whole = valid.reshape(len(valid), int(np.prod(valid.shape[1:])))
        self.frames += len(valid)
        self.chirps += whole.size
        self.lost_chirps += whole.size - int(np.count_nonzero(whole))
        self.hit_frames += int((~whole.all(axis=1)).sum())
        self.lost_frames += int((~whole.any(axis=1)).sum())

    def warnings(self) -> list[str]:
        """One sentence, or none if nothing was lost."""
        if not self.lost_chirps:
            return []
        share = self.lost_chirps / self.chirps
        return [
            f"{self.lost_chirps} of {self.chirps} chirps ({share:.2%}) in {self.hit_frames} of {self.frames} frames "
            f"lost samples, {self.lost_frames} frames all of them; these are zero and the chirps marked in /radar/valid"
        ]
