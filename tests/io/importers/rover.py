"""A sequence in the layout of roverd, as a rig of I/Q-1M records it."""

import json
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from radarize.radar.dca1000 import encode
from tests.io.importers.test_import_bin import CONFIG, room

RADAR = CONFIG.model_copy(update={"tx_order": (0, 1, 2)})
FRAMES = 5
CHIRPS = {
    "device": "AWR1843", "port": "/dev/ttyACM0", "frequency": RADAR.start_frequency / 1e9,
    "idle_time": RADAR.idle_time * 1e6, "adc_start_time": RADAR.adc_start_time * 1e6,
    "ramp_end_time": RADAR.ramp_end_time * 1e6, "tx_start_time": 1.0, "freq_slope": RADAR.slope / 1e12,
    "adc_samples": RADAR.samples, "sample_rate": round(RADAR.sample_rate / 1e3), "frame_length": RADAR.loops,
    "frame_period": RADAR.frame_period * 1e3,
}  # fmt: skip


def chirps(path: Path, fields: dict) -> None:
    path.write_text(yaml.safe_dump({"radar": {"type": "radar", "args": {"radar": fields}}}))


def write_sequence(folder: Path) -> Path:
    """Five frames of a room, of which the third lost a packet; poses twice as often."""
    for name in ("radar", "_radar"):
        (folder / name).mkdir(parents=True)
    chirps(folder / "config.yaml", CHIRPS)
    words = encode(room(RADAR, FRAMES), RADAR).reshape(FRAMES, RADAR.loops, 3, 4, 2 * RADAR.samples)
    words[2, 1, 2, 1:3] = 0
    about = {
        "iq": {"format": "raw", "type": "i2", "shape": list(words.shape[1:]), "desc": "Raw I/Q stream."},
        "ts": {"format": "raw", "type": "f8", "shape": []}, "valid": {"format": "raw", "type": "u1", "shape": []},
    }  # fmt: skip
    (folder / "radar/meta.json").write_text(json.dumps(about))
    words.astype("<i2").tofile(folder / "radar/iq")
    (1.7e9 + 0.05 * np.arange(FRAMES)).tofile(folder / "radar/ts")
    np.array([1, 1, 0, 1, 1], np.uint8).tofile(folder / "radar/valid")
    turned = Rotation.from_rotvec(np.linspace(0, 1, 10)[:, None] * [0, 0, 1]).as_matrix()
    np.savez(
        folder / "_radar/pose.npz", t=1.7e9 + 0.025 * np.arange(10), pos=np.arange(30.0).reshape(10, 3), rot=turned
    )
    return folder
