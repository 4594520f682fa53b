"""Loop closure: where has this node been seen before?"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from radarize.pose import between, transform
from radarize.slam.config import LoopConfig
from radarize.slam.correlation import search
from radarize.slam.matcher import Match, match
from radarize.slam.node import Node
from radarize.slam.submap import Submap


@dataclass(frozen=True)
class Closure:
    """A node found in a submap.

    Attributes:
        anchor, node: numbers of the submap's anchor and of the node.
        pose: of the node in the anchor's frame.
        covariance: of the pose for (x, y, yaw) in the node's frame.
        score: mean probability at the node's points.
    """

    anchor: int
    node: int
    pose: Float[np.ndarray, "3"]
    covariance: Float[np.ndarray, "3 3"]
    score: float


def candidates(number: int, submaps: list[Submap], poses: list[np.ndarray], config: LoopConfig) -> list[Submap]:
    """Finished submaps near to a node that it is not part of, nearest first."""
    found = []
    for submap in submaps:
        if submap.finished and not submap.nodes[0] <= number <= submap.nodes[-1]:
            center = transform(poses[submap.anchor], submap.center[None])[0]
            distance = float(np.hypot(*(center - poses[number][:2])))
            if distance <= config.radius:
                found.append((distance, submap.anchor, submap))
    return [submap for *_, submap in sorted(found, key=lambda f: f[:2])]


def close(
    number: int,
    node: Node,
    submap: Submap,
    guess: Float[np.ndarray, "3"],
    config: LoopConfig,
    *,
    distance: float,
    angle: float,
) -> Closure | None:
    """Search a node in a submap around a guess (in the anchor's frame), refine, and check the result again."""
    found = search(submap.pyramid, node.points, guess, distance=distance, angle=angle, min_score=config.min_score)
    if found is None:
        return None
    pose, score = found
    refined = match(submap.grid, node.points, pose, sigma=config.sigma)
    moved = np.abs(between(pose, refined.pose))
    if max(moved[0], moved[1]) > 4 * submap.grid.resolution or moved[2] > 0.1:
        return None  # the peak of the search is no minimum of the refinement: not a place that fits
    covariance = uncertainty(refined, config.translation_floor, config.rotation_floor)
    return Closure(submap.anchor, number, refined.pose, covariance, score)


def uncertainty(result: Match, translation: float, rotation: float) -> Float[np.ndarray, "3 3"]:
    """Covariance of a match: the inverse of its information, with floors (m, rad); 10 m and 1 rad where blind."""
    blind = np.diag([1e-2, 1e-2, 1.0])
    return np.linalg.inv(result.information + blind) + np.diag([translation, translation, rotation]) ** 2
