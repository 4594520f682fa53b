"""Faults of time stamps: impossible or contradicting the configuration; missing frames and chirps."""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.pipeline.check.tracks import range_rate_factor
from radarize.radar.numbering import Numbering

#: Share by which the step of stamps may differ from the frame period; for range rate over Doppler, the share and number
#: of standard deviations: chirps are known to 1e-5, and ranges are measured in bins of some cm.
_STEP, _RATE, _SIGMAS = 0.03, 0.08, 5.0
#: Share of chirps or frames that may be lost without a finding.
_LOST = 0.0


def bursts(evidence: Evidence) -> Iterator[Finding]:
    """Find stamps closer to each other than a burst takes."""
    config, steps = evidence.config, _steps(evidence)
    short = steps < 0.9 * config.burst_time
    if short.mean() > 0.01:
        yield Finding(
            "stamps too dense", f"{short.mean():.0%} of the frames begin {_time(float(np.median(steps[short])))} after "
            f"the one before, but a burst takes {_time(config.burst_time)}", 1.0,
            f"count stamps from the frame period, {_time(config.frame_period)}",
            Correction(period=config.frame_period), hides=True,
        )  # fmt: skip


def period(evidence: Evidence) -> Iterator[Finding]:
    """Find stamps with another step than the frame period."""
    config = evidence.config
    step = float(np.median(_steps(evidence)))
    if abs(step / config.frame_period - 1) < _STEP:
        return
    measured = f"stamps are {_time(step)} apart, the configured frame period is {_time(config.frame_period)}"
    remedy, correction = "check which of them is correct (--frame-period)", None
    try:
        by_stamps = range_rate_factor(evidence.tracks, evidence.times).value
        by_period = by_stamps * step / config.frame_period
        if abs(abs(by_stamps) - 1) < 0.1:
            measured += f"; ranges change {abs(by_stamps):.2f} times as fast as Doppler predicts with the stamps"
            remedy = f"set the frame period to {_time(step)} (--frame-period)"
            correction = Correction(config.model_copy(update={"frame_period": step}))
        elif abs(abs(by_period) - 1) < 0.1:
            measured += f"; ranges change {abs(by_period):.2f} times as fast as Doppler predicts with the configuration"
            remedy, correction = "count stamps from the frame period", Correction(period=config.frame_period)
    except NotObservable:
        pass
    yield Finding("frame period", measured, sureness(abs(step / config.frame_period - 1), _STEP), remedy, correction)


def missing(evidence: Evidence) -> Iterator[Finding]:
    """Find gaps in the stamps, and chirps that never arrived."""
    config = evidence.config
    if len(evidence) > 1:
        step = float(np.median(_steps(evidence)))
        numbering = Numbering(step if abs(step / config.frame_period - 1) > _STEP else config.frame_period)
        numbering.of(evidence.times)
        if numbering.missing:
            yield Finding(
                "frames missing", f"{numbering.missing} frames are missing between {len(evidence)} others", 1.0,
                "check the cable, the packet delay, and the load of the computer",
            )  # fmt: skip
    lost = 1 - float(evidence.valid.mean()) if evidence.valid.size else 0.0
    if lost > _LOST:
        yield Finding(
            "chirps lost", f"{lost:.2%} of the chirps lost samples in transmission", 1.0,
            "check the cable, the packet delay, and the load of the computer",
        )  # fmt: skip


def chirps(evidence: Evidence) -> Iterator[Finding]:
    """Find range rates that differ from Doppler speeds by a factor."""
    factor = range_rate_factor(evidence.tracks, evidence.times)
    off = abs(abs(factor.value) - 1)
    if off > max(_RATE, _SIGMAS * factor.error):
        yield Finding(
            "chirp parameters",
            f"ranges change {abs(factor.value):.2f} +- {factor.error:.2f} times as fast as Doppler predicts",
            sureness(off / max(_RATE, _SIGMAS * factor.error), 1.0),
            "check slope and sample rate (range), and idle and ramp-end time (speed) of the profile",
        )  # fmt: skip


def _steps(evidence: Evidence) -> np.ndarray:
    if len(evidence) < 2:
        raise NotObservable("there is a single frame")
    return np.diff(evidence.times)


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.4g} ms" if seconds > 1e-4 else f"{1e6 * seconds:.3g} us"
