"""The pipeline on a stream, with a page that shows it."""

import time
from collections.abc import Callable
from threading import Event
from typing import TYPE_CHECKING

import numpy as np
import torch

from radarize.batch import Intake
from radarize.capture.page import Page
from radarize.capture.record import Keeper
from radarize.capture.stream import Stream, follow
from radarize.capture.view import View
from radarize.health import Health
from radarize.mapping.scans import BEARINGS
from radarize.methods.registry import Inputs, Workshop
from radarize.recording import Losses
from radarize.runfolder import OccupancyMap
from radarize.slam.rehearsal import rehearse
from radarize.stopwatch import stage

if TYPE_CHECKING:
    from radarize.foxglove import Server

#: Frames at a time, at most. Libraries keep what they have made for every number of frames, the more the larger it is:
#: up to so many all of it is there after `prepare`, and memory then grows with the map alone.
TOGETHER = 4
#: s between pictures of a frame, and of the map; redrawing the map takes at most this share of the time.
_FRAME_INTERVAL, _MAP_INTERVAL, _MAP_SHARE = 0.2, 1.0, 0.05


class Live:
    """A pipeline that follows a stream.

    Args:
        inputs: what its methods are made from; see `prepare`.
        methods: odometry and scans by name.
        page: shows it.
        foxglove: shows it, too.

    Attributes:
        losses: of the frames that came.
        health: of the pipeline.
        busy: s spent on the frames so far, showing them included.
    """

    def __init__(self, inputs: Inputs, methods: dict[str, str], page: Page, foxglove: "Server | None" = None):
        self.pipeline, self.page, self.foxglove = Workshop(inputs).pipeline(**methods, endless=True), page, foxglove
        self.intake = Intake(inputs.signal, inputs.every)
        self.view = View(self.pipeline, inputs.signal)
        self.losses, self.health = Losses(inputs.delivered.frame_period), Health(inputs.radar)
        self._keeper: Keeper | None = None
        self.busy = 0.0
        self._frame_due = self._map_due = self._stamp = 0.0

    def run(
        self,
        stream: Stream,
        stopping: Event,
        *,
        frames: int | None = None,
        keeper: Keeper | None = None,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> None:
        """Follow the stream until the user stops it, there are enough frames, or it ends; then finish the map.

        Args:
            stream: an open one; stopped here.
            stopping: set when the user wants to end.
            frames: end after so many.
            keeper: records the frames as well.
            progress: called with frames done and wanted (0: until stopped).

        Raises:
            InputError: see `follow`.
        """
        self._keeper = keeper
        self.page.send("facts", self.view.facts())
        for came in follow(stream, stopping, most=TOGETHER, frames=frames):
            start = time.monotonic()
            adc, stamps, valid = came["adc"], came["time"], came["valid"]
            if batch := self.intake.take(adc, stamps, valid):
                result = self.pipeline.push(batch)
                self.health.add(result)
                self.view.add(result)
            self.losses.add(valid, stamps)
            if keeper:
                keeper.append(adc, stamps, valid)
            with self.pipeline.stopwatch.running(), stage("page"):
                self._show(stream, adc[-1:], valid[-1:], float(stamps[-1]))
            self.busy += time.monotonic() - start
            progress(int(came["number"][-1]) + 1, frames or 0)
        self.pipeline.finish()
        self._show_map()
        self.page.send("end", {"troubles": self.troubles(stream)})

    def troubles(self, stream: Stream) -> list[str]:
        """What is wrong with the stream and its recording so far, and where odometry had a hard time."""
        left_out = self._keeper.warnings() if self._keeper else []
        return [*stream.troubles(), *left_out, *self.health.warnings()]

    def _show(self, stream: Stream, adc: np.ndarray, valid: np.ndarray, stamp: float) -> None:
        now = time.monotonic()
        if now < self._frame_due or not (self.page.watched or self.foxglove):
            return
        self._frame_due, self._stamp = now + _FRAME_INTERVAL, stamp
        counts = stream.counts
        figures = {
            "frames": counts.frames,
            "dropped": counts.dropped,
            "lost_chirps": self.losses.lost_chirps,
            "lost_share": self.losses.lost_chirps / max(self.losses.chirps, 1),
            "waiting": max(counts.frames - counts.dropped - self.losses.frames, 0),
            "slots": stream.ring.slots,
            "troubles": self.troubles(stream),
        }
        pictures = self.view.pictures(adc, valid)
        self.page.send("frame", self.view.frame(pictures, stamp) | figures)
        if self.foxglove and (result := self.view.newest):
            self.foxglove.pose(stamp, self.view.pose(), result.track.pose[-1])
            self.foxglove.scan(stamp, result.ranges[-1])
            for name, pixels in pictures.items():
                self.foxglove.picture(stamp, name, pixels)
        drawn = time.monotonic()
        if now >= self._map_due and self.pipeline.slam.nodes:
            self._show_map()
            self._map_due = now + max(_MAP_INTERVAL, (time.monotonic() - drawn) / _MAP_SHARE)

    def _show_map(self) -> None:
        slam = self.pipeline.slam
        grid = slam.map()
        self.page.send("map", self.view.map(grid))
        if self.foxglove:
            self.foxglove.map(self._stamp, OccupancyMap.of(grid))
            self.foxglove.path(self._stamp, slam.graph.poses)


def prepare(inputs: Inputs, methods: dict[str, str]) -> Inputs:
    """Make a pipeline fast from its first frame on: another one runs on noise before, and SLAM, which noise does not
    move, through a room of its own, so that whatever is compiled or loaded at first use is there."""
    torch.set_num_threads(1)  # a frame is too little to share out: threads that wait for each other cost more
    pipeline, intake, radar = Workshop(inputs).pipeline(**methods), Intake(inputs.signal), inputs.radar
    view, rng = View(pipeline, inputs.signal), np.random.default_rng(0)
    for frames in range(1, TOGETHER + 1):
        adc = rng.integers(-200, 200, (frames, *radar.frame_shape), dtype=np.int16)
        stamps = (intake.taken + np.arange(frames)) * radar.frame_period
        view.add(pipeline.push(intake.take(adc, stamps)))
    view.frame(view.pictures(adc[-1:], np.ones((1, *adc.shape[1:3]), bool)), 0.0)
    rehearse(pipeline.slam.config, BEARINGS)
    return inputs
