"""Diffuse multipath: echoes that are scattered at two or more surfaces (`reverberation`)."""

import numpy as np

from radarsim.propagation.environment import View
from radarsim.propagation.paths import Kind, Paths
from radarsim.propagation.reverberation import echoes


def find(view: View) -> Paths:
    """Find visible echoes above the threshold, in both directions."""
    observation, detours = view.observation, view.environment.detours
    frame, which, amplitude = echoes(observation, detours)
    for ends in (detours.begin, detours.end):
        seen = view.obstacles.clear(observation, frame, observation.position[frame], ends[which])
        frame, which, amplitude = frame[seen], which[seen], amplitude[seen]
    here = observation.position[frame, None]
    away = np.stack([detours.begin[which], detours.end[which]], axis=1) - here
    # the walk between both ends shifts each away by half of it
    farther = 1 + detours.between[which, None, None] / 2 / np.linalg.norm(away, axis=2, keepdims=True)
    points, value = here + away * farther, amplitude * np.exp(1j * detours.phase[which])
    return Paths.of(
        Kind.POINT, np.concatenate([points, points[:, ::-1]]), np.tile(value, 2), frame=np.tile(frame, 2), bounces=1
    )
