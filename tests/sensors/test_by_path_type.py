"""I/Q by path type where a part exceeds the converter's range."""

import numpy as np

from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.sensors.by_path_type import AdcByPathType
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 4})


def test_parts_far_above_full_scale_add_up():
    """A metal wall 1 m off, 46 dB above full scale: 6.9e6 counts."""
    wall = {"name": "wall", "shape": "rectangle", "size": [4, 4], "position": [1, 0, 0], "facing": [-1, 0, 0]}
    scene = Scene.of({"objects": [wall | {"material": "metal"}]}, "wall")
    scenario = Scenario(scene, Motion.still((0, 0, 0)), CONFIG, FrontEndConfig.ideal(full_scale_dbm=-80))
    frames = scenario.frames(np.array([0.0]))
    parts = AdcByPathType(scenario).observe(frames)["truth/adc_by_cause"][0].astype(float)
    signal = scenario.synthesize(frames.lengths[0], frames.received[0])
    counts = scenario.board.receive(signal, np.random.default_rng(0))
    assert np.abs(counts).max() > 6e6
    assert np.isfinite(parts).all()
    assert np.abs(parts.sum(axis=0) - np.stack([counts.real, counts.imag], axis=-1)).max() < 1e-5 * np.abs(counts).max()
