"""Pedestrians who walk to and fro near the radar's path without colliding with it."""

import numpy as np

from radarize.io.errors import InputError
from radarsim.machine.rng import keyed_rng
from radarsim.motion.tour import Ground
from radarsim.motion.trajectory import Motion
from radarsim.world.clearance import LOWEST, Clearance, ground_level
from radarsim.world.movers import Person
from radarsim.world.scene import Scene

#: Clearance of a person, m; smallest and largest distance at which a person passes the radar, m.
_ROOM, _MET, _APART = 0.3, 3.0, 0.6
#: Distance from the radar's path at which a person starts, and length of the person's path, m.
_NEAR, _WAY = (0.8, 3.5), (1.5, 5.0)
_ATTEMPTS = 60


def with_pedestrians(scene: Scene, motion: Motion, count: int, seed: int) -> Scene:
    """Return a scene with pedestrians added.

    Args:
        scene: scene with free floor.
        motion: motion of the radar; people keep a distance of 0.6 m.
        count: number of people; each comes within 3 m of the radar once.
        seed: seed of their paths, speeds and heights.

    Raises:
        InputError: not enough free floor, or none away from the radar's path.
    """
    if not count:
        return scene
    floor, times = ground_level(scene), np.arange(0.0, motion.duration, 0.1)
    ground, radar = Ground.of(Clearance.of(scene, LOWEST, 1.8), _ROOM), motion.position(times)[:, :2]
    people: list[Person] = []
    rng = keyed_rng(seed, "people")
    for attempt in range(_ATTEMPTS * count):
        if len(people) == count:
            break
        path = _way(ground, radar[rng.integers(len(radar))], rng)
        speed, height = rng.uniform(0.5, 1.6), rng.normal(1.72, 0.08)
        if path is None:
            continue
        someone = Person(name=f"passer-by {attempt}", path=path, speed=speed, height=height, floor=floor)
        place = someone.poses(times)[1][:, 0, :2]
        if _APART <= np.linalg.norm(place - radar, axis=1).min() < _MET:
            people.append(someone)
    if len(people) < count:
        raise InputError(
            f"scene {scene.name}: has room for {len(people)} people beside the radar's path, expected {count}"
        )
    return Scene(scene.name, scene.objects, [*scene.movers, *people], scene.surface_settings, scene.interferers)


def _way(ground: Ground, place: np.ndarray, rng: np.random.Generator) -> tuple[tuple[float, float], ...] | None:
    """Path from a random point near a place to another one, in the same or a neighbouring room; None if there is
    none."""
    apart = np.linalg.norm(ground.points - place, axis=1)
    reached = np.isfinite(ground.search(int(apart.argmin()), limit=2 * _NEAR[1])[0])
    starts = np.flatnonzero(reached & (apart > _NEAR[0]) & (apart < _NEAR[1]))
    if not len(starts):
        return None
    start = int(rng.choice(starts))
    cost, before = ground.search(start, limit=2 * _WAY[1])
    length = np.linalg.norm(ground.points - ground.points[start], axis=1)
    ends = np.flatnonzero(np.isfinite(cost) & (length > _WAY[0]) & (length < _WAY[1]))
    if not len(ends):
        return None
    nodes = ground.way(before, int(rng.choice(ends)))
    return tuple((float(x), float(y)) for x, y in ground.points[nodes[:: max(1, len(nodes) // 12)]])
