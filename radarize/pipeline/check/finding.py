"""A fault that a check found, its correction, and why a fault is not observable."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Int

from radarize.radar.config import RadarConfig


@dataclass(frozen=True)
class Correction:
    """A lossless change of samples or configuration that corrects a fault.

    Attributes:
        config: corrected configuration of the radar; None: unchanged.
        samples: function of frames (frame, loop, tx, rx, sample, 2) that returns the corrected ones; None: unchanged.
        order: numbers of the frames to keep, in the corrected order; None: unchanged.
        keeps_stamps: the reordered frames take the existing stamps in order instead of keeping their own.
        period: s, frame period with which stamps are counted from the first one; None: unchanged.
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
        kind: kind of the fault, one of `radarize.pipeline.check.faults.FAULTS`.
        measured: what was measured, with units.
        sure: confidence, 0 to 1.
        remedy: option or change that corrects it.
        correction: correction to write; None if there is none.
        hides: later tests cannot judge the samples unless it is corrected.
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
        """Return the finding as a dictionary for JSON."""
        return {
            "kind": self.kind, "measured": self.measured, "sure": round(self.sure, 3), "remedy": self.remedy,
            "correctable": self.correction is not None,
        }  # fmt: skip


class NotObservable(Exception):
    """A recording does not show whether a fault is there; the message is the reason."""
