"""Interference, and transmitter leakage at a wrong range."""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.signal.disturbance import find_flaws

#: Share of disturbed chirps above which interference is reported.
_DISTURBED = 0.003
#: m, range in which leakage of the transmitters, some cm away, is expected; dB by which it must exceed its
#: surroundings.
_LEAKS, _ABOVE = (-0.06, 0.18), 6.0
#: m, range up to which leakage is searched.
_SOUGHT = 0.8


def interference(evidence: Evidence) -> Iterator[Finding]:
    """Find chirps whose level deviates from that of the others."""
    if not len(evidence.samples):
        raise NotObservable("no frame is whole")
    share = float(find_flaws(evidence.samples, evidence.valid[evidence.chosen]).disturbed.mean())
    if share > _DISTURBED:
        yield Finding(
            "interference", f"{share:.1%} of the chirps differ from the others of their frame in level in most ranges",
            sureness(share, _DISTURBED), "use another start frequency, or find the other radar; `run` omits them",
        )  # fmt: skip


def leakage(evidence: Evidence) -> Iterator[Finding]:
    """Find transmitter leakage at a range other than a few centimetres."""
    config = evidence.config
    still = np.square(np.abs(evidence.profiles.mean(axis=(0, 1)))).mean(axis=(0, 1))
    reach = max(int(np.searchsorted(config.ranges, _SOUGHT)), 3)
    bins = np.arange(-reach, reach + 1)
    levels = 10 * np.log10(still[bins] + 1e-12)
    peak = int(levels.argmax())
    if not 0 < peak < len(bins) - 1 or levels[peak] - np.median(levels) < _ABOVE:
        raise NotObservable("no leakage stands out")
    left, middle, right = levels[peak - 1 : peak + 2]
    place = bins[peak] + 0.5 * (left - right) / min(left - 2 * middle + right, -1e-9)
    away = float(place * config.range_resolution - config.range_bias)
    if not _LEAKS[0] < away < _LEAKS[1]:
        yield Finding(
            "range bias", f"leakage of the transmitters is at {away:.2f} m, expected from {_LEAKS[0]} to {_LEAKS[1]} m",
            sureness(abs(away - sum(_LEAKS) / 2), (_LEAKS[1] - _LEAKS[0]) / 2),
            f"set the range bias to about {config.range_bias + away - 0.06:.2f} m (compRangeBiasAndRxChanPhase), see "
            "`radarize calibrate`",
        )  # fmt: skip
