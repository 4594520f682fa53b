"""Small recordings with truth: two point echoes in noise, on a sensor that turns."""

from pathlib import Path

import numpy as np

from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 8})
TURN = 0.05  # rad a frame
VELOCITY = (0.5, -0.2, 0.1)


def walk(path: Path, frames: int = 12, truth: bool = True, seed: int = 0, start: float = 0.0) -> Path:
    """A recording whose velocity and turn rate are constant."""
    rng = np.random.default_rng(seed)
    n = np.arange(CONFIG.samples)
    echo = 500 * np.exp(2j * np.pi * 20 / CONFIG.samples * n) + 50 * np.exp(2j * np.pi * 50 / CONFIG.samples * n)
    noise = rng.normal(0, 20, (frames, *CONFIG.frame_shape))
    adc = np.rint(noise + np.stack([echo.real, echo.imag], axis=-1)).astype(np.int16)
    times = start + np.arange(frames) * CONFIG.frame_period
    yaw = 3.0 + TURN * np.arange(frames)  # passes pi
    zero = np.zeros(frames)
    rows = {
        "truth/pose": np.column_stack([yaw, zero, zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)]),
        "truth/velocity": np.tile([*VELOCITY, 0, 0, TURN / CONFIG.frame_period], (frames, 1)),
        "truth/scan": np.tile(np.arange(88.0), (frames, 1)),
    }
    streams = {name: Stream(data.shape[1:], "f8", "", "") for name, data in rows.items()}
    streams["imu/time"] = Stream((), "f8", "s", "", "imu/time")
    products = {"truth/floor_plan": Product(np.eye(4), "m", "walls")}
    with RecordingWriter(
        path, CONFIG, attributes={"seed": seed}, streams=streams if truth else {}, products=products
    ) as writer:
        if truth:
            writer.extend("imu/time", start + np.arange(0, frames * CONFIG.frame_period, 0.005))
        writer.append(adc, times, rows=rows if truth else {})
    return path
