"""Where odometry was blind: no velocity, no match that tells the turn, or no frames at all.

It goes on there by what it knew before, and nothing of the poses says so. A span runs from the last frame that could be
trusted to the last that could not. Spans that sight parts for less than `BLINK` are one; one that is shorter than that
in the end is a blink, which the filters are made for, and is left out.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from radarize.odometry.integration import Track

#: s
BLINK = 0.3
_CAUSES = ("no velocity", "no turn", "frames lost")


@dataclass
class Span:
    """When odometry was blind.

    Attributes:
        start, stop: s, on the frames' clock.
        way: m, as odometry guessed it.
        causes: of `_CAUSES`.
    """

    start: float
    stop: float
    way: float
    causes: set[str]

    @property
    def why(self) -> str:
        """Its causes in words."""
        return " and ".join(cause for cause in _CAUSES if cause in self.causes)


class Blindness:
    """Finds the spans of a stream; memory grows with their number alone.

    Attributes:
        way: m, of odometry so far.
    """

    def __init__(self):
        self.way = 0.0
        self._spans: list[Span] = []
        self._first = 0.0
        self._last: tuple[int, float] | None = None  # number and time of the frame before

    def add(self, frames: Int[np.ndarray, "frame"], track: Track) -> None:
        """Take in the next frames, by their numbers in the recording."""
        ways = np.hypot(track.step[:, 0], track.step[:, 1])
        self.way += float(ways.sum())
        seen = track.velocity_seen, track.turn_seen
        for number, time, way, velocity, turn in zip(frames, track.time, ways, *seen, strict=True):
            if self._last is None:
                self._first, self._last = float(time), (number - 1, time)
            before, since = self._last
            # Frames that are left out on purpose come at a pace.
            lost = number - before > 1 and time - since >= BLINK
            flags = zip(_CAUSES, (not velocity, not turn, lost), strict=True)
            if causes := {cause for cause, is_so in flags if is_so}:
                self._extend(Span(float(since), float(time), float(way), causes))
            self._last = int(number), float(time)

    def lost(self, start: float, stop: float) -> None:
        """Say that there are no frames from `start` to `stop` (s), at either end of the stream."""
        if stop - start >= BLINK:
            self._extend(Span(start, stop, 0.0, {"frames lost"}))
            self._spans.sort(key=lambda span: span.start)

    def _extend(self, more: Span) -> None:
        span = self._spans[-1] if self._spans else None
        if span and 0 <= more.start - span.stop < BLINK:
            span.stop, span.way = more.stop, span.way + more.way
            span.causes |= more.causes
            return
        if span and span.stop - span.start < BLINK:
            self._spans.pop()
        self._spans.append(more)

    @property
    def spans(self) -> list[Span]:
        """All so far, in order of time."""
        return [span for span in self._spans if span.stop - span.start >= BLINK]

    def summary(self) -> dict[str, object]:
        """For ``run.json``: share of the way that is guessed, that way in m, and the spans."""
        way = sum(span.way for span in self.spans)
        return {
            "share_of_way": round(way / self.way, 4) if self.way > 0 else 0.0,
            "way_m": round(way, 3),
            "spans": [
                {
                    "start_s": round(span.start, 3),
                    "stop_s": round(span.stop, 3),
                    "way_m": round(span.way, 3),
                    "why": span.why,
                }
                for span in self.spans
            ],
        }

    @property
    def warning(self) -> str | None:
        """One sentence with times since the first frame; None if there is nothing to say."""
        spans = self.spans
        if not spans:
            return None
        longest = max(spans, key=lambda span: span.stop - span.start)
        seconds = sum(span.stop - span.start for span in spans)
        share = sum(span.way for span in spans) / self.way if self.way > 0 else 0.0
        times = "once" if len(spans) == 1 else f"{len(spans)} times"
        return (
            f"odometry was blind {times}, for {seconds:.1f} s and {100 * share:.0f} % of the way; "
            f"{'' if len(spans) == 1 else 'at the longest '}from {longest.start - self._first:.1f} to "
            f"{longest.stop - self._first:.1f} s ({longest.why}); poses there are guessed"
        )
