"""How far odometry may be off between any two frames, where its errors know of each other.

Headings err by what filters say, and what is found out later is taken back: so a turn from one frame to another is off
by the difference of the errors at its ends, and not by the sum of what each step may be off, be they half a second
apart or a minute.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from radarize.io.pose import adjoint, between, compose, inverse

#: Share of a way by which it comes out too short or too long as a whole: by hand, where the sensor nods, it is 0.4 to
#: 0.5 % too short (chosen on the walks of `radarize.evaluation.benchmark.choices.CLAIMS`).
_SCALE = 0.004


@dataclass(frozen=True)
class Claims:
    """Of consecutive steps.

    An error e of the heading goes on as kept * e, and something new is added that makes its variance `held`.

    Attributes:
        noise: (frame, 3, 3) of each step, x, y (m) and yaw (rad) in the frame at its end: what nothing takes back.
        kept: (frame,) share of the error before that a step keeps.
        held: (frame,) rad^2, variance of the error after it; at the first of all frames it counts from none.
    """

    noise: Float[np.ndarray, "frame 3 3"]
    kept: Float[np.ndarray, "frame"]
    held: Float[np.ndarray, "frame"]

    @classmethod
    def independent(cls, covariance: Float[np.ndarray, "frame 3 3"]) -> "Claims":
        """Of steps that know nothing of each other."""
        return cls(covariance, np.ones(len(covariance)), np.zeros(len(covariance)))

    def turns(self, length: int) -> Float[np.ndarray, "window"]:
        """Variance of the turn over so many steps after every frame that has as many after it, rad^2."""
        first, last = slice(None, -length), slice(length, None)
        noise = np.cumsum(self.noise[:, 2, 2])
        kept = np.cumsum(np.log(np.maximum(self.kept, 1e-300)))
        shared = self.held[first] * np.exp(kept[last] - kept[first])
        return noise[last] - noise[first] + self.held[first] + self.held[last] - 2 * shared

    def motions(
        self, poses: Float[np.ndarray, "frame 3"], starts: Int[np.ndarray, "window"], length: int
    ) -> Float[np.ndarray, "window 3 3"]:
        """Covariance of the motions over so many steps after some frames, in the frame at their ends."""
        unknown = Unknown(self.held[starts])
        for k in (starts + i for i in range(1, length + 1)):
            unknown.step(between(poses[k - 1], poses[k]), self, k)
        return unknown.covariance


class Unknown:
    """What is not known of a motion, step by step; or of several side by side, along a leading axis.

    Args:
        held: rad^2, variance of the heading's error at the start.
    """

    def __init__(self, held: Float[np.ndarray, "*#window"] | float = 0.0):
        self._held = np.asarray(held, float)
        self._moved = np.zeros((*self._held.shape, 3))
        # Of the motion (x, y, yaw), in the frame at its end, and of the heading's error there.
        self._spread = np.zeros((*self._held.shape, 4, 4))
        self._spread[..., 3, 3] = self._held

    def step(
        self, motion: Float[np.ndarray, "*#window 3"], claims: Claims, frame: int | Int[np.ndarray, "window"]
    ) -> None:
        """Go on by the step to a frame of those that claims are of."""
        noise, kept, held = claims.noise[frame], claims.kept[frame], claims.held[frame]
        half, move = half_turned(motion), np.zeros_like(self._spread)
        move[..., :3, :3] = adjoint(inverse(motion))
        move[..., :3, 3] = half * (kept - 1)[..., None]
        move[..., 3, 3] = kept
        news = np.maximum(held - np.square(kept) * self._held, 0.0)
        both = np.concatenate([half, np.ones_like(half[..., :1])], axis=-1)
        self._spread = move @ self._spread @ move.mT
        self._spread += news[..., None, None] * both[..., :, None] * both[..., None, :]
        self._spread[..., :3, :3] += noise
        self._held, self._moved = held, compose(self._moved, motion)

    @property
    def covariance(self) -> Float[np.ndarray, "*#window 3 3"]:
        """Of (x, y, yaw), m and rad, in the frame at the end."""
        way = inverse(self._moved) * [1.0, 1.0, 0.0]
        return self._spread[..., :3, :3] + _SCALE**2 * way[..., :, None] * way[..., None, :]


def half_turned(motion: Float[np.ndarray, "*#window 3"]) -> Float[np.ndarray, "*#window 3"]:
    """By how much a motion is off, in the frame at its end, for each radian by which its turn is: who has turned by
    more than is thought has gone into another direction, too, by half as much."""
    x, y, _ = np.moveaxis(inverse(motion), -1, 0)
    return np.stack([y / 2, -x / 2, np.ones_like(x)], axis=-1)
