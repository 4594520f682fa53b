"""Moving plates, such as leaves of doors: they reflect, mirror and transmit like the same plates at rest.

Each plate is a scene of its own, at rest in its own frame. Its faces join the flat reflectors of every frame at their
position at the centre of the burst, and rays that it may obstruct are traced in its own frame. During the burst it
moves by a rigid motion G together with its images: an image of the receiver in a part of the plate, M, becomes G M
G^-1, and one over several mirrors the product of theirs.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from radarize.radar.config import RadarConfig
from radarsim.propagation.burst import NODES, BurstClock
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.transmission import Transmission
from radarsim.world.scene import Scene


class MovingPlates:
    """All moving plates of a scene.

    Args:
        moving: the movers.
        config: radar configuration.
        margin: distance from both ends at which rays start and end, m.
    """

    def __init__(self, moving: MovingTargets, config: RadarConfig, margin: float):
        self._moving, self._margin = moving, margin
        self._offsets = BurstClock.of(config).half * np.append(NODES, 0.0)
        objects = {k: each for k, part in enumerate(moving.parts) if (each := part.object)}
        self._part = np.array([*objects], int)
        scenes = [Scene("part", [each]) for each in objects.values()]
        self._reflectors = [Reflectors.of(scene, config) for scene in scenes]
        self._transmission = [Transmission(scene, config, margin) for scene in scenes]

    def __len__(self) -> int:
        return len(self._part)

    def _places(
        self, times: Float[np.ndarray, "n"]
    ) -> tuple[Float[np.ndarray, "n plate 3 3"], Float[np.ndarray, "n plate 3"]]:
        """Rotations and centres of the plates at some times, s."""
        # one time after another: sums over many at once have another order, and a frame must not depend on others
        poses = [self._moving.poses(np.array([t])) for t in times]
        turn, center = (np.concatenate(parts) for parts in zip(*poses, strict=True))
        return turn[:, self._part], center[:, self._part]

    def faces(self, observation: Observation) -> tuple[Flat, Flat]:
        """Faces of the plates in every frame, and the inner faces of hollow ones."""
        outer, inner = [Flat.zeros(0)], [Flat.zeros(0)]
        for frame, (turns, centers) in enumerate(zip(*self._places(observation.time), strict=True)):
            for plate, (turn, center, own) in enumerate(zip(turns, centers, self._reflectors, strict=True)):
                outer.append(_placed(own.flat, turn, center, plate, frame))
                inner.append(_placed(own.inner, turn, center, plate, frame))
        return Flat.joined(outer), Flat.joined(inner)

    def moves(self, observation: Observation) -> Float[np.ndarray, "frame plate 4 3 4"]:
        """Rigid motions from the centre of each burst to its three nodes, and to the centre itself.

        One more plate, the last, represents what is at rest.
        """
        out = np.tile(np.eye(3, 4), (observation.frames, len(self) + 1, 4, 1, 1))
        for frame, time in enumerate(observation.time if len(self) else ()):
            turn, center = self._places(time + self._offsets)
            rotation = np.einsum("npij,pkj->pnik", turn, turn[3])
            out[frame, :-1, :, :, :3] = rotation
            out[frame, :-1, :, :, 3] = center.transpose(1, 0, 2) - np.einsum("pnij,pj->pni", rotation, center[3])
        return out

    def passage(
        self, observation: Observation, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"], allowed: Bool[np.ndarray, "ray"],
    ) -> tuple[Complex[np.ndarray, "ray"], Float[np.ndarray, "ray"]]:  # fmt: skip
        """Factor on the amplitude of waves between points, and delay; see `Obstacles.passage`."""
        factor, delay = np.ones(len(frame), complex), np.zeros(len(frame))
        turns, centers = self._places(observation.time)
        for plate, (part, own) in enumerate(zip(self._part, self._transmission, strict=True)):
            hidden = self._moving.occluded(begin, end, observation.time[frame], self._margin, np.array([part]))
            factor[hidden & ~allowed] = 0
            met = np.flatnonzero(hidden & allowed)
            if len(met):
                turn, center = turns[frame[met], plate], centers[frame[met], plate]
                start, stop = (np.einsum("nij,ni->nj", turn, x[met] - center) for x in (begin, end))
                up = np.einsum("nij,ni->nj", turn, observation.rotation[frame[met], :, 2])
                passed, late = own.passage(start, stop, up)
                factor[met] *= passed
                delay[met] += late
        return factor, delay


def _placed(flat: Flat, turn: Float[np.ndarray, "3 3"], center: Float[np.ndarray, "3"], plate: int, frame: int) -> Flat:
    """Faces of a plate at its position in a frame."""
    n = len(flat)
    return replace(
        flat, corners=flat.corners @ turn.T + center, center=flat.center @ turn.T + center,
        normal=flat.normal @ turn.T, u=flat.u @ turn.T, v=flat.v @ turn.T, plate=np.full(n, plate),
        frame=np.full(n, frame),
    )  # fmt: skip
