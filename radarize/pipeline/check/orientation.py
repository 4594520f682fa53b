"""Faults in motion and orientation of the radar: no motion, upside down, mirrored, backwards.

A mirrored world is consistent too: exchanging left and right, or up and down, keeps Doppler, range and phases as
consistent as they were. Only other sensors of motion show it: true poses, a gyroscope, and gravity in an accelerometer.
"""

from collections.abc import Iterator

import numpy as np

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig

#: Share of moving echoes below which the radar stands still; Doppler bins from which on an echo moves.
_MOVING, _BINS = 0.25, 0.75
#: m/s, m/s, rad/s: minimum of motion forward or sideways, of motion upward, and of yaw rate for a comparison.
_FAST, _BOBS, _TURNS = 0.15, 0.05, 0.12
#: Minimum number of compared values, and share of them whose signs agree.
_PLACES, _SURE = 3, 0.8
#: m/s^2 of gravity along the radar's upward axis.
_UPRIGHT = 5.0


def standing(evidence: Evidence) -> Iterator[Finding]:
    """Find recordings in which most echoes do not move."""
    cells = evidence.cells
    if not len(cells.speed):
        raise NotObservable("no echo was found")
    moving = float((np.abs(cells.speed) > _BINS * evidence.config.velocity_resolution).mean())
    if moving < _MOVING:
        yield Finding(
            "no motion", f"{moving:.0%} of {len(cells.speed)} echoes move", sureness(_MOVING / max(moving, 0.01), 1.0),
            "walk with the radar: without motion, its array and chirps cannot be checked", hides=False,
        )  # fmt: skip


def upside_down(evidence: Evidence) -> Iterator[Finding]:
    """Find a radar whose upper side faces down, by gravity."""
    if evidence.imu is None:
        raise NotObservable("there is no IMU to measure gravity, and floor and ceiling echoes cannot be distinguished")
    up = float(np.median(evidence.imu.samples[:, 2]))
    if up < -_UPRIGHT:
        yield Finding(
            "upside down", f"the accelerometer reads {up:.1f} m/s^2 along the radar's upward axis",
            sureness(-up, _UPRIGHT),
            "turn the radar, or use a board file with left and up of its antennas negated (--board)",
            Correction(_turned(evidence.config, -1, -1)),
        )  # fmt: skip


def mirrored(evidence: Evidence) -> Iterator[Finding]:
    """Find turns and sideways motion of opposite sign to those of an IMU or true poses."""
    motions, pairs = evidence.motions, []
    if evidence.imu is not None:
        near = np.searchsorted(evidence.imu.time, motions.time).clip(max=len(evidence.imu.time) - 1)
        pairs += _pairs(motions.turn, evidence.imu.samples[near, 5], _TURNS)
    if evidence.truth is not None:
        velocity, turn = true_motion(evidence, motions.time)
        pairs += _pairs(motions.turn, turn, _TURNS) + _pairs(motions.velocity[:, 1], velocity[:, 1], _FAST)
    if evidence.imu is None and evidence.truth is None:
        raise NotObservable("there is neither an IMU nor true poses to compare left and right with")
    opposite = _opposite(pairs, "the radar hardly turns or moves sideways")
    if opposite > _SURE:
        yield Finding(
            "azimuth mirrored", f"{opposite:.0%} of {len(pairs)} turns and sideways motions have the opposite sign of "
            f"{'the IMU' if evidence.truth is None else 'the true poses'}", opposite,
            "use a board file with left of its antennas negated (--board)", Correction(_turned(evidence.config, -1, 1)),
        )  # fmt: skip


def elevation_mirrored(evidence: Evidence) -> Iterator[Finding]:
    """Find vertical motion of opposite sign to that of true poses."""
    if evidence.truth is None:
        raise NotObservable("there are no true poses to compare up and down with")
    pairs = _along(evidence, 2, _BOBS)
    opposite = _opposite(pairs, "the radar hardly moves up and down")
    if opposite > _SURE:
        yield Finding(
            "elevation mirrored", f"{opposite:.0%} of {len(pairs)} motions are downward where true poses go upward",
            opposite, "use a board file with up of its antennas negated (--board)",
            Correction(_turned(evidence.config, 1, -1)),
        )  # fmt: skip


def backwards(evidence: Evidence) -> Iterator[Finding]:
    """Find forward motion of opposite sign to that of true poses."""
    if evidence.truth is None:
        raise NotObservable("there are no true poses to compare the direction of travel with")
    pairs = _along(evidence, 0, _FAST)
    opposite = _opposite(pairs, "the radar hardly moves forward or backward")
    if opposite > _SURE:
        yield Finding(
            "facing backwards", f"{opposite:.0%} of {len(pairs)} motions are backward where true poses move forward",
            opposite, "turn the radar, or turn the poses by 180 degrees (--poses)",
        )  # fmt: skip


def true_motion(evidence: Evidence, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity (m/s, sensor frame) and yaw rate (rad/s) of the truth."""
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
    """Return `_pairs` of the radar's and the true velocity along an axis."""
    motions = evidence.motions
    return _pairs(motions.velocity[:, axis], true_motion(evidence, motions.time)[0][:, axis], least)


def _pairs(one: np.ndarray, other: np.ndarray, least: float) -> list[bool]:
    """Return, for values that are both large enough, whether their signs are opposite."""
    large = (np.abs(one) > least) & (np.abs(other) > least)
    return list(np.sign(one[large]) != np.sign(other[large]))


def _opposite(pairs: list[bool], why: str) -> float:
    """Return the share of pairs of opposite signs.

    Raises:
        NotObservable: there are too few.
    """
    if len(pairs) < _PLACES:
        raise NotObservable(why)
    return float(np.mean(pairs))


def _turned(config: RadarConfig, left: int, up: int) -> RadarConfig:
    """Return the configuration with a board whose antennas have left or up negated where the factor is -1."""
    board = load_board(config.board)
    places = {name: tuple((left * y, up * z) for y, z in getattr(board, name)) for name in ("tx", "rx")}
    name = board.name + ("-turned" if up < 0 else "-mirrored")
    return config.model_copy(update={"board": board.model_copy(update={"name": name, **places})})
