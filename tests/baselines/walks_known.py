"""Recordings of a walk that is known in closed form, with an IMU that is perfect."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from radarize.io.recording import RecordingWriter, Stream
from radarize.odometry.inertial import GRAVITY
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16})
RADIUS, RATE = 2.0, 0.4  # m and rad/s: of a circle that is walked with the shoulder ahead
TILT = 0.15  # rad, by which the sensor looks down


def pose(time: np.ndarray) -> np.ndarray:
    """Positions and quaternions (frame, 7)."""
    angle = RATE * np.asarray(time)
    place = np.column_stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), np.full_like(angle, 1.2)])
    return np.column_stack([place, attitude(time).as_quat()])


def attitude(time: np.ndarray) -> Rotation:
    """Of the sensor in the world: its heading turns with the angle on the circle and starts at 1 rad."""
    return Rotation.from_euler("ZY", np.column_stack([1.0 + RATE * np.asarray(time), np.full(len(time), TILT)]))


def imu(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Specific force and angular velocity in the sensor's frame."""
    inward = -(RATE**2) * pose(time)[:, :3] * [1, 1, 0]
    back = attitude(time).inv()
    return back.apply(inward + [0, 0, GRAVITY]), back.apply(np.tile([0, 0, RATE], (len(time), 1)))


def walk(path: Path, frames: int = 120, with_imu: bool = True) -> Path:
    """A recording of noise, with true poses and an IMU of 200 Hz."""
    rng = np.random.default_rng(0)
    times = np.arange(frames) * CONFIG.frame_period
    clock = np.arange(0, frames * CONFIG.frame_period, 0.005)
    rows = {"truth/pose": pose(times + CONFIG.burst_center), "truth/time": times + CONFIG.burst_center}
    streams = {name: Stream(data.shape[1:], "f8", "", "") for name, data in rows.items()}
    force, turn = imu(clock)
    sensed = {"imu/time": clock, "imu/accelerometer": force, "imu/gyroscope": turn} if with_imu else {}
    streams |= {name: Stream(data.shape[1:], "f8", "", "", "imu/time") for name, data in sensed.items()}
    with RecordingWriter(path, CONFIG, streams=streams) as writer:
        for name, data in sensed.items():
            writer.extend(name, data)
        writer.append(rng.integers(-50, 50, (frames, *CONFIG.frame_shape)).astype(np.int16), times, rows=rows)
    return path
