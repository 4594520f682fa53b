"""Conditions that degrade odometry, by time span and with advice: unobservable motion, aliased speeds, disturbed chirps
or receivers, and surfaces out of range."""

import numpy as np
from jaxtyping import Bool
from pydantic import BaseModel

from radarize.odometry.observability import SHORTEST, Finite, Observability, Spans
from radarize.pipeline.pipeline import Result
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.aliasing import Aliases

#: m/s, comfortable walking speed of adults.
WALKING_PACE = 1.4
#: Share of the largest unambiguous speed above which speeds count as close to aliasing.
_NEAR = 0.9
#: Share of a scan's bearings with a surface below which surfaces count as few. On walks of 20 s through furnished rooms
#: it is at least 0.06 with first echoes and 0.39 with segmentation.
_FEW = 0.04
_UNOBSERVABLE = {
    "no velocity": "too few echoes to measure the velocity: keep walls or furniture in view",
    "no turn": "nothing in view shows the rotation: turn more slowly, and keep more in view than a bare wall or glass",
    "frames lost": "frames did not arrive: check the cable and the load of the computer",
}
_INTERFERENCE = "chirps of deviating level were left out: another radar may be near, use another start frequency"


class Condition(BaseModel):
    """A time span (s) in which odometry was degraded, the kind of degradation, and advice."""

    kind: str
    start_s: Finite
    stop_s: Finite
    advice: str


class Health:
    """Collects the conditions that degrade odometry from the results of a pipeline; memory grows with their number
    only.

    Args:
        radar: configuration of the frames that are used; the advice states its limits.

    Attributes:
        observability: spans in which odometry could not observe the motion.
    """

    def __init__(self, radar: RadarConfig):
        self.radar, self.observability, self._fastest = radar, Observability(radar.frame_period), Aliases(radar).fastest
        self._spans: dict[tuple[str, str], Spans] = {}  # by kind and advice
        self._first = self._last = np.nan
        self._aliased, self._far = ("aliased", self._too_fast()), ("out of reach", self._out_of_reach())

    def add(self, result: Result) -> None:
        """Process the result of the next batch."""
        track = result.track
        self.observability.add(track)
        if not len(track.time):
            return
        if np.isnan(self._last):
            self._first = self._last = float(track.time[0])
        starts = np.concatenate([[self._last], track.time[:-1]])
        for key, there in self._conditions(result).items():
            spans = self._spans.setdefault(key, Spans())
            for k in np.flatnonzero(there):
                # The state within skipped frames is unknown.
                spans.add(max(float(starts[k]), float(track.time[k]) - SHORTEST), float(track.time[k]), 0.0, ())
        self._last = float(track.time[-1])

    def _conditions(self, result: Result) -> dict[tuple[str, str], Bool[np.ndarray, "frame"]]:
        """Return which frames are affected, by kind and advice."""
        velocity = result.track.velocity
        found = {
            self._aliased: np.hypot(velocity[:, 0], velocity[:, 1]) > _NEAR * self._fastest,
            self._far: np.isfinite(result.ranges).mean(axis=1) < _FEW,
        }
        if (flaws := result.flaws) is not None:
            found["disturbed", _INTERFERENCE] = flaws.disturbed.any(axis=(1, 2))
            for state, broken in (("dead", flaws.dead), ("saturated", flaws.saturated)):
                for place in np.flatnonzero(broken.any(axis=0)):
                    found["disturbed", self._broken(int(place), state)] = broken[:, place]
        return found

    @property
    def found(self) -> list[Condition]:
        """Return all conditions so far, in order of time."""
        unobservable = [
            Condition(
                kind="unobservable", start_s=span.start_s, stop_s=span.stop_s,
                advice="; ".join(_UNOBSERVABLE[cause] for cause in span.why.split(" and ")),
            )
            for span in self.observability.found.spans
        ]  # fmt: skip
        others = [
            Condition(kind=kind, start_s=span.start_s, stop_s=span.stop_s, advice=advice)
            for (kind, advice), spans in self._spans.items()
            for span in spans.found
        ]
        return sorted([*unobservable, *others], key=lambda each: each.start_s)

    def warnings(self) -> list[str]:
        """Return a sentence on each kind, with times since the first frame, and on a speed limit below walking pace."""
        warnings = self.observability.warnings()
        if self._fastest < WALKING_PACE:
            warnings.append(self._slow())
        for (kind, advice), spans in self._spans.items():
            if found := spans.found:
                longest = max(found, key=lambda span: span.duration)
                start, stop = longest.start_s - self._first, longest.stop_s - self._first
                warnings.append(
                    f"{kind} for {sum(span.duration for span in found):.1f} s in all, at the longest from "
                    f"{start:.1f} to {stop:.1f} s: {advice}"
                )
        return warnings

    # --- advice ------------------------------------------------------------------------------------------------------
    def _slow(self) -> str:
        return f"the configuration's maximum speed of {self.radar.max_velocity:.2f} m/s is below walking pace"

    def _too_fast(self) -> str:
        limit, (name, best) = self._fastest, max(PRESETS.items(), key=lambda preset: preset[1].max_velocity)
        if limit < WALKING_PACE:
            return f"{self._slow()}: the `{name}` preset measures up to {best.max_velocity:.1f} m/s"
        return f"speeds above {limit:.2f} m/s are aliased: move more slowly, or use the `{name}` preset"

    def _out_of_reach(self) -> str:
        reach, longest = self.radar.ranges[-1], PRESETS["long-range"].ranges[-1]
        advice = f"few surfaces within {reach:.1f} m: "
        return advice + (
            f"the `long-range` preset measures up to {longest:.0f} m" if longest > 1.5 * reach else "stay near walls"
        )

    def _broken(self, place: int, state: str) -> str:
        name = f"RX{self.radar.rx[place] + 1}"
        return f"{name} is {state} and interpolated from its neighbours: repair it, or disable it in the configuration"
