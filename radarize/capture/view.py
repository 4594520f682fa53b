"""Live view of a pipeline: heat maps of the newest frame, map and path so far, and processing load."""

import base64
import io
import time
from collections import deque

import matplotlib
import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from radarize.evaluation.report.drawings import DEPTH, LEAKAGE, decibels
from radarize.io.pose import between, compose
from radarize.pipeline.pipeline import Pipeline, Result
from radarize.signal.batch import Signal
from radarize.signal.heatmaps import Heatmaps
from radarize.slam.grid import OccupancyGrid

#: Width of the fan in pixels, and averaging time of figures, s.
_FAN, _SPAN = 260, 2.0
_COLORS = (255 * matplotlib.colormaps["magma"](np.linspace(0, 1, 256))).astype(np.uint8)


class Fan:
    """Range-azimuth maps in plan view: forward is up, left is left."""

    def __init__(self, heatmaps: Heatmaps):
        reach, edge = heatmaps.ranges[-1], abs(heatmaps.azimuths).max()
        half = reach * np.sin(min(edge, np.pi / 2))
        rows = round(_FAN * reach / (2 * half))
        right, ahead = np.meshgrid(np.linspace(-half, half, _FAN), np.linspace(reach, 0, rows))
        self.width, self.reach = 2 * half, reach
        distance, azimuth = np.hypot(right, ahead), np.arctan2(-right, ahead)
        self._bin = np.clip(np.searchsorted(heatmaps.ranges, distance), 0, len(heatmaps.ranges) - 1)
        self._column = np.clip(np.searchsorted(heatmaps.azimuths, azimuth), 0, len(heatmaps.azimuths) - 1)
        self._inside = (distance <= reach) & (abs(azimuth) <= edge)
        self._near = heatmaps.ranges < LEAKAGE

    def draw(self, power: Float[np.ndarray, "range azimuth"]) -> UInt8[np.ndarray, "row column 4"]:
        """Colours, transparent outside of the field of view."""
        picture = colored(power, power[~self._near].max(initial=0.0))[self._bin, self._column]
        picture[~self._inside] = 0
        return picture


def colored(
    power: Float[np.ndarray, "row column"], reference: float | None = None
) -> UInt8[np.ndarray, "row column 4"]:
    """Power in dB below the reference (by default its largest value) as colours."""
    level = np.clip(1 + decibels(power, reference) / DEPTH, 0, 1) if power.any() else np.zeros(power.shape)
    return _COLORS[(255 * level).astype(np.uint8)]


def png(pixels: UInt8[np.ndarray, "row column ..."]) -> str:
    """A picture as a data URL."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "png", compress_level=1)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


class LiveView:
    """Pictures and figures of a pipeline, as plain data for a page.

    Attributes:
        newest: result of the last batch with frames.
    """

    def __init__(self, pipeline: Pipeline, signal: Signal):
        self._pipeline, self._heatmaps = pipeline, signal.heatmaps
        self.newest: Result | None = None
        self._frames = 0
        self._fan = Fan(self._heatmaps)
        self._history: deque[tuple[float, int, dict[str, float]]] = deque()  # clock, frames, seconds by stage

    def add(self, result: Result) -> None:
        """Store the result of a batch; the sink of a live pipeline."""
        if len(result.frames):
            self.newest = result
            self._frames += len(result.frames)

    def facts(self) -> dict[str, object]:
        """Constant data: axes of the heat maps, time budget."""
        config, maps = self._heatmaps.config, self._heatmaps
        return {
            "budget_ms": 1e3 * config.frame_period,
            "fan": {"width": self._fan.width, "reach": self._fan.reach},
            "doppler": {"speed": -float(maps.velocities[0]), "azimuth": round(float(np.degrees(maps.azimuths[-1])), 1)},
        }

    def pictures(self, adc: np.ndarray, valid: np.ndarray) -> dict[str, UInt8[np.ndarray, "row column 4"]]:
        """Heat maps of a frame; ``adc`` and ``valid`` have a frame axis of one."""
        spectrum = self._heatmaps.spectrum(adc, valid)
        doppler = self._heatmaps.doppler_azimuth_of(spectrum)[0].numpy()
        return {
            "fan": self._fan.draw(self._heatmaps.range_azimuth_of(spectrum)[0].numpy()),
            # Closing speeds upwards, left to the left.
            "doppler": np.kron(colored(doppler)[::-1, ::-1], np.ones((5, 1, 1), np.uint8)),
        }

    def frame(self, pictures: dict[str, np.ndarray], stamp: float) -> dict[str, object]:
        """Pictures of a frame, pose, and load."""
        pose = self.pose()
        shown = {name: png(pixels) for name, pixels in pictures.items()}
        place = None if pose is None else [round(float(value), 4) for value in pose]
        return {"time": stamp, "pose": place, "load": self._load(), **shown}

    @staticmethod
    def map(grid: OccupancyGrid, poses: Float[np.ndarray, "node 3"], loops: int) -> dict[str, object]:
        """Map, path of the nodes, and number of closed loops."""
        chance = np.rint(255 * grid.probability[::-1] * grid.unit).astype(np.uint8)
        shade = 255 - chance
        colors = np.stack([shade, shade, shade, np.where(chance > 0, 255, 0).astype(np.uint8)], axis=-1)
        rows, columns = chance.shape
        return {
            "picture": png(colors),
            "origin": [float(value) for value in grid.origin],
            "size": [columns * grid.resolution, rows * grid.resolution],
            "path": np.round(poses[:, :2], 3).tolist(),
            "loops": loops,
        }

    def pose(self) -> Float[np.ndarray, "3"] | None:
        """Pose of the sensor on the map: that of the last node, plus odometry since then."""
        slam = self._pipeline.slam
        if self.newest is None:
            return None
        now = self.newest.track.pose[-1]
        if slam.nodes:
            now = compose(slam.graph.poses[-1], between(slam.odometry.pose(slam.nodes[-1].time), now))
        return now

    def _load(self) -> dict[str, object]:
        """Frames per second, and ms per frame by stage, over the last seconds."""
        now = time.monotonic(), self._frames, dict(self._pipeline.seconds)
        self._history.append(now)
        while len(self._history) > 2 and self._history[1][0] <= now[0] - _SPAN:
            self._history.popleft()
        before = self._history[0]
        seconds, frames = now[0] - before[0], now[1] - before[1]
        if not frames or seconds <= 0:
            return {"rate": 0.0, "stages": {}}
        stages = {name: 1e3 * (total - before[2].get(name, 0.0)) / frames for name, total in now[2].items()}
        return {"rate": frames / seconds, "stages": {name: round(value, 3) for name, value in stages.items()}}
