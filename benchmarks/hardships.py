"""Hard conditions for odometry: degraded samples, other motions, other places."""

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

#: Amplitude of an interfering chirp, ADC counts: equal to the echo of furniture at 2 m.
_INTERFERER = 1000.0


class Samples(NamedTuple):
    """I/Q samples, start of each frame (s), and whether each chirp arrived."""

    adc: Int16[np.ndarray, "frame loop tx rx sample 2"]
    times: Float[np.ndarray, "frame"]
    valid: Bool[np.ndarray, "frame loop tx"]


class Condition(NamedTuple):
    """A modification of the plain walk.

    Attributes:
        hurt: modifies its samples.
        scenario: modifies the simulated scenario.
    """

    hurt: Callable[[Samples, np.random.Generator], Samples] | None = None
    scenario: Callable[[Scenario], Scenario] | None = None


# --- degraded samples -------------------------------------------------------------------------------------------------
def _added(samples: Samples, wave: np.ndarray) -> Samples:
    counts = samples.adc + np.stack([wave.real, wave.imag], axis=-1)
    return samples._replace(adc=np.clip(np.rint(counts), -32768, 32767).astype(np.int16))


def phase_errors(most: float) -> Callable[[Samples, np.random.Generator], Samples]:
    """Constant phase errors of the channels, uniform up to a maximum in deg."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        turn = np.random.default_rng(1).uniform(-most, most, samples.adc.shape[2:4])
        return _multiplied(samples, np.exp(1j * np.radians(turn)))

    return hurt


def gain_errors(samples: Samples, rng: np.random.Generator) -> Samples:
    """Constant gain errors of the channels, uniform up to 1 dB."""
    return _multiplied(samples, 10 ** (np.random.default_rng(1).uniform(-1, 1, samples.adc.shape[2:4]) / 20))


def _multiplied(samples: Samples, channels: np.ndarray) -> Samples:
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    return _added(samples, signal * (channels[..., None] - 1))


def noisier(samples: Samples, rng: np.random.Generator) -> Samples:
    """A noise floor that is 6 dB higher: three times the noise power is added."""
    shape = samples.adc.shape[:-1]
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    sigma = np.sqrt(3 * noise_floor(noise_profile(signal)) / 2)
    return _added(samples, sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)))


def receiver_dead(samples: Samples, rng: np.random.Generator) -> Samples:
    """RX2 without a signal, except the noise of its converter."""
    adc = samples.adc.copy()
    adc[:, :, :, 1] = np.rint(rng.normal(0, 5, adc[:, :, :, 1].shape))
    return samples._replace(adc=adc)


def chirps_lost(samples: Samples, rng: np.random.Generator) -> Samples:
    """Loss of 5 % of the chirps."""
    valid = samples.valid & (rng.random(samples.valid.shape) >= 0.05)
    return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)


def interference(share: float) -> Callable[[Samples, np.random.Generator], Samples]:
    """Interference of a share of the chirps by another radar, whose ramp crosses the IF band within half a chirp."""

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
    """Loss of all frames for a number of seconds, from each of some times, s."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        kept = np.all([(samples.times < t) | (samples.times >= t + seconds) for t in when], axis=0)
        valid = samples.valid & kept[:, None, None]
        return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)

    return hurt


# --- other motions and places -----------------------------------------------------------------------------------------
def _along(motion: Motion, clock: Callable[[np.ndarray], np.ndarray], duration: float) -> Motion:
    """The same path with another course of time."""
    times = np.arange(-1.0, duration + 1.0, 0.02)
    there = clock(times)
    path, attitude = CubicSpline(times, motion.path(there)), RotationSpline(times, motion.attitude(there))
    return replace(motion, duration=duration, path=path, attitude=attitude)


def faster(speed: float) -> Callable[[Scenario], Scenario]:
    """The same path at a higher speed, with the maximum `speed` (m/s)."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        fastest = np.linalg.norm(motion.velocity(np.arange(0, motion.duration, 0.02))[:, :2], axis=1).max()
        share = speed / fastest
        return replace(scenario, motion=_along(motion, lambda t: share * t, motion.duration / share))

    return changed


def swinging(rate: float) -> Callable[[Scenario], Scenario]:
    """An additional oscillation of the yaw with a period of 2 s and a maximum `rate` (deg/s)."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        times = motion.path.x
        swing = np.radians(rate) / np.pi * np.sin(np.pi * times) * np.clip(times - 0.5, 0, 1)
        attitude = Rotation.from_euler("z", swing[:, None]) * motion.attitude(times)
        return replace(scenario, motion=replace(motion, attitude=RotationSpline(times, attitude)))

    return changed


