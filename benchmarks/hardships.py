"""What makes a walk hard: samples that are hurt, walks that move otherwise, or elsewhere."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int16
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.radar.noise import noise_floor, noise_profile
from radarsim.motion.pedestrians import with_pedestrians
from radarsim.motion.trajectory import Motion
from radarsim.motion.walk import Walk
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

#: Counts, of one chirp: as strong as furniture at 2 m.
_INTERFERER = 1000.0


class Samples(NamedTuple):
    """What is recorded: I/Q, start of each frame (s), and which chirps arrived."""

    adc: Int16[np.ndarray, "frame loop tx rx sample 2"]
    times: Float[np.ndarray, "frame"]
    valid: Bool[np.ndarray, "frame loop tx"]


class Condition(NamedTuple):
    """What is other than on the plain walk.

    Attributes:
        hurt: what becomes of its samples.
        scenario: what is simulated instead.
    """

    hurt: Callable[[Samples, np.random.Generator], Samples] | None = None
    scenario: Callable[[Scenario], Scenario] | None = None


# --- samples that are hurt --------------------------------------------------------------------------------------------
def _added(samples: Samples, wave: np.ndarray) -> Samples:
    counts = samples.adc + np.stack([wave.real, wave.imag], axis=-1)
    return samples._replace(adc=np.clip(np.rint(counts), -32768, 32767).astype(np.int16))


def phases_off(most: float) -> Callable[[Samples, np.random.Generator], Samples]:
    """Each channel by up to so many degrees, the same all along."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        turn = np.random.default_rng(1).uniform(-most, most, samples.adc.shape[2:4])
        return _multiplied(samples, np.exp(1j * np.radians(turn)))

    return hurt


def gains_off(samples: Samples, rng: np.random.Generator) -> Samples:
    """Each channel by up to 1 dB, the same all along."""
    return _multiplied(samples, 10 ** (np.random.default_rng(1).uniform(-1, 1, samples.adc.shape[2:4]) / 20))


def _multiplied(samples: Samples, channels: np.ndarray) -> Samples:
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    return _added(samples, signal * (channels[..., None] - 1))


def noisier(samples: Samples, rng: np.random.Generator) -> Samples:
    """By 6 dB: thrice the noise power is added."""
    shape = samples.adc.shape[:-1]
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    sigma = np.sqrt(3 * noise_floor(noise_profile(signal)) / 2)
    return _added(samples, sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)))


def receiver_dead(samples: Samples, rng: np.random.Generator) -> Samples:
    """The second one, of which the converter's own noise is left."""
    adc = samples.adc.copy()
    adc[:, :, :, 1] = np.rint(rng.normal(0, 5, adc[:, :, :, 1].shape))
    return samples._replace(adc=adc)


def chirps_lost(samples: Samples, rng: np.random.Generator) -> Samples:
    """One in twenty."""
    valid = samples.valid & (rng.random(samples.valid.shape) >= 0.05)
    return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)


def interference(share: float) -> Callable[[Samples, np.random.Generator], Samples]:
    """A share of the chirps crossed by another radar's ramp, which sweeps the band within half a chirp."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        wave = np.zeros(samples.adc.shape[:-1], np.complex64)
        count = wave.shape[-1]
        for place in np.argwhere(rng.random(samples.valid.shape) < share):
            n = np.arange(count // 2)
            sweep = np.exp(1j * (2 * np.pi * (n**2 / count - n / 2) + rng.uniform(0, 2 * np.pi, (wave.shape[3], 1))))
            start = rng.integers(0, count - len(n))
            wave[(*place, slice(None), slice(start, start + len(n)))] = _INTERFERER * sweep
        return _added(samples, wave)

    return hurt


def frames_lost(seconds: float, when: tuple[float, ...]) -> Callable[[Samples, np.random.Generator], Samples]:
    """So many seconds, from each of some instants."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        kept = np.all([(samples.times < t) | (samples.times >= t + seconds) for t in when], axis=0)
        valid = samples.valid & kept[:, None, None]
        return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)

    return hurt


# --- walks of another kind --------------------------------------------------------------------------------------------
def _along(motion: Motion, clock: Callable[[np.ndarray], np.ndarray], duration: float) -> Motion:
    """The same way by another clock."""
    times = np.arange(-1.0, duration + 1.0, 0.02)
    there = clock(times)
    path, attitude = CubicSpline(times, motion.path(there)), RotationSpline(times, motion.attitude(there))
    return replace(motion, duration=duration, path=path, attitude=attitude)


def faster(speed: float) -> Callable[[Scenario], Scenario]:
    """All of it quicker, so that `speed` (m/s) is the fastest."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        fastest = np.linalg.norm(motion.velocity(np.arange(0, motion.duration, 0.02))[:, :2], axis=1).max()
        share = speed / fastest
        return replace(scenario, motion=_along(motion, lambda t: share * t, motion.duration / share))

    return changed


def swinging(rate: float) -> Callable[[Scenario], Scenario]:
    """To and fro on the way, at `rate` (deg/s) at the fastest, every 2 s."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        times = motion.path.x
        swing = np.radians(rate) / np.pi * np.sin(np.pi * times) * np.clip(times - 0.5, 0, 1)
        attitude = Rotation.from_euler("z", swing[:, None]) * motion.attitude(times)
        return replace(scenario, motion=replace(motion, attitude=RotationSpline(times, attitude)))

    return changed


