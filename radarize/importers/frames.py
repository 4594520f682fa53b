"""Raw frames of a ROS bag: when they begin, and what was wrong with them.

They are stamped as their headers say. The Radarize data set's publisher leaves that unset: then with the time of
receipt less a latency, by default the burst's length, since no frame is received before its last chirp. That is the
least; a recorder that waits for a frame's last packet, which the DCA1000 fills with the next frame's beginning, has a
frame period.
"""

import numpy as np

from radarize.importers.companions import SAME_CLOCK, header_time
from radarize.radar.config import RadarConfig


class Stamps:
    """When frames begin: from their headers, or from their receipt.

    Args:
        first: the first frame.
        received: when that was, s.
        latency: given by the user, s.

    Attributes:
        latency: from a frame's start to its receipt, s; None where headers say.
        assumed: what nobody said.
    """

    def __init__(self, config: RadarConfig, first: object, received: float, latency: float | None):
        from_headers = latency is None and abs(header_time(first) - received) < SAME_CLOCK
        self.assumed = ("latency",) if latency is None and not from_headers else ()
        self.latency = None if from_headers else config.burst_time if latency is None else latency

    def __call__(self, message: object, received: float) -> float:
        """Of a frame, s."""
        return header_time(message) if self.latency is None else received - self.latency

    def __str__(self) -> str:
        return "headers" if self.latency is None else f"receipt, less a latency of {1e3 * self.latency:.2f} ms"


class Frames:
    """Raw frames that wait for what comes along with them, and what was wrong with others."""

    def __init__(self, config: RadarConfig):
        self.config, self.words = config, config.frame_bytes // 2
        self.times: list[float] = []
        self.raw: list[np.ndarray] = []
        self.last = -np.inf
        self._odd = self._again = 0

    def add(self, time: float, message: object) -> None:
        """Keep a frame, unless it has another size or does not come after the last one."""
        words = np.asarray(message.data)
        if words.dtype.itemsize == 1:
            words = words[: words.size // 2 * 2].view("<i2")
        if words.size != self.words:
            self._odd += 1
        elif time <= self.last:
            self._again += 1
        else:
            self.last = time
            self.times.append(time)
            self.raw.append(words.astype(np.int16, copy=False))

    def take(self, count: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Stamps and words of the first frames, and the stamp of the frame after them, s."""
        times, raw = np.array(self.times[:count]), np.concatenate(self.raw[:count])
        del self.times[:count], self.raw[:count]
        return times, raw, self.times[0] if self.times else self.last + self.config.frame_period

    @property
    def warnings(self) -> list[str]:
        """What was wrong."""
        counted = (
            (self._odd, f"frames have not the {self.words} words of the configuration and are left out"),
            (self._again, "frames came again or out of order and are left out"),
        )
        return [f"{count} {what}" for count, what in counted if count]
