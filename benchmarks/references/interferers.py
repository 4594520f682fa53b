"""References for `tests/receiver/test_interference.py` and the gallery."""

import numpy as np

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.receiver.frontend_config import Band, FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 8})

IDEAL = FrontEndConfig.ideal(band=Band())

FAR = {"name": "post", "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0, 50, 0], "material": "wood"}


def scenario(*others: dict, front_end=IDEAL, motion=None, config=CONFIG, objects=(FAR,)) -> Scenario:
    """Return a scenario of a radar at the origin, and others around it in a nearly empty scene."""
    named = [{"name": str(k), **other} for k, other in enumerate(others)]
    scene = Scene.of({"objects": list(objects), "interferers": named}, "place")
    return Scenario(scene, motion or Motion.still((0, 0, 0)), config, front_end)


def facing(distance: float, bearing: float = 0.0, **fields) -> dict:
    """Return a radar at a distance and bearing (deg) that faces the origin."""
    angle = np.deg2rad(bearing)
    place = [distance * np.cos(angle), distance * np.sin(angle), 0.0]
    return {"position": place, "yaw": 180 + bearing, "radar": {"loops": 8}} | fields


def schedule(radar, clock):
    """Return transmitted phase (cycles) and transmitter (-1: none) of a radar at times of its clock (s)."""
    frame = np.floor(clock / radar.frame_period)
    chirp = np.floor((clock - frame * radar.frame_period) / radar.chirp_time)
    into = clock - frame * radar.frame_period - chirp * radar.chirp_time - radar.idle_time
    sends = (clock >= 0) & (chirp < radar.loops * len(radar.tx_order)) & (into >= 0) & (into <= radar.ramp_end_time)
    sender = np.array(radar.tx_order)[chirp.astype(int) % len(radar.tx_order)]
    return into * (radar.start_frequency + into * radar.slope / 2), np.where(sends, sender, -1)


def brute_force(made: Scenario, time: float, loop: int, tx: int, rx: int, fine: int = 4096) -> np.ndarray:
    """Compute the samples of a chirp: the product of both waveforms in small steps over the ramp, filtered in small
    steps.

    An independent sum from the schedules of both radars, without a search of frequencies or crossings.
    """
    config, (other,) = made.config, made.scene.interferers
    begin = time + (loop * len(config.tx_order) + config.slot[tx]) * config.chirp_time + config.idle_time
    rate = fine * config.sample_rate
    t = np.arange(int(config.ramp_end_time * rate)) / rate
    now = begin + t
    rotation = made.motion.rotation(now[[0, -1]]).as_matrix()
    ends = made.motion.position(now[[0, -1]]) + rotation @ rx_positions(config)[rx]
    here = ends[0] + np.linspace(0, 1, len(t))[:, None] * (ends[1] - ends[0])
    product, yaw = np.zeros(len(t), complex), np.deg2rad(other.yaw)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    for k, place in zip(other.radar.tx, tx_positions(other.radar), strict=True):
        there = np.asarray(other.position) + now[:, None] * other.velocity + turn @ place
        away = np.linalg.norm(there - here, axis=1)
        clock = (now - away / SPEED_OF_LIGHT - other.start) * (1 + 1e-6 * other.clock_ppm)
        phase, sender = schedule(other.radar, clock)
        own = t * (config.start_frequency + t * config.slope / 2)
        product += (sender == k) * np.exp(2j * np.pi * ((own % 1) - (phase % 1)))
    middle = np.array([time + config.burst_center])
    away = np.linalg.norm(np.asarray(other.position) + middle * other.velocity - made.motion.position(middle)[0])
    product *= other.radar.wavelength / (4 * np.pi * away)
    count = 4 * len(t)
    beat = np.fft.fftfreq(count, 1 / rate)
    low, high = (-0.06, 1.05) if made.board.settings.band else (-10e6 / config.sample_rate, 10e6 / config.sample_rate)
    inside = (beat > low * config.sample_rate) & (beat < high * config.sample_rate)
    spectrum = np.fft.fft(product, count)
    if made.board.settings.image_rejection_db is not None:
        image = np.fft.fft(product.conj(), count) * 10 ** (-made.board.settings.image_rejection_db / 20)
        spectrum += np.where(beat > 0, image, 0)
    spectrum = spectrum[inside] * made.board.beat_response(beat[inside])
    at = config.adc_start_time + np.arange(config.samples) / config.sample_rate
    return np.exp(2j * np.pi * at[:, None] * beat[inside]) @ spectrum / count


CASES = {
    "steep": (facing(4, 20, start=-0.4e-6, radar={"slope": 78e12, "loops": 8}), {}),
    "steeper": (
        facing(4, 20, start=3e-6, radar={"slope": 95e12, "ramp_end_time": 42e-6, "samples": 64, "loops": 8}), {},
    ),
    "nearly parallel": (facing(3, -30, start=0.01e-6, radar={"slope": 79.95e12, "loops": 8}), {}),
    "parallel": (facing(3, 10, start=5e-9, clock_ppm=0.2), {}),
    "no decimation filter": (
        facing(4, 20, start=-0.4e-6, radar={"slope": 78e12, "loops": 8}),
        {"front_end": FrontEndConfig.ideal(high_pass=True)},
    ),
    "image": (
        facing(4, 20, start=-0.4e-6, radar={"slope": 78e12, "loops": 8}),
        {"front_end": FrontEndConfig.ideal(band=Band(), image_rejection_db=10.0)},
    ),
    "short chirps": (
        facing(5, start=7e-6, radar={"slope": 60e12, "idle_time": 7e-6, "adc_start_time": 3e-6, "samples": 16,
                                     "ramp_end_time": 12e-6, "loops": 32}), {},
    ),
    "moving": (
        facing(4, 20, start=-0.4e-6, velocity=[-3.0, 1.0, 0.5], clock_ppm=5, radar={"slope": 78e12, "loops": 8}),
        {"motion": Motion.linear((0, 0, 0), (1.5, 0.5, 0), yaw=0.2, yaw_rate=1.0)},
    ),
}  # fmt: skip
