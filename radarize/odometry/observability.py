"""Where odometry was blind: no velocity, no match that tells the turn, or no frames at all.

It goes on there by what it knew before, and nothing of the poses says so. A span runs from the last frame that could be
trusted to the last that could not. Spans that sight parts for less than `SHORTEST` are one; one that is shorter than that
in the end is a blink, which the filters are made for, and is left out.
"""

from collections.abc import Iterable
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, PlainSerializer

from radarize.odometry.integration import Track
from radarize.radar.numbering import Numbering

#: s
SHORTEST = 0.3
#: Why, in the order in which they are named.
CAUSES = ("no velocity", "no turn", "frames lost")


Finite = Annotated[float, Field(allow_inf_nan=False), PlainSerializer(lambda value: round(value, 4))]
Amount = Annotated[Finite, Field(ge=0)]


class Span(BaseModel):
    """From when to when odometry was blind, s; the way meanwhile as it guessed it, m; why."""

    start_s: Finite
    stop_s: Finite
    way_m: Amount
    why: str

    @property
    def lasts(self) -> float:
        """s."""
        return self.stop_s - self.start_s


class UnobservableSpans(BaseModel):
    """All spans, with their way, m, and its share of the whole way."""

    share_of_way: Amount
    way_m: Amount
    spans: list[Span]


class Spans:
    """Joins frames of which something is true to spans; memory grows with their number alone."""

    def __init__(self):
        self._spans: list[Span] = []

    def add(self, start: float, stop: float, way: float, causes: Iterable[str]) -> None:
        """Join the next stretch (s, m), some of `CAUSES` or another one being its cause, with the last, or begin a new
        one."""
        causes = {*causes}
        span = self._spans.pop() if self._spans else None
        if span and 0 <= start - span.stop_s < SHORTEST:
            start, way, causes = span.start_s, span.way_m + way, causes | {*span.why.split(" and ")}
        elif span and span.lasts >= SHORTEST:
            self._spans.append(span)
        why = " and ".join(sorted(causes, key=lambda cause: (*CAUSES, cause).index(cause)))
        self._spans.append(Span(start_s=start, stop_s=stop, way_m=way, why=why))

    @property
    def found(self) -> list[Span]:
        """All so far that are no blinks, in order of time."""
        return sorted((span for span in self._spans if span.lasts >= SHORTEST), key=lambda span: span.start_s)


class Observability:
    """Finds the spans of a stream; memory grows with their number alone.

    Args:
        period: between frames that odometry uses, s.

    Attributes:
        way: m, of odometry so far.
    """

    def __init__(self, period: float):
        self.way = 0.0
        self._numbering = Numbering(period)
        self._spans = Spans()
        self._first = 0.0
        self._last: tuple[int, float] | None = None  # number and time of the frame before

    def add(self, track: Track) -> None:
        """Take in the next frames."""
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
        """Say that there are no frames from `start` to `stop` (s), at either end of the stream."""
        if stop - start >= SHORTEST:
            self._spans.add(start, stop, 0.0, ("frames lost",))

    @property
    def found(self) -> UnobservableSpans:
        """All so far, in order of time."""
        spans = self._spans.found
        way = sum(span.way_m for span in spans)
        return UnobservableSpans(share_of_way=way / self.way if self.way > 0 else 0.0, way_m=way, spans=spans)

    def warnings(self) -> list[str]:
        """One sentence with times since the first frame, or none if there is nothing to say."""
        found = self.found
        if not found.spans:
            return []
        longest, seconds = max(found.spans, key=lambda span: span.lasts), sum(span.lasts for span in found.spans)
        often, at = ("once", "") if len(found.spans) == 1 else (f"{len(found.spans)} times", "at the longest ")
        return [
            f"odometry was blind {often}, for {seconds:.1f} s and {100 * found.share_of_way:.0f} % of the way; {at}"
            f"from {longest.start_s - self._first:.1f} to {longest.stop_s - self._first:.1f} s ({longest.why}); "
            "poses there are guessed"
        ]