def standing(scenario: Scenario) -> Scenario:
    """Half a minute, in the middle."""
    motion, lasts = scenario.motion, 30.0
    middle = motion.duration / 2

    def clock(times: np.ndarray) -> np.ndarray:
        # It slows down and sets off again within half a second.
        fine = np.arange(-1.0, motion.duration + lasts + 1.0, 0.01)
        pace = np.clip(np.abs(fine - middle - lasts / 2) - lasts / 2 + 0.5, 0, 0.5) / 0.5
        return np.interp(times, fine, -1.0 + np.cumsum(pace) * 0.01)

    return replace(scenario, motion=_along(motion, clock, motion.duration + lasts))


def sidestepping(scenario: Scenario) -> Scenario:
    """To and fro, 1.3 m in front of a bare front of glass."""
    times = np.arange(-1.0, 31.0, 0.05)
    phase = 2 * np.pi / 20 * np.clip(times, 0, None)
    place = np.stack([4 - 2.4 * np.cos(phase), 3.7 + 0.1 * np.sin(3.1 * phase), np.full_like(times, 1.2)], axis=1)
    yaw = np.pi / 2 + np.radians(15) * np.sin(2.7 * phase)
    turns = RotationSpline(times, Rotation.from_euler("z", yaw[:, None]))
    return replace(scenario, scene=Scene.load("stress/people"), motion=Motion(30.0, CubicSpline(times, place), turns))


def _hollow(name: str, size: tuple[float, float, float], middle: tuple[float, float], **life: float) -> Scene:
    """An empty box of concrete, of so many metres along x, y, z, on the floor about a place."""
    length, width, height = size
    objects = [
        {
            "name": side,
            "size": [width if x else length, height],
            "position": [middle[0] + x * length / 2, middle[1] + y * width / 2, height / 2],
            "facing": [-x, -y, 0],
        }
        for side, (x, y) in {"west": (-1, 0), "east": (1, 0), "south": (0, -1), "north": (0, 1)}.items()
    ] + [
        {"name": "floor", "size": [length, width], "position": [*middle, 0], "facing": [0, 0, 1]},
        {"name": "ceiling", "size": [length, width], "position": [*middle, height], "facing": [0, 0, -1]},
    ]
    wall = {"shape": "rectangle", "material": "concrete"}
    return Scene.of({"objects": [wall | each for each in objects]} | life, name)


def hall(scenario: Scenario) -> Scenario:
    """Round the middle of a hall, whose walls are out of reach."""
    scene = _hollow("hall", (30.0, 30.0, 8.0), (0.0, 0.0), clutter=1.0)
    times = np.arange(-1.0, 31.0, 0.05)
    course = 2 * np.pi / 25 * np.clip(times, 0, None)
    place = np.stack([4 * np.cos(course), 4 * np.sin(course), np.full_like(times, 1.2)], axis=1)
    turns = RotationSpline(times, Rotation.from_euler("z", (course + np.pi / 2)[:, None]))
    return replace(scenario, scene=scene, motion=Motion(30.0, CubicSpline(times, place), turns))


def corridor(scenario: Scenario) -> Scenario:
    """There and back through an empty one of 60 m by 2.2 m."""
    scene = _hollow("corridor of 60 m", (60.0, 2.2, 2.6), (30.0, 0.0), unevenness=1.0)
    places = np.array([[2.0, 0.2], [58.0, -0.2], [2.0, 0.2]])
    return replace(scenario, scene=scene, motion=Walk("handheld", waypoints=places).through(scene, scenario.seed))


def crowd(scenario: Scenario) -> Scenario:
    """Five people walk about, 0.6 m away and more."""
    return replace(scenario, scene=with_pedestrians(scenario.scene, scenario.motion, 5, scenario.seed))


def mounted(height: float = 1.2, pitch: float = 0.0, roll: float = 0.0) -> Callable[[Scenario], Scenario]:
    """At another height (m), or tilted (deg)."""

    def changed(scenario: Scenario) -> Scenario:
        motion, raised = scenario.motion, np.array([0.0, 0.0, height - 1.2])
        times = motion.path.x
        tilted = motion.attitude(times) * Rotation.from_euler("YX", [pitch, roll], degrees=True)
        path = CubicSpline(times, motion.path(times) + raised)
        return replace(scenario, motion=replace(motion, path=path, attitude=RotationSpline(times, tilted)))

    return changed


CONDITIONS: dict[str, Condition] = {
    "plain": Condition(),
    "phases off by 10 deg": Condition(phases_off(10.0)),
    "phases off by 20 deg": Condition(phases_off(20.0)),
    "gains off by 1 dB": Condition(gains_off),
    "noise + 6 dB": Condition(noisier),
    "a receiver dead": Condition(receiver_dead),
    "5 % of chirps lost": Condition(chirps_lost),
    "frames of 1 s lost": Condition(frames_lost(1.0, (9.0, 17.0, 24.0))),
    "frames of 5 s lost": Condition(frames_lost(5.0, (14.0,))),
    "interference in 1 %": Condition(interference(0.01)),
    "interference in 5 %": Condition(interference(0.05)),
    "five people": Condition(scenario=crowd),
    "1.8 m/s": Condition(scenario=faster(1.8)),
    "2.4 m/s": Condition(scenario=faster(2.4)),
    "150 deg/s": Condition(scenario=swinging(150.0)),
    "220 deg/s": Condition(scenario=swinging(220.0)),
    "standing for 30 s": Condition(scenario=standing),
    "sidestepping along glass": Condition(scenario=sidestepping),
    "pitch of 5 deg": Condition(scenario=mounted(pitch=5.0)),
    "pitch of 10 deg": Condition(scenario=mounted(pitch=10.0)),
    "roll of 10 deg": Condition(scenario=mounted(roll=10.0)),
    "0.4 m high": Condition(scenario=mounted(height=0.4)),
    "1.6 m high": Condition(scenario=mounted(height=1.6)),
    "corridor of 60 m": Condition(scenario=corridor),
    "hall": Condition(scenario=hall),
}
