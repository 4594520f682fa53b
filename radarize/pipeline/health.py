"""How well odometry could do, by span, with advice: where it was blind, its speeds aliased, its chirps or receivers
disturbed, or surfaces out of reach."""

import numpy as np
from jaxtyping import Bool
from pydantic import BaseModel

from radarize.odometry.observability import SHORTEST, Finite, Observability, Spans
from radarize.pipeline.pipeline import Result
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.aliasing import Aliases

#: m/s, of people at ease.
WALKING_PACE = 1.4
#: Share of the largest resolved speed from which on speeds count as near aliasing.
_NEAR = 0.9
#: Few surfaces: a smaller share of a scan's bearings sees any. On 20 s walks through furnished rooms it is 0.06 at
#: least by first echoes, and 0.39 by segmentation.
_FEW = 0.04
_BLIND = {
    "no velocity": "too few echoes told the velocity: keep walls or furniture in view",
    "no turn": "nothing in view told the turn: turn more slowly, and keep more in view than a bare wall or glass",
    "frames lost": "frames did not arrive: look at the cable, and at what else the computer does",
}
_INTERFERENCE = "chirps off in level were left out: another radar may be near, use another start frequency"


class Condition(BaseModel):
    """From when to when (s) odometry had a hard time, of what kind, and what would help."""

    kind: str
    start_s: Finite
    stop_s: Finite
    advice: str


class Health:
    """Watches what a pipeline gives; memory grows with the number of spans alone.

    Args:
        radar: configuration of the frames that are used, whose limits the advice names.

    Attributes:
        blindness: of the odometry.
    """

    def __init__(self, radar: RadarConfig):
        self.radar, self.blindness, self._fastest = radar, Observability(radar.frame_period), Aliases(radar).fastest
        self._spans: dict[tuple[str, str], Spans] = {}  # by kind and advice
        self._first = self._last = np.nan
        self._aliased, self._far = ("aliased", self._too_fast()), ("out of reach", self._out_of_reach())

    def add(self, result: Result) -> None:
        """Take in what the next frames gave."""
        track = result.track
        self.blindness.add(track)
        if not len(track.time):
            return
        if np.isnan(self._last):
            self._first = self._last = float(track.time[0])
        starts = np.concatenate([[self._last], track.time[:-1]])
        for key, there in self._conditions(result).items():
            spans = self._spans.setdefault(key, Spans())
            for k in np.flatnonzero(there):
                # What frames left out hide is not known.
                spans.add(max(float(starts[k]), float(track.time[k]) - SHORTEST), float(track.time[k]), 0.0, ())
        self._last = float(track.time[-1])

    def _conditions(self, result: Result) -> dict[tuple[str, str], Bool[np.ndarray, "frame"]]:
        """Frames by kind and advice."""
        velocity = result.track.velocity
        found = {
            self._aliased: np.hypot(velocity[:, 0], velocity[:, 1]) > _NEAR * self._fastest,
            self._far: np.isfinite(result.ranges).mean(axis=1) < _FEW,
        }
        if (flaws := result.flaws) is not None:
            found["disturbed", _INTERFERENCE] = flaws.disturbed.any(axis=(1, 2))
            for word, broken in (("dead", flaws.dead), ("saturated", flaws.saturated)):
                for place in np.flatnonzero(broken.any(axis=0)):
                    found["disturbed", self._broken(place, word)] = broken[:, place]
        return found

    @property
    def found(self) -> list[Condition]:
        """All so far, in order of time."""
        blind = [
            Condition(
                kind="blind", start_s=span.start_s, stop_s=span.stop_s,
                advice="; ".join(_BLIND[cause] for cause in span.why.split(" and ")),
            )
            for span in self.blindness.found.spans
        ]  # fmt: skip
        others = [
            Condition(kind=kind, start_s=span.start_s, stop_s=span.stop_s, advice=advice)
            for (kind, advice), spans in self._spans.items()
            for span in spans.found
        ]
        return sorted([*blind, *others], key=lambda each: each.start_s)

    def warnings(self) -> list[str]:
        """A sentence on each kind, with times since the first frame, and on a limit that walking exceeds."""
        told = self.blindness.warnings()
        if self._fastest < WALKING_PACE:
            told.append(self._slow())
        for (kind, advice), spans in self._spans.items():
            if found := spans.found:
                longest = max(found, key=lambda span: span.duration)
                start, stop = longest.start_s - self._first, longest.stop_s - self._first
                told.append(
                    f"{kind} for {sum(span.duration for span in found):.1f} s, at the longest from {start:.1f} to "
                    f"{stop:.1f} s: {advice}"
                )
        return told

    # --- advice ------------------------------------------------------------------------------------------------------
    def _slow(self) -> str:
        return f"the configuration's speed limit of {self.radar.max_velocity:.2f} m/s is below walking pace"

    def _too_fast(self) -> str:
        limit, (name, best) = self._fastest, max(PRESETS.items(), key=lambda preset: preset[1].max_velocity)
        if limit < WALKING_PACE:
            return f"{self._slow()}: the `{name}` preset measures up to {best.max_velocity:.1f} m/s"
        return f"speeds alias beyond {limit:.2f} m/s: move more slowly, or use the `{name}` preset"

    def _out_of_reach(self) -> str:
        reach, longest = self.radar.ranges[-1], PRESETS["long-range"].ranges[-1]
        advice = f"few surfaces within {reach:.1f} m: "
        return advice + (f"the `long-range` preset sees {longest:.0f}" if longest > 1.5 * reach else "stay near walls")

    def _broken(self, place: int, word: str) -> str:
        name = f"RX{self.radar.rx[place] + 1}"
        return (
            f"{name} is {word}, and its neighbours stand in for it: repair it, or leave {name} out of the configuration"
        )
