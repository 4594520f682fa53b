"""Parameters of a scenario in its frames: ranges that fold, random numbers by purpose and time."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.machine.rng import keyed_rng
from radarsim.motion.trajectory import Motion
from radarsim.receiver.frontend_config import Band, FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16})


def test_without_a_filter_what_lies_beyond_the_range_folds():
    """A large metal wall faces an isotropic radar from `far`: its echo falls as 1 / R, and without a decimation filter
    it stands at the range less the unambiguous one; with one it is gone."""

    def profile(range: float, **changes) -> np.ndarray:
        wall = {"name": "wall", "shape": "rectangle", "size": [8, 8], "position": [range, 0, 0], "facing": [-1, 0, 0]}
        scene = Scene.of({"objects": [wall | {"material": "metal"}]}, "wall")
        board = FrontEndConfig.ideal(full_scale_dbm=-40, **changes)
        samples = Scenario(scene, Motion.still((0, 0, 0)), CONFIG, board).frames(np.array([0.0])).samples[0]
        beat = (samples[..., 0] + 1j * samples[..., 1])[0, 0, 0]
        return np.abs(np.fft.fft(beat * np.hanning(len(beat)), 16 * len(beat)))

    near, far = CONFIG.max_range / 2, 1.5 * CONFIG.max_range
    direct, folded = profile(near), profile(far)
    step = CONFIG.max_range / len(direct)
    assert abs(direct.argmax() - folded.argmax()) * step < 0.01 and abs(folded.argmax() * step - near) < 0.01
    assert folded.max() / direct.max() == pytest.approx(near / far, rel=0.05)
    assert profile(far, band=Band()).max() < 0.01 * folded.max()


def test_draws_differ_by_seed_purpose_and_instant():
    keys = [(s, p, t) for s in (0, 1) for p in ("noise", "depth") for t in (None, 0.0, 1e-9, 1 / 30, 200.0)]
    first = {keyed_rng(*key).random() for key in keys}
    assert len(first) == len(keys) and first == {keyed_rng(*key).random() for key in keys}
