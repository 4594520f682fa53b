"""Faults of the motion, and of which way the radar looks: standing still, upside down, mirrored, backwards.

A mirrored world is a world: left and right, up and down exchanged leave Doppler, range and phases as consistent as they
were. Only what else knows of the motion can tell: true poses, an IMU's gyroscope, and gravity in its accelerometer.
"""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig

#: Share of echoes that move, below which the radar stands; bins of Doppler beyond which one moves.
_MOVING, _BINS = 0.25, 0.75
#: m/s, m/s and rad/s: what motion forward or sideways, upward, and turns must be by both to be compared.
_FAST, _BOBS, _TURNS = 0.15, 0.05, 0.12
#: Places that are needed, and share of them whose signs agree.
_PLACES, _SURE = 3, 0.8
#: m/s^2 of gravity along the radar's upward axis.
_UPRIGHT = 5.0


def standing(evidence: Evidence) -> Iterator[Finding]:
    """Most echoes stand still."""
    cells = evidence.cells
    if not len(cells.speed):
        raise NotObservable("no echo is seen")
    moving = float((np.abs(cells.speed) > _BINS * evidence.config.velocity_resolution).mean())
    if moving < _MOVING:
        yield Finding(
            "no motion", f"{moving:.0%} of {len(cells.speed)} echoes move", sureness(_MOVING / max(moving, 0.01), 1.0),
            "walk with the radar, or mind that nothing about its motion, array and chirps can be checked", hides=False,
        )  # fmt: skip


def upside_down(evidence: Evidence) -> Iterator[Finding]:
    """Gravity pulls towards the radar's upper side."""
    if evidence.imu is None:
        raise NotObservable("there is no IMU that knows where gravity pulls; floors and ceilings look alike")
    up = float(np.median(evidence.imu.samples[:, 2]))
    if up < -_UPRIGHT:
        yield Finding(
            "upside down", f"the accelerometer reads {up:.1f} m/s^2 along the radar's upward axis",
            sureness(-up, _UPRIGHT),
            "turn the radar, or take a board file whose antennas have left and up negated (--board)",
            Correction(_turned(evidence.config, -1, -1)),
        )  # fmt: skip


def mirrored(evidence: Evidence) -> Iterator[Finding]:
    """Turns and sideways motion are to the other side than an IMU or true poses have them."""
    motions, pairs = evidence.motions, []
    if evidence.imu is not None:
        near = np.searchsorted(evidence.imu.time, motions.time).clip(max=len(evidence.imu.time) - 1)
        pairs += _pairs(motions.turn, evidence.imu.samples[near, 5], _TURNS)
    if evidence.truth is not None:
        velocity, turn = true_motion(evidence, motions.time)
        pairs += _pairs(motions.turn, turn, _TURNS) + _pairs(motions.velocity[:, 1], velocity[:, 1], _FAST)
    if evidence.imu is None and evidence.truth is None:
        raise NotObservable("neither an IMU nor true poses know left from right")
    opposite = _opposite(pairs, "the radar hardly turns or moves sideways")
    if opposite > _SURE:
        yield Finding(
            "azimuth mirrored", f"{opposite:.0%} of {len(pairs)} turns and sideways motions are to the other side than "
            f"{'an IMU' if evidence.truth is None else 'true poses'} have them", opposite,
            "take a board file whose antennas have left negated (--board)", Correction(_turned(evidence.config, -1, 1)),
        )  # fmt: skip


def elevation_mirrored(evidence: Evidence) -> Iterator[Finding]:
    """The radar bobs down where true poses go up."""
    if evidence.truth is None:
        raise NotObservable("no true poses know up from down; floors and ceilings look alike")
    pairs = _along(evidence, 2, _BOBS)
    opposite = _opposite(pairs, "the radar hardly moves up and down")
    if opposite > _SURE:
        yield Finding(
            "elevation mirrored", f"{opposite:.0%} of {len(pairs)} motions are downward where true poses go upward",
            opposite, "take a board file whose antennas have up negated (--board)",
            Correction(_turned(evidence.config, 1, -1)),
        )  # fmt: skip


def backwards(evidence: Evidence) -> Iterator[Finding]:
    """The radar moves backward where true poses move forward."""
    if evidence.truth is None:
        raise NotObservable("no true poses know the direction of travel")
    pairs = _along(evidence, 0, _FAST)
    opposite = _opposite(pairs, "the radar hardly moves forward or backward")
    if opposite > _SURE:
        yield Finding(
            "facing backwards", f"{opposite:.0%} of {len(pairs)} motions are backward where true poses move forward",
            opposite, "turn the radar, or turn the poses by 180 degrees (--poses)",
        )  # fmt: skip


def true_motion(evidence: Evidence, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity (m/s, in the sensor's frame) and turn (rad/s) of the truth."""
    from scipy.spatial.transform import Rotation

    truth = evidence.truth
    assert truth is not None
    unknown = np.full((len(time), 3), np.nan), np.full(len(time), np.nan)
    if len(truth.time) < 3:
        return unknown
    middle = np.searchsorted(truth.time, time).clip(1, len(truth.time) - 2)
    before, after = middle - 1, middle + 1
    passed = (truth.time[after] - truth.time[before])[:, None]
    attitude = Rotation.from_quat(truth.pose[:, 3:])
    velocity = attitude[middle].inv().apply((truth.pose[after, :3] - truth.pose[before, :3]) / passed)
    turn = (attitude[before].inv() * attitude[after]).as_rotvec()[:, 2] / passed[:, 0]
    far = np.abs(truth.time[middle] - time) > 0.2
    velocity[far], turn[far] = np.nan, np.nan
    return velocity, turn


def _along(evidence: Evidence, axis: int, least: float) -> list[bool]:
    """`_pairs` of the radar's velocity along an axis and the truth's."""
    motions = evidence.motions
    return _pairs(motions.velocity[:, axis], true_motion(evidence, motions.time)[0][:, axis], least)


def _pairs(one: np.ndarray, other: np.ndarray, least: float) -> list[bool]:
    """Of values that are both large enough: whether they have opposite signs."""
    large = (np.abs(one) > least) & (np.abs(other) > least)
    return list(np.sign(one[large]) != np.sign(other[large]))


def _opposite(pairs: list[bool], why: str) -> float:
    """Share of pairs of opposite signs.

    Raises:
        NotObservable: there are too few.
    """
    if len(pairs) < _PLACES:
        raise NotObservable(why)
    return float(np.mean(pairs))


def _turned(config: RadarConfig, left: int, up: int) -> RadarConfig:
    """With a board whose antennas have left and up negated where a factor is -1."""
    board = load_board(config.board)
    places = {name: tuple((left * y, up * z) for y, z in getattr(board, name)) for name in ("tx", "rx")}
    name = board.name + ("-turned" if up < 0 else "-mirrored")
    return config.model_copy(update={"board": board.model_copy(update={"name": name, **places})})
