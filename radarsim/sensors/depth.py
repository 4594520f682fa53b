"""Stereo depth camera like Intel's RealSense D435i, with a picture at the centre of every burst.

The model has these steps, in the camera's order:

- The first surface along each pixel's ray; clear glass is transparent to both imagers.
- Disparity f b / z, with a noise of 0.08 px at the camera's 848 columns, so that the depth noise grows as
  z^2 0.08 / (f b): 4 mm at 1 m, 57 mm at 4 m (Grunnet-Jepsen, Sweetser and Woodfill, "Tuning depth cameras for best
  performance", Intel), and a step of 1/32 px ("Subpixel linearity improvement", Intel).
- No value (0) nearer than 0.195 m, the D435's smallest depth at 848 x 480, and beyond 10 m, its largest; in the strip
at
  the left edge that the right imager does not see; where the right imager's view is blocked by something nearer (the
  shadow on the left of every object); and at one pixel in a hundred (fill rate >= 99 %): D400 series data sheet,
  sections 4.4 and 4.8.

Noise of neighbouring pixels is independent, unlike that of stereo matching over windows of pixels.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt16

from radarize.io.recording import Product, Stream
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor

#: Pose of the camera in the radar's frame, m: six centimetres above it, looking in the same direction.
MOUNT = (0.0, 0.0, 0.06)


def mount(sensor: str) -> Product:
    """Stream attributes with the pose of a sensor at `MOUNT`."""
    place = np.array([*MOUNT, 0.0, 0.0, 0.0, 1.0])
    return Product(place, "m, quaternion", f"x y z qx qy qz qw of the {sensor} in the radar's frame")


@dataclass(frozen=True)
class Intrinsics:
    """Intrinsics of a pinhole camera.

    Attributes:
        width, height: pixels.
        fx, fy, cx, cy: focal lengths and principal point, pixels; pixel centres have whole coordinates.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of_view(cls, width: int, height: int, horizontal: float, vertical: float) -> "Intrinsics":
        """Build intrinsics from the camera's fields of view, rad."""
        fx, fy = width / 2 / np.tan(horizontal / 2), height / 2 / np.tan(vertical / 2)
        return cls(width, height, fx, fy, (width - 1) / 2, (height - 1) / 2)

    @property
    def rays(self) -> Float[np.ndarray, "height width 3"]:
        """Points at unit depth on each pixel's ray, in the frame x forward, y left, z up."""
        u, v = np.meshgrid(np.arange(self.width), np.arange(self.height))
        return np.stack([np.ones(u.shape), -(u - self.cx) / self.fx, -(v - self.cy) / self.fy], axis=-1)


#: The full field of view, 87 x 58 degrees, at a quarter of the camera's 848 x 480.
QUARTER = Intrinsics.of_view(212, 120, np.deg2rad(87), np.deg2rad(58))
#: The strip of 848 x 480 that the Radarize data set contains.
STRIP = Intrinsics(848, 100, 423.993, 423.993, 432.966, 50.938)


@dataclass(frozen=True)
class Stereo:
    """Parameters of stereo depth measurement.

    Attributes:
        baseline: between the imagers, m; the right one is that far to the right of the camera's origin.
        focal_length: of the full picture, pixels at 848 columns.
        subpixel: noise of the disparity, pixels, standard deviation.
        step: of the disparity, pixels.
        nearest, farthest: depths measured, m.
        dropout: share of pixels without a value.
    """

    baseline: float = 0.05
    focal_length: float = 424.0
    subpixel: float = 0.08
    step: float = 1 / 32
    nearest: float = 0.195
    farthest: float = 10.0
    dropout: float = 0.01

    def measure(
        self, depth: Float[np.ndarray, "*frame height width"], camera: Intrinsics, rng: np.random.Generator
    ) -> UInt16[np.ndarray, "*frame height width"]:
        """Simulate measured depth in mm, 0 without a value; `depth` is the true depth, m, inf without a surface."""
        scale = np.float32(self.focal_length * self.baseline)
        disparity = scale / np.asarray(depth, np.float32)
        # Columns in the right imager's picture, left to right. A point is occluded there if a point further right in
        # the left picture falls on its column or left of it.
        column = np.arange(camera.width, dtype=np.float32) - disparity * np.float32(camera.fx / self.focal_length)
        nearest = np.minimum.accumulate(column[..., ::-1], axis=-1)[..., ::-1]
        seen = (column > -0.5) & (depth >= self.nearest)
        seen[..., :-1] &= column[..., :-1] < nearest[..., 1:]
        seen &= rng.random(depth.shape, dtype=np.float32) >= self.dropout
        disparity += np.float32(self.subpixel) * rng.standard_normal(depth.shape, dtype=np.float32)
        disparity = np.rint(disparity / np.float32(self.step)) * np.float32(self.step)
        measured = scale / np.maximum(disparity, np.float32(1e-3))
        seen &= measured <= self.farthest
        return np.where(seen, np.rint(1000 * measured), 0).astype(np.uint16)


class DepthCamera(Sensor):
    """Depth pictures, one per frame.

    Args:
        scenario: scenario of the recording.
        camera: intrinsics.
        stereo: stereo parameters; None: exact depth.
    """

    def __init__(self, scenario: Scenario, camera: Intrinsics = QUARTER, stereo: Stereo | None = Stereo()):
        super().__init__(scenario)
        self._camera, self._stereo, self._motion = camera, stereo, scenario.motion.mounted(MOUNT)
        rays = camera.rays.reshape(-1, 3)
        self._stretch = np.linalg.norm(rays, axis=1)
        self._rays = rays / self._stretch[:, None]
        about = "depth along the optical axis in the middle of the burst, row by row from the upper left; 0: no value"
        self.streams = {"truth/depth": Stream((camera.height, camera.width), "u2", "mm", about)}
        pinhole = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
        self.products = {
            "truth/depth_intrinsics": Product(pinhole, "pixels", "fx fy cx cy of the depth camera"),
            "truth/depth_mount": mount("depth camera (x forward, z up)"),
        }

    def depth(self, times: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame height width"]:
        """Exact depth at given times, m, inf without a surface."""
        rotation = self._motion.rotation(times).as_matrix()
        directions = self._rays @ rotation.transpose(0, 2, 1)
        distance = self.scenario.rays.distance(self._motion.position(times), directions, times, through_glass=True)
        return (distance / self._stretch).reshape(len(times), self._camera.height, self._camera.width)

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Depth pictures of frames."""
        depth = self.depth(frames.middles)
        if self._stereo is None:
            return {"truth/depth": np.where(depth < 65.5, np.rint(1000 * depth), 0).astype(np.uint16)}
        measured = [
            self._stereo.measure(picture, self._camera, self.scenario.rng("depth", time))
            for picture, time in zip(depth, frames.times, strict=True)
        ]
        return {"truth/depth": np.stack(measured)}


class DepthStrip(DepthCamera):
    """Depth camera of the Radarize data set: 848 x 100 pixels."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario, STRIP)
