"""Replay of a recording in real time: each frame at the end of its burst."""

import time
from pathlib import Path

from radarize.capture.stream import GLANCE, FrameStream, Outlet
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.assembler import PacketCounts


class Replay(FrameStream):
    """Stream of a recording's frames.

    Args:
        path: path of the recording.
        speed: playback speed relative to real time.
        slots: number of frames that may wait.

    Raises:
        InputError: not a recording, or one without frames or samples.
    """

    def __init__(self, path: Path, speed: float = 1.0, slots: int = 64):
        with Recording(path) as recording:
            if not len(recording):
                raise InputError(f"{path}: has no whole frame, expected at least one to play")
            recording.adc(0, 1)  # refuses recordings of heat maps
            self.text = str(recording.file["radar"].attrs.get("cfg", ""))
            super().__init__(recording.config, replay, path, speed, slots=slots)
        self.path = path

    @property
    def facts(self) -> dict[str, object]:
        """Attributes on the origin, for a recording."""
        return {"source": self.path.name}


def replay(outlet: Outlet, path: Path, speed: float) -> None:
    """A `Source`: the frames of a recording in real time, or `speed` times as fast."""
    packets = PacketCounts()
    with Recording(path) as recording:
        outlet.ready()
        start = time.monotonic() - recording.times[0] / speed
        for number, stamp in enumerate(recording.times):
            adc, valid = recording.adc(number, number + 1)[0], recording.valid(number, number + 1)[0]
            due = start + (stamp + recording.config.burst_time) / speed
            while (left := due - time.monotonic()) > 0 and not outlet.stopped:
                time.sleep(min(left, GLANCE))
            if outlet.stopped:
                return
            outlet.put(float(stamp), adc, valid)
            outlet.publish(packets)
