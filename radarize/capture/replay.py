"""A recording played as it was captured: each frame when its burst has ended."""

import time
from pathlib import Path

from radarize.capture.stream import GLANCE, Outlet
from radarize.radar.dca1000 import PacketCounts
from radarize.recording import Recording


def replay(outlet: Outlet, path: Path, speed: float = 1.0) -> None:
    """A `Source`: the frames of a recording at its own pace, or `speed` times as fast."""
    packets = PacketCounts()
    with Recording(path) as recording:
        outlet.ready()
        start = time.monotonic() - recording.times[0] / speed if len(recording) else 0.0
        for number, stamp in enumerate(recording.times):
            adc, valid = recording.adc(number, number + 1)[0], recording.valid(number, number + 1)[0]
            due = start + (stamp + recording.config.burst_time) / speed
            while (left := due - time.monotonic()) > 0 and not outlet.stopped:
                time.sleep(min(left, GLANCE))
            if outlet.stopped:
                return
            outlet.put(float(stamp), adc, valid)
            outlet.publish(packets)
