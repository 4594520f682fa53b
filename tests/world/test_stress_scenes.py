"""Places of the multipath stress test have their effect, and more of it at every level."""

from collections.abc import Callable

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.dataset.specification import Specification
from radarsim.motion.statistics import crossings
from radarsim.motion.walk import Walk
from radarsim.propagation.path_types import PathType
from radarsim.scenario import Scenario
from radarsim.sensors.by_path_type import PARTS
from radarsim.sensors.ghosts import DEPTH, NOISE, Ghosts
from radarsim.sensors.scan import PlanarScan
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
TASKS = Specification.load("stress").tasks


def caused_by(*causes: PathType) -> Callable[[dict[str, np.ndarray], np.ndarray], float]:
    """Fraction of the cells above the noise with these path types."""

    def share(seen: dict[str, np.ndarray], true: np.ndarray) -> float:
        cause = seen["truth/cause"]
        heard = (cause != NOISE) & (cause != PARTS.index("leakage"))
        return float(np.isin(cause, causes)[heard].mean())

    return share


def before_the_surface(seen: dict[str, np.ndarray], true: np.ndarray) -> float:
    """Fraction of the cells in front of the first surface that are 20 dB above the noise."""
    power = 10 ** (seen["truth/cause_power"].astype(float) / 10)
    noise = power.min() * 10 ** (DEPTH / 10)  # kept no lower than so far below it
    ranges = CONFIG.ranges[:, None]
    front = (ranges > 0.4) & (ranges < true[:, None] - 0.15)
    return float((power.sum(axis=1) > 100 * noise)[front].mean())


#: What rises with the level, and by how much at least from `FIRST` to level 3. The ladder starts from rooms with some
#: clutter: diffuse multipath makes ghosts, too, and at level 1 it drowns those of the place.
EXPECTED = {
    "corner": (caused_by(PathType.GHOST), 0.15),
    "cul-de-sac": (caused_by(PathType.GHOST), 0.08),
    "glass-corridor": (caused_by(PathType.GHOST, PathType.THROUGH_SLAB), 0.1),
    "mirror-cabinet": (caused_by(PathType.GHOST), 0.1),
    "overhead": (before_the_surface, 0.05),
    "shelves": (caused_by(PathType.GHOST), 0.1),
    "people": (caused_by(PathType.MOVING), 0.06),
}


#: Level from which on each is worse than the one before, where it is not the mildest: open shelves of wood break up the
#: mirrors that walls are, and a few fittings under a ceiling hide about as much as they echo.
FIRST = {"shelves": 1, "overhead": 1}


@pytest.mark.parametrize("place", EXPECTED)
def test_every_level_is_worse_than_the_one_before(place):
    tasks = [task for task in TASKS if task.building == place]
    measure, least = EXPECTED[place]
    found, motion = [], None
    for task in tasks:
        scene = Scene.load(task.scene)
        if motion is None:
            walk = np.array(task.waypoints)
            motion = Walk(task.platform, waypoints=walk).through(scene, task.seed)
            assert motion.duration >= task.duration
        assert not crossings(motion.until(task.duration), scene)
        scenario = Scenario(scene, motion, CONFIG, seed=task.seed)
        frames = scenario.frames(np.arange(1.0, 14.0, 4.0))
        seen, true = Ghosts(scenario).observe(frames), PlanarScan(scenario).observe(frames)
        found.append(measure(seen, true["truth/scan"]))
    assert len(found) == 4
    found = found[FIRST.get(place, 0) :]
    assert np.all(np.diff(found) > 0) and found[-1] - found[0] > least, found
