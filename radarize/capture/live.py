"""Live pipeline on a stream, with a page that shows it."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from threading import Event
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import Float

from radarize.capture.firstlook import FirstLook
from radarize.capture.page import LivePage, Unwatched
from radarize.capture.record import Keeper
from radarize.capture.stream import FrameStream, follow
from radarize.capture.view import LiveView
from radarize.io.recording import Losses
from radarize.io.stopwatch import stage
from radarize.pipeline.health import Health
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import make_pipeline
from radarize.pipeline.pipeline import Result
from radarize.pipeline.runfolder import OccupancyMap
from radarize.signal.batch import Preprocessor
from radarize.signal.bearings import BEARINGS
from radarize.slam.node import Node
from radarize.slam.rendering import MapRenderer
from radarize.slam.warmup import warm_up

if TYPE_CHECKING:
    from radarize.evaluation.foxglove import Server

#: Largest number of frames per batch. Libraries cache buffers for every batch size, the more the larger it is: up to
#: this size `prepare` creates all of them, and memory then grows with the map alone.
TOGETHER = 4
#: s between pictures of a frame, and of the map; largest fraction of the time spent on drawing the map, and pause after
#: every node, s, which itself takes half a millisecond.
_FRAME_INTERVAL, _MAP_INTERVAL, _MAP_SHARE, _PAUSE = 0.2, 1.0, 0.25, 2e-3


class Live:
    """Live pipeline on a stream.

    Args:
        inputs: inputs of its methods; see `prepare`.
        methods: odometry and scans by name.
        page: page that shows it.
        foxglove: Foxglove server that shows it, too.

    Attributes:
        losses: lost frames and chirps.
        health: health of the pipeline.
        first_look: check of the first seconds.
        busy: processing time of the frames so far, including display, s.
    """

    def __init__(
        self, inputs: Inputs, methods: dict[str, str], page: LivePage | Unwatched, foxglove: "Server | None" = None
    ):
        self.pipeline, self.page, self.foxglove = make_pipeline(inputs, **methods, endless=True), page, foxglove
        self.preprocessor = Preprocessor(inputs.signal, inputs.every)
        self.view = LiveView(self.pipeline, inputs.signal)
        self.losses, self.health = Losses(inputs.delivered.frame_period), Health(inputs.radar)
        self.first_look = FirstLook(inputs.delivered)
        self._keeper: Keeper | None = None
        self.busy = 0.0
        self._frame_due = self._map_due = self._stamp = 0.0
        self._drawing = MapRenderer(inputs.configuration.slam.grid, _PAUSE)
        self._painter = ThreadPoolExecutor(1, thread_name_prefix="map")
        self._drawn: Future[None] = Future()
        self._drawn.set_result(None)

    def follow(
        self,
        stream: FrameStream,
        stopping: Event,
        *,
        frames: int | None = None,
        keeper: Keeper | None = None,
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> Iterator[tuple[np.ndarray, Result]]:
        """Process the stream until the user stops it, the number of frames is reached, or it ends; then finish the map.

        Args:
            stream: open stream; stopped here.
            stopping: event that ends the processing.
            frames: end after this number of frames.
            keeper: recorder of the frames.
            progress: called with frames done and total (0: until stopped).

        Yields:
            Frames received together (`FrameRing.dtype`), and the pipeline's result, if it used any.

        Raises:
            InputError: see `radarize.capture.stream.follow`.
        """
        self._keeper = keeper
        self.page.send("facts", self.view.facts())
        for came in follow(stream, stopping, most=TOGETHER, frames=frames):
            start, result = time.monotonic(), None
            adc, stamps, valid = came["adc"], came["time"], came["valid"]
            if batch := self.preprocessor.process(adc, stamps, valid):
                result = self.pipeline.push(batch)
                self.health.add(result)
                self.view.add(result)
            self.losses.add(valid, stamps)
            self.first_look.add(adc, stamps, valid)
            if keeper:
                keeper.append(adc, stamps, valid)
            with self.pipeline.stopwatch.running(), stage("page"):
                self._show(stream, adc[-1:], valid[-1:], float(stamps[-1]))
            self.busy += time.monotonic() - start
            progress(int(came["number"][-1]) + 1, frames or 0)
            if result is not None:
                yield came, result
        self.pipeline.finish()
        self.first_look.finish()
        self._show_map()
        self._drawn.result()
        self._painter.shutdown()
        self.page.send("end", {"troubles": self.troubles(stream)})

    def troubles(self, stream: FrameStream) -> list[str]:
        """Warnings on the stream, its recording, and intervals of poor odometry, so far."""
        left_out = self._keeper.warnings() if self._keeper else []
        return [*stream.troubles(), *left_out, *self.first_look.warnings(), *self.health.warnings()]

    def _show(self, stream: FrameStream, adc: np.ndarray, valid: np.ndarray, stamp: float) -> None:
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
        if self.foxglove and (result := self.view.newest) and (pose := self.view.pose()) is not None:
            self.foxglove.pose(stamp, pose, result.track.pose[-1])
            self.foxglove.scan(stamp, result.ranges[-1])
            for name, pixels in pictures.items():
                self.foxglove.picture(stamp, name, pixels)
        if now >= self._map_due and self.pipeline.slam.nodes and self._drawn.done():
            self._show_map()

    def _show_map(self) -> None:
        """Draw and send the current map in a thread, without delaying frames."""
        slam = self.pipeline.slam
        self._drawn.result()
        now = list(slam.nodes), slam.graph.poses.copy(), int(slam.graph.accepted.sum()), self._stamp
        self._drawn = self._painter.submit(self._paint, *now)

    def _paint(self, nodes: list[Node], poses: Float[np.ndarray, "node 3"], loops: int, stamp: float) -> None:
        start = time.monotonic()
        grid = self._drawing.render(nodes, poses)
        self.page.send("map", self.view.map(grid, poses, loops))
        if self.foxglove:
            self.foxglove.map(stamp, OccupancyMap.of(grid))
            self.foxglove.path(stamp, poses)
        end = time.monotonic()
        self._map_due = end + max(_MAP_INTERVAL, (end - start) / _MAP_SHARE)


def prepare(inputs: Inputs, methods: dict[str, str]) -> Inputs:
    """Warm up a pipeline so that it is fast from its first frame on: a copy processes noise, and SLAM, which noise does
    not move, a synthetic room, so that everything is compiled and loaded."""
    torch.set_num_threads(1)  # a frame is too small to parallelise: synchronisation costs more
    pipeline = make_pipeline(inputs, methods["odometry"], methods["scans"])
    preprocessor, radar = Preprocessor(inputs.signal), inputs.radar
    view, rng = LiveView(pipeline, inputs.signal), np.random.default_rng(0)
    for frames in range(1, TOGETHER + 1):
        adc = rng.integers(-200, 200, (frames, *radar.frame_shape), dtype=np.int16)
        stamps = (preprocessor.taken + np.arange(frames)) * radar.frame_period
        view.add(pipeline.push(preprocessor.process(adc, stamps)))
    view.frame(view.pictures(adc[-1:], np.ones((1, *adc.shape[1:3]), bool)), 0.0)
    warm_up(pipeline.slam.config, BEARINGS)
    return inputs
