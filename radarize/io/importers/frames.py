"""Raw frames of a ROS bag: their start times, and damaged ones.

Frames are stamped from their headers. The publisher of the Radarize data set leaves the header stamp unset: then the
stamp is the time of receipt minus a latency, by default the duration of the burst, since no frame is received before
its last chirp. This is the minimum; a recorder that waits for the last packet of a frame, which the DCA1000 fills with
the beginning of the next frame, has a latency of one frame period.

Times of receipt are delayed by the load of the computer, while the radar's timer is periodic. They are therefore
projected to a line below them.
"""

from collections import deque

import numpy as np
from jaxtyping import Float
from scipy.ndimage import minimum_filter1d
from scipy.stats import theilslopes

from radarize.io.importers.companions import SAME_CLOCK, header_time
from radarize.io.importers.rosbag import Message
from radarize.radar.config import RadarConfig

#: s by which a computer may delay frames; number of parts of a recording whose least delayed frames determine the line;
#: relative deviation of receipts from the configured frame period.
_HELD_UP, _PARTS, _AGREE = 2.0, 32, 0.01
#: Frame periods by which a header may be ahead of all earlier ones, relative to receipt; number of earlier ones used.
_EARLY, _BEFORE = 1.5, 64


class Stamps:
    """Start times of frames, from their headers or from their receipt.

    Args:
        first: the first frame.
        received: times of receipt of all frames, s.
        latency: latency from the user, s.

    Attributes:
        latency: time from a frame's start to its receipt, s; None if headers are used.
        assumed: names of assumed settings.
        distrusted: number of headers so far that are ahead of their receipt.
    """

    def __init__(self, config: RadarConfig, first: object, received: Float[np.ndarray, "frame"], latency: float | None):
        from_headers = latency is None and abs(header_time(first) - received[0]) < SAME_CLOCK
        self.assumed = ("latency",) if latency is None and not from_headers else ()
        self.latency = None if from_headers else config.burst_time if latency is None else latency
        self.distrusted, self._period, self._last = 0, config.frame_period, -np.inf
        self._ahead: deque[float] = deque(maxlen=_BEFORE)  # s, headers minus receipt
        self._received = np.unique(received)
        self._periodic = self._received if from_headers else periodic(self._received, config.frame_period)

    def __call__(self, message: Message, received: float) -> float:
        """Return the start time of a frame, s."""
        if self.latency is None:
            self._last = self._trusted(header_time(message), received)
            return self._last
        return float(self._periodic[np.searchsorted(self._received, received)]) - self.latency

    def _trusted(self, header: float, received: float) -> float:
        """Return the header's stamp, or one by frame period if it is too early: no frame is received before its
        start."""
        ahead = header - received
        if self._ahead and ahead > max(self._ahead) + _EARLY * self._period:
            self.distrusted += 1
            since = received + float(np.median(self._ahead)) - self._last
            return self._last + self._period * max(1, round(since / self._period))
        self._ahead.append(ahead)
        return header

    @property
    def warnings(self) -> list[str]:
        """A sentence on implausible headers, if there are any."""
        what = "frames have a header ahead of their receipt and are stamped by the frame period instead"
        return [f"{self.distrusted} {what}"] if self.distrusted else []

    def __str__(self) -> str:
        if self.latency is None:
            return "headers"
        moved = 1e3 * np.abs(self._received - self._periodic)
        return (
            f"receipt, moved to the period of the radar's timer by {np.median(moved):.2f} ms in the median and "
            f"{moved.max():.2f} ms at most, less a latency of {1e3 * self.latency:.2f} ms"
        )


def periodic(received: Float[np.ndarray, "frame"], period: float) -> Float[np.ndarray, "frame"]:
    """Return receipts (s, ascending) projected to the line through the least delayed ones, an integer number of frame
    periods apart; unchanged if half of them are farther than half a period from any line.

    A delayed frame is received together with the frames after it, which limit its delay. The slope of the line is the
    period on the bag's clock; the configured `period` determines which frames are missing, unless receipts contradict
    it.
    """
    if len(received) < 3:
        return received
    since, count = received - received[0], np.arange(len(received))
    between = float(np.median(np.diff(since)))
    step = period if abs(between / period - 1) < _AGREE else between
    window = 1 + min(round(_HELD_UP / step), len(since))
    punctual = minimum_filter1d(since - count * step, window, mode="nearest", origin=-(window // 2)) + count * step
    numbers, least_late = count - len(count), 0.0
    for k, at in enumerate(punctual):
        numbers[k] = max(numbers[k - 1] + 1, round((at - least_late) / step))
        least_late = min(least_late + _AGREE * step, at - numbers[k] * step)
    late = since - numbers * np.polyfit(numbers, punctual, 1)[0]
    least = [part[late[part].argmin()] for part in np.array_split(count, min(_PARTS, len(count)))]
    slope, start, *_ = theilslopes(since[least], numbers[least])  # robust to wrongly numbered frames
    line = start + slope * numbers
    return received[0] + line if np.median(np.abs(line - since)) < step / 2 else received


class BagFrames:
    """Raw frames that wait for messages of other topics, and counts of unusable ones."""

    def __init__(self, config: RadarConfig):
        self.config, self.words = config, config.frame_bytes // 2
        self.times: list[float] = []
        self.raw: list[np.ndarray] = []
        self.last = -np.inf
        self._odd = self._again = 0

    def add(self, time: float, message: Message) -> None:
        """Store a frame, unless its size is wrong or it does not follow the last one."""
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
        """Return and remove the first frames: stamps, words, and the stamp of the frame after them, s."""
        times, raw = np.array(self.times[:count]), np.concatenate(self.raw[:count])
        del self.times[:count], self.raw[:count]
        return times, raw, self.times[0] if self.times else self.last + self.config.frame_period

    @property
    def warnings(self) -> list[str]:
        """Sentences on frames that are left out."""
        counted = (
            (self._odd, f"frames do not have the {self.words} words of the configuration and are left out"),
            (self._again, "frames are repeated or out of order and are left out"),
        )
        return [f"{count} {what}" for count, what in counted if count]
