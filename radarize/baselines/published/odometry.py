"""Odometry of the published artefact."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.baselines.published.maps import PublishedStream
from radarize.io.pose import between, wrap
from radarize.io.stopwatch import stage
from radarize.learning.nets.weights import Network
from radarize.odometry.integration import Track
from radarize.odometry.uncertainty import ErrorModel
from radarize.signal.batch import Batch

#: Frames of 15 Hz over which changes of yaw are estimated: the number of interleaved chains of yaws.
CHAINS = 4


class PublishedOdometry:
    """Odometry at the frames that the artefact uses.

    Velocities are integrated by Euler's rule with the previous heading. Yaws form four interleaved chains, each
    integrating the network's changes of yaw over four frames.

    Args:
        stream: computes the maps.
        translation, rotation: trained networks.
        headings: true yaws of the first four frames that are used, from which the artefact's chains start, rad; zeros
            if None, because a radar cannot observe them.
    """

    def __init__(
        self,
        stream: PublishedStream,
        translation: Network,
        rotation: Network,
        headings: Float[np.ndarray, "4"] | None = None,
    ):
        self._stream, self._translation, self._rotation = stream, translation, rotation
        start = np.zeros(CHAINS) if headings is None else np.asarray(headings, float)
        self._start = wrap(start - start[0])
        self._past: list[tuple[float, np.ndarray, torch.Tensor]] = []  # of CHAINS used frames: time, pose, maps

    @torch.inference_mode()
    def update(self, batch: Batch) -> Track:
        """Estimate poses at those of the next frames that are used; there may be none."""
        used, made = self._stream.maps(batch)
        if not len(used):
            none = np.zeros((0, 3))
            return _track(np.zeros(0), none, none, np.zeros((0, 3, 3)), none[:, :2], np.zeros((0, 2, 2)))
        with stage("translation"):
            velocity, velocity_noise = self._translation.estimate(window(self._translation, made)[:, None])
        with stage("rotation"):
            seen = torch.stack([maps for _, _, maps in self._past] + list(window(self._rotation, made)))
            pairs = torch.stack([seen[:-CHAINS], seen[CHAINS:]], dim=1)
            turn, turn_noise = self._rotation.estimate(pairs) if len(pairs) else (torch.zeros(0, 1),) * 2
        return self._integrate(batch.centers[used], velocity, velocity_noise, turn, turn_noise, seen[-len(used) :])

    def _integrate(
        self,
        times: Float[np.ndarray, "used"],
        velocities: Float[torch.Tensor, "used 2"],
        velocity_noise: Float[torch.Tensor, "used 2 2"],
        turns: Float[torch.Tensor, "pair 1"],
        turn_noise: Float[torch.Tensor, "pair ..."],
        maps: Float[torch.Tensor, "used map row azimuth"],
    ) -> Track:
        """Integrate velocities since the previous frame and changes of yaw over four frames to poses."""
        velocity, turn = velocities.double().numpy(), turns[:, 0].double().numpy()
        poses, steps, spreads = np.zeros((len(times), 3)), np.zeros((len(times), 3)), np.zeros((len(times), 3, 3))
        late = len(times) - len(turn)  # frames of this batch without a frame four before them
        for i, time in enumerate(times):
            if i < late:
                poses[i, 2] = self._start[len(self._past)]
            else:
                poses[i, 2] = wrap(self._past[-CHAINS][1][2] + turn[i - late])
                spreads[i, 2, 2] = turn_noise[0, 0, 0]
            if self._past:
                last, before, _ = self._past[-1]
                dt, cos, sin = time - last, np.cos(before[2]), np.sin(before[2])
                poses[i, :2] = before[:2] + dt * np.array([[cos, -sin], [sin, cos]]) @ velocity[i]
                steps[i] = between(before, poses[i])
                spreads[i, :2, :2] = dt**2 * velocity_noise[0].numpy()
            self._past = [*self._past[-CHAINS + 1 :], (time, poses[i].copy(), maps[i])]
        return _track(times, poses, steps, spreads, velocity, velocity_noise.double().numpy())


def window(net: Network, made: dict[str, Float[np.ndarray, "frame row azimuth"]]) -> torch.Tensor:
    """Stack the maps that a network reads: (frame, map, row, azimuth)."""
    return torch.stack([torch.from_numpy(made[name]).float() for name in net.maps], dim=1)


def _track(
    times: Float[np.ndarray, "used"],
    poses: Float[np.ndarray, "used 3"],
    steps: Float[np.ndarray, "used 3"],
    spreads: Float[np.ndarray, "used 3 3"],
    velocity: Float[np.ndarray, "used 2"],
    velocity_spread: Float[np.ndarray, "used 2 2"],
) -> Track:
    """Make a track. As in the artefact, velocity and yaw rate always count as observed, and errors as independent."""
    velocity_seen, turn_seen = np.ones((2, len(times)), bool)
    errors = ErrorModel.independent(spreads)
    return Track(times, poses, steps, velocity, velocity_spread, velocity_seen, turn_seen, errors)
