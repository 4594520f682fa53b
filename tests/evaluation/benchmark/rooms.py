"""A data set without a simulator: walks in an L-shaped room, whose samples are noise and whose truth is exact."""

import json
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.radar.presets import PRESETS
from tests.evaluation.fake_run import PLAN, TRUE_AZIMUTHS, cast, walk

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 8, "samples": 32, "frame_period": 1 / 15})
#: Building, platform and attributes of the recordings.
ROOMS = {
    "A_handheld": ("A", "handheld", {"stress": "corner", "severity": 0}),
    "A_cart": ("A", "cart", {"stress": "corner", "severity": 1}),
    "B_robot": ("B", "robot", {"ablation": "loops", "value": 8, "chirps": "of 8 loops"}),
}
#: As `radarsim dataset` writes it.
INDEX = {
    "specification": {
        "name": "rooms",
        "seed": 5,
        "splits": {"random": {"kind": "random"}, "platform": {"kind": "platform"}, "building": {"kind": "building"}},
    },
    "splits": {
        "random-0": {"train": ["B_robot"], "validation": [], "test": ["A_handheld", "A_cart"]},
        "random-1": {"train": ["A_cart"], "validation": [], "test": ["A_handheld"]},
        "platform": {"train": ["A_handheld"], "validation": [], "test": ["A_cart", "B_robot"]},
        "building-A": {"train": ["B_robot"], "validation": [], "test": ["A_handheld", "A_cart"]},
        "building-B": {"train": ["A_cart"], "validation": [], "test": ["B_robot"]},
    },
}


def write_rooms(folder: Path, frames: int = 60) -> Path:
    """The data set."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "dataset.json").write_text(json.dumps(INDEX))
    for number, (name, (building, platform, about)) in enumerate(ROOMS.items()):
        write_room(folder / f"{name}.h5", frames, number, scene=f"{building}_0", platform=platform, **about)
    return folder


def write_room(path: Path, frames: int, seed: int, **attributes) -> Path:
    """One recording, which starts elsewhere on the same loop for every seed."""
    times, positions, yaw = (values[40 * seed :][:frames] for values in walk())
    times = times - times[0]
    speed = np.gradient(positions, times, axis=0)
    c, s = np.cos(yaw), np.sin(yaw)
    zero = np.zeros(frames)
    quaternions = Rotation.from_euler("z", yaw[:, None]).as_quat()
    rows = {
        "truth/time": times + CONFIG.burst_center,
        "truth/pose": np.column_stack([positions, zero, quaternions]),
        "truth/velocity": np.column_stack([c * speed[:, 0] + s * speed[:, 1], c * speed[:, 1] - s * speed[:, 0]]),
        "truth/scan": cast(positions, yaw, TRUE_AZIMUTHS),
    }
    rows["truth/velocity"] = np.pad(rows["truth/velocity"], ((0, 0), (0, 4)))
    products = {
        "truth/floor_plan": Product(PLAN, "m", "walls"),
        "truth/scan_azimuths": Product(TRUE_AZIMUTHS, "rad", "bearings"),
    }
    streams = {name: Stream(data.shape[1:], "f8", "", "") for name, data in rows.items()}
    samples = np.random.default_rng(seed).integers(-99, 99, (frames, *CONFIG.frame_shape), np.int16)
    with RecordingWriter(path, CONFIG, attributes=attributes, streams=streams, products=products) as writer:
        writer.append(samples, times, rows=rows)
    return path
