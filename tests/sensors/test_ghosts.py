"""Maps by path type against the heat maps of the I/Q by path type."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from radarsim.motion.walk import Walk
from radarsim.propagation.path_types import PathType
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.sensors.by_path_type import PARTS, AdcByPathType
from radarsim.sensors.ghosts import NOISE, Ghosts
from radarsim.sensors.scan import AZIMUTHS
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]


@pytest.fixture(scope="module")
def seen():
    """Three frames of people in an office: (ghost sensor, its rows, map of the I/Q by path type)."""
    scene = Scene.load("visitors")
    motion = Walk("handheld", 5.0).through(scene, 5)
    scenario = Scenario(scene, motion, CONFIG, FrontEndConfig.of(CONFIG.board, mismatch=None), seed=1)
    sensor, frames = Ghosts(scenario), scenario.frames(np.array([1.4, 2.9, 4.1]))
    iq = AdcByPathType(scenario).observe(frames)["truth/adc_by_cause"].astype(np.float32)
    maps = Heatmaps(CONFIG, azimuths=AZIMUTHS)
    reference = np.stack([maps.range_azimuth(part).numpy() for part in iq])
    return sensor, sensor.observe(frames), reference


@pytest.mark.parametrize(
    ("cause", "least"),
    [(PathType.DIRECT, 1e-3), (PathType.FLOOR_CEILING, 1e-3), (PathType.GHOST, 1e-3), (PathType.MOVING, 0.1)],
)
def test_maps_are_those_of_the_iq(seen, cause, least):
    """A few instants stand for 32 loops, nine cells of ten above the noise within a dB.

    Limbs too fast for the radar smear over the I/Q's map: of what moves, only the strongest cells are compared.
    """
    sensor, rows, reference = seen
    expected = reference[:, cause]
    found = 10 ** (rows["truth/cause_power"][:, cause] / 10)
    strong = expected > np.maximum(least * expected.max(), 10 ** ((sensor._floor + 3) / 10))
    off = 10 * np.log10(found[strong] / expected[strong])
    assert strong.sum() > 20
    median, most = (0.2, 1.0) if cause != PathType.MOVING else (1.0, 4.0)
    assert abs(np.median(off)) < median and np.quantile(np.abs(off), 0.9) < most
    assert 10 * np.log10(found[strong].sum() / expected[strong].sum()) == pytest.approx(0, abs=1.0)


def test_the_label_is_the_strongest_cause(seen):
    _, rows, reference = seen
    top_two = np.sort(reference, axis=1)[:, -2:]
    clear = (top_two[:, 1] > 10 * top_two[:, 0]) & (rows["truth/cause"] != NOISE)
    assert clear.mean() > 0.1
    assert np.mean(rows["truth/cause"][clear] == reference.argmax(axis=1)[clear]) > 0.97
    assert set(np.unique(rows["truth/cause"])) <= {*range(len(PARTS)), NOISE}
    # The leakage rules the first bins, but for what stands right before the radar.
    assert np.mean(rows["truth/cause"][:, 1:3] == PARTS.index("leakage")) > 0.6


def test_cells_below_the_noise_are_noise(seen):
    """The noise threshold is the level of a map of noise only."""
    sensor, rows, reference = seen
    rng = np.random.default_rng(0)
    empty = sensor.scenario.board.receive(np.zeros(CONFIG.frame_shape[:-1], np.complex64), rng)
    leakage = sensor.scenario.board.by_path_type([])[0]
    quiet = empty - leakage
    adc = np.stack([quiet.real, quiet.imag], axis=-1).astype(np.float32)[None]
    level = Heatmaps(CONFIG, azimuths=AZIMUTHS).range_azimuth(adc)[0].numpy()[30:70]
    assert 10 * np.log10(np.median(level)) == pytest.approx(sensor._floor, abs=1.0)
    silent = reference.sum(axis=1) < 10 ** ((sensor._floor - 6) / 10)
    assert silent.sum() == 0 or np.mean(rows["truth/cause"][silent] == NOISE) > 0.95
