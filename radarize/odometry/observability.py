"""Spans in which heading or velocity was unobservable: no velocity, no yaw increment, or no frames.

Odometry continues there with predictions. A span runs from the last frame with observed motion to the last one without.
Spans less than `SHORTEST` apart are joined; a span that is then shorter than `SHORTEST` is left out, because the
filters bridge it.
"""

from collections.abc import Iterable
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, PlainSerializer

from radarize.odometry.integration import Track
from radarize.radar.numbering import Numbering

#: Minimum duration of a span, s.
SHORTEST = 0.3
#: Causes, in the order in which they are listed.
CAUSES = ("no velocity", "no turn", "frames lost")


Finite = Annotated[float, Field(allow_inf_nan=False), PlainSerializer(lambda value: round(value, 4))]
Amount = Annotated[Finite, Field(ge=0)]


class Span(BaseModel):
    """Span in which motion was unobservable: start and end, s; length of the path that odometry predicted meanwhile, m;
    its causes."""

    start_s: Finite
    stop_s: Finite
    way_m: Amount
    why: str

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.stop_s - self.start_s


class UnobservableSpans(BaseModel):
    """All spans, the sum of their path lengths (m), and its share of the whole path."""

    share_of_way: Amount
    way_m: Amount
    spans: list[Span]


class Spans:
    """Joins consecutive frames with the same condition to spans; memory grows only with the number of spans."""

    def __init__(self):
        self._spans: list[Span] = []

    def add(self, start: float, stop: float, way: float, causes: Iterable[str]) -> None:
        """Add the next interval (s), with its path length (m) and causes, some of `CAUSES` or others: extend the last
        span or start a new one."""
        causes = {*causes}
        span = self._spans.pop() if self._spans else None
        if span and 0 <= start - span.stop_s < SHORTEST:
            start, way, causes = span.start_s, span.way_m + way, causes | {*span.why.split(" and ")}
        elif span and span.duration >= SHORTEST:
            self._spans.append(span)
        why = " and ".join(sorted(causes, key=lambda cause: (*CAUSES, cause).index(cause)))
        self._spans.append(Span(start_s=start, stop_s=stop, way_m=way, why=why))

    @property
    def found(self) -> list[Span]:
        """All spans so far of at least `SHORTEST`, in order of time."""
        return sorted((span for span in self._spans if span.duration >= SHORTEST), key=lambda span: span.start_s)


class Observability:
    """Finds the spans of a stream in which motion was unobservable; memory grows only with their number.

    Args:
        period: s, between frames that odometry uses.

    Attributes:
        way: m, length of the path so far.
    """

    def __init__(self, period: float):
        self.way = 0.0
        self._numbering = Numbering(period)
        self._spans = Spans()
        self._first = 0.0
        self._last: tuple[int, float] | None = None  # number and time of the previous frame

    def add(self, track: Track) -> None:
        """Process the next frames."""
        ways = np.hypot(track.step[:, 0], track.step[:, 1])
        self.way += float(ways.sum())
        numbers, seen = self._numbering.of(track.time), (track.velocity_seen, track.turn_seen)
        for number, time, way, velocity, turn in zip(numbers, track.time, ways, *seen, strict=True):
            if self._last is None:
                self._first, self._last = float(time), (number - 1, time)
            before, since = self._last
            lost = number - before > 1 and time - since >= SHORTEST
            if not velocity or not turn or lost:
                flags = not velocity, not turn, lost
                causes = (cause for cause, is_so in zip(CAUSES, flags, strict=True) if is_so)
                self._spans.add(float(since), float(time), float(way), causes)
            self._last = int(number), float(time)

    def lost(self, start: float, stop: float) -> None:
        """Add missing frames from `start` to `stop` (s), at either end of the stream."""
        if stop - start >= SHORTEST:
            self._spans.add(start, stop, 0.0, ("frames lost",))

    @property
    def found(self) -> UnobservableSpans:
        """All spans so far, in order of time."""
        spans = self._spans.found
        way = sum(span.way_m for span in spans)
        return UnobservableSpans(share_of_way=way / self.way if self.way > 0 else 0.0, way_m=way, spans=spans)

    def warnings(self) -> list[str]:
        """Return one sentence with times since the first frame, or none without spans."""
        found = self.found
        if not found.spans:
            return []
        longest, seconds = max(found.spans, key=lambda span: span.duration), sum(span.duration for span in found.spans)
        where, at = ("", "") if len(found.spans) == 1 else (f"in {len(found.spans)} spans, ", "in the longest ")
        return [
            f"heading or velocity was unobservable {where}for {seconds:.1f} s and "
            f"{100 * found.share_of_way:.0f} % of the path, {at}"
            f"from {longest.start_s - self._first:.1f} to {longest.stop_s - self._first:.1f} s ({longest.why}); "
            "poses there are predictions"
        ]
