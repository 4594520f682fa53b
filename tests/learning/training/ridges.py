"""Data sets of maps drawn by known laws, which a network learns in seconds."""

from pathlib import Path

import numpy as np

from radarize.io.recording import RecordingWriter, Stream
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import AZIMUTHS, MAPS, MapMaker

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16, "samples": 16})


def ridge(velocity: np.ndarray, config=CONFIG) -> np.ndarray:
    """Doppler-azimuth maps (frame, doppler, azimuth) of a static world, dB: a ridge along v cos(phi - theta)."""
    bins = (np.arange(config.loops) - config.loops // 2) * config.velocity_resolution
    closing = velocity[:, :1] * np.cos(AZIMUTHS) + velocity[:, 1:2] * np.sin(AZIMUTHS)
    off = (bins[:, None] - closing[:, None]) / config.velocity_resolution
    return 25 * np.exp(-0.5 * off**2)


def landmark(yaw: np.ndarray, rng: np.random.Generator, config=CONFIG) -> np.ndarray:
    """Range-azimuth maps (frame, range, azimuth), dB, of a pole somewhere ahead of a sensor that only turns."""
    off = AZIMUTHS - (rng.uniform(-0.2, 0.2) - yaw[:, None])
    shown = 25 * np.exp(-0.5 * (off / np.radians(5)) ** 2)
    near = np.exp(-0.5 * ((np.arange(config.samples) - rng.uniform(4, 12)) / 1.5) ** 2)
    return shown[:, None] * near[:, None]


def walls(frames: int, rng: np.random.Generator, config=CONFIG) -> tuple[np.ndarray, np.ndarray]:
    """Range-azimuth maps of one wall each, dB, and its occupancy labels."""
    depth, slope = rng.uniform(4, 11, (frames, 1)), rng.uniform(-3, 3, (frames, 1))
    rows = np.arange(config.samples)[:, None]
    maps = 25 * np.exp(-0.5 * ((rows - (depth + slope * AZIMUTHS)[:, None]) / 0.7) ** 2)
    first = np.rint(depth + slope * BEARINGS)[:, None]
    return maps, np.where(rows < first, 0, np.where(rows == first, 1, 2)).astype(np.uint8)


def write(path: Path, law: str, frames: int = 300, seed: int = 0, blank: float = 0.0, config=CONFIG) -> Path:
    """A recording of noisy maps by law ``velocity``, ``yaw`` or ``occupancy``; a share of its frames is blank."""
    rng = np.random.default_rng(seed)
    maker = MapMaker(config)
    velocity = np.zeros((frames, 6))
    velocity[:, :2] = rng.uniform(-1, 1, (frames, 2)) * (1.2, 0.8) * (law != "yaw")  # who turns stands still
    yaw = 0.6 * np.sin(np.cumsum(rng.uniform(0, 0.15, frames)))
    zero = np.zeros(frames)
    shown, label = walls(frames, rng, config)
    if law == "yaw":
        shown = landmark(yaw, rng, config)
    drawn = {name: ridge(velocity, config) if name.startswith("doppler") else shown for name in MAPS}
    rows = {
        "truth/velocity": velocity,
        "truth/pose": np.column_stack([zero, zero, zero, zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)]),
        "truth/occupancy": label,
    }
    seen = (rng.random((frames, 1, 1)) >= blank).astype(float)
    for name in MAPS:
        values = seen * drawn[name] + rng.normal(0, 2, (frames, *maker.shape(name))) + rng.uniform(5, 25)
        rows[f"maps/{name}"] = values.astype(np.float16)
    streams = {name: Stream(data.shape[1:], data.dtype.str, "", "") for name, data in rows.items()}
    with RecordingWriter(path, config, streams=streams, raw=False) as writer:
        writer.append(None, np.arange(frames) * config.frame_period, rows=rows)
    return path


def data_set(folder: Path, law: str, count: int = 3, frames: int = 300) -> Path:
    """A folder of recordings."""
    for k in range(count):
        write(folder / f"{k}.h5", law, frames, seed=k)
    return folder