def standing(scenario: Scenario) -> Scenario:
    """A stop of 30 s in the middle of the path."""
    motion, lasts = scenario.motion, 30.0
    middle = motion.duration / 2

    def clock(times: np.ndarray) -> np.ndarray:
        # Deceleration and acceleration within half a second.
        fine = np.arange(-1.0, motion.duration + lasts + 1.0, 0.01)
        pace = np.clip(np.abs(fine - middle - lasts / 2) - lasts / 2 + 0.5, 0, 0.5) / 0.5
        return np.interp(times, fine, -1.0 + np.cumsum(pace) * 0.01)

    return replace(scenario, motion=_along(motion, clock, motion.duration + lasts))


def sidestepping(scenario: Scenario) -> Scenario:
    """Sideways motion back and forth, 1.3 m in front of a bare glass front."""
    times = np.arange(-1.0, 31.0, 0.05)
    phase = 2 * np.pi / 20 * np.clip(times, 0, None)
    place = np.stack([4 - 2.4 * np.cos(phase), 3.7 + 0.1 * np.sin(3.1 * phase), np.full_like(times, 1.2)], axis=1)
    yaw = np.pi / 2 + np.radians(15) * np.sin(2.7 * phase)
    turns = RotationSpline(times, Rotation.from_euler("z", yaw[:, None]))
    return replace(scenario, scene=Scene.load("stress/people"), motion=Motion(30.0, CubicSpline(times, place), turns))


def _hollow(name: str, size: tuple[float, float, float], middle: tuple[float, float], **surfaces: float) -> Scene:
    """Return a scene of an empty concrete box, of a size along x, y, z (m), on the floor around a point."""
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
    return Scene.of({"objects": [wall | each for each in objects]} | surfaces, name)


def hall(scenario: Scenario) -> Scenario:
    """A circle in the middle of a hall whose walls are out of range."""
    scene = _hollow("hall", (30.0, 30.0, 8.0), (0.0, 0.0), clutter=1.0)
    times = np.arange(-1.0, 31.0, 0.05)
    course = 2 * np.pi / 25 * np.clip(times, 0, None)
    place = np.stack([4 * np.cos(course), 4 * np.sin(course), np.full_like(times, 1.2)], axis=1)
    turns = RotationSpline(times, Rotation.from_euler("z", (course + np.pi / 2)[:, None]))
    return replace(scenario, scene=scene, motion=Motion(30.0, CubicSpline(times, place), turns))


def corridor(scenario: Scenario) -> Scenario:
    """A walk back and forth through an empty corridor of 60 m by 2.2 m."""
    scene = _hollow("corridor of 60 m", (60.0, 2.2, 2.6), (30.0, 0.0), unevenness=1.0)
    places = np.array([[2.0, 0.2], [58.0, -0.2], [2.0, 0.2]])
    return replace(scenario, scene=scene, motion=Walk("handheld", waypoints=places).through(scene, scenario.seed))


def crowd(scenario: Scenario) -> Scenario:
    """Five pedestrians at distances of at least 0.6 m."""
    return replace(scenario, scene=with_pedestrians(scenario.scene, scenario.motion, 5, scenario.seed))


def mounted(height: float = 1.2, pitch: float = 0.0, roll: float = 0.0) -> Callable[[Scenario], Scenario]:
    """Another mounting height (m), pitch or roll (deg)."""

    def changed(scenario: Scenario) -> Scenario:
        motion, raised = scenario.motion, np.array([0.0, 0.0, height - 1.2])
        times = motion.path.x
        tilted = motion.attitude(times) * Rotation.from_euler("YX", [pitch, roll], degrees=True)
        path = CubicSpline(times, motion.path(times) + raised)
        return replace(scenario, motion=replace(motion, path=path, attitude=RotationSpline(times, tilted)))

    return changed


CONDITIONS: dict[str, Condition] = {
    "plain": Condition(),
    "phase errors of 10 deg": Condition(phase_errors(10.0)),
    "phase errors of 20 deg": Condition(phase_errors(20.0)),
    "gain errors of 1 dB": Condition(gain_errors),
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
