"""Ring buffer of frames between two processes in shared memory, of fixed size and without copies."""

from multiprocessing import get_context

import numpy as np

from radarize.radar.config import RadarConfig

#: Processes are spawned: a fork would copy locks of the threads.
CONTEXT = get_context("spawn")
#: `number` of the slot that marks the end.
_END = -1


class FrameRing:
    """Bounded queue of frames from one writer to one reader. The writer never waits: a frame without a free slot
    is dropped.

    Args:
        slots: number of frames that may wait.

    Attributes:
        dtype: fields of a frame: ``number`` (from 0, lost and dropped frames counted), ``time`` (s), ``valid`` (loop,
            tx) and ``adc`` (loop, tx, rx, sample, iq).
    """

    def __init__(self, config: RadarConfig, slots: int):
        self.dtype = np.dtype(
            [
                ("number", "i8"),
                ("time", "f8"),
                ("valid", "?", config.frame_shape[:2]),
                ("adc", "i2", config.frame_shape),
            ]
        )
        self.slots = slots
        self._memory = CONTEXT.RawArray("b", slots * self.dtype.itemsize)
        self._free, self._filled = CONTEXT.Semaphore(slots), CONTEXT.Semaphore(0)
        self._written = self._taken = 0  # each counted by one of the two processes, in its own copy

    def put(self, number: int, time: float, adc: np.ndarray, valid: np.ndarray) -> bool:
        """Add a frame; return False if there was no free slot."""
        if not self._free.acquire(block=False):
            return False
        self._write(number, time, adc, valid)
        return True

    def end(self, patience: float) -> bool:
        """Mark the end of the stream; return False if no slot became free for `patience` seconds."""
        if not self._free.acquire(timeout=patience):
            return False
        self._write(_END, np.inf, 0, False)
        return True

    def _write(self, number: int, time: float, adc: np.ndarray | int, valid: np.ndarray | bool) -> None:
        slot = self._slots[self._written % self.slots]
        slot["number"], slot["time"], slot["valid"], slot["adc"] = number, time, valid, adc
        self._written += 1
        self._filled.release()

    def get(self, most: int, patience: float) -> np.ndarray | None:
        """Return the waiting frames, oldest first.

        Args:
            most: maximum number of frames.
            patience: s, timeout of the first frame.

        Returns:
            (frame,) of `dtype`, empty if none arrived; None after the last one.
        """
        found, count = np.empty(most, self.dtype), 0
        while count < most and self._filled.acquire(timeout=0 if count else patience):
            slot = self._slots[self._taken % self.slots]
            if slot["number"] == _END:
                self._filled.release()  # later calls get the end as well
                if not count:
                    return None
                break
            found[count] = slot
            count += 1
            self._taken += 1
            self._free.release()
        return found[:count]

    @property
    def _slots(self) -> np.ndarray:
        return np.frombuffer(self._memory, self.dtype)
