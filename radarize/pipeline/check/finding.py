"""What a check finds, and what it cannot find."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Int

from radarize.radar.config import RadarConfig


@dataclass(frozen=True)
class Correction:
    """What turns wrong samples into right ones, without losing any.

    Attributes:
        config: of the radar as it should be; None: as it is.
        samples: called with frames (frame, loop, tx, rx, sample, 2), returns as many of the same kind.
        order: which frames stay, in their order; None: all as they are.
        keeps_stamps: the frames are put to the stamps that are there, one after the other, rather than keep their own.
        period: s: stamps are counted anew from the first one, so far apart; None: as they are.
    """

    config: RadarConfig | None = None
    samples: Callable[[np.ndarray], np.ndarray] | None = None
    order: Int[np.ndarray, "frame"] | None = None
    keeps_stamps: bool = False
    period: float | None = None


@dataclass(frozen=True)
class Finding:
    """A fault of a recording.

    Attributes:
        kind: which one, a key of `radarize.pipeline.check.faults.FAULTS`.
        measured: what was measured, with units.
        sure: how sure it is, 0 to 1.
        remedy: which option or change corrects it.
        correction: how a corrected recording is written; None where none can be.
        hides: nothing that comes after it in the samples can be judged unless it is corrected.
    """

    kind: str
    measured: str
    sure: float
    remedy: str
    correction: Correction | None = field(default=None, compare=False, repr=False)
    hides: bool = False

    def __str__(self) -> str:
        return f"{self.kind}: {self.measured} ({self.sure:.0%} sure); {self.remedy}"

    def row(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "kind": self.kind, "measured": self.measured, "sure": round(self.sure, 3), "remedy": self.remedy,
            "correctable": self.correction is not None,
        }  # fmt: skip


class NotObservable(Exception):
    """A recording does not show whether a fault is there; the message says why."""
