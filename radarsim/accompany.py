"""Sensors that a simulated recording gets afterwards: they need its motion and scene, but no echo."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.recording import Recording, add
from radarsim.physics.frontend import FrontEnd
from radarsim.planner import plan_motion
from radarsim.scene.scene import Scene
from radarsim.sensors.sensor import Frames, Rig
from radarsim.sensors.sight import Sight
from radarsim.sensors.suite import SENSORS
from radarsim.simulate import BATCH

_SAME = 1e-6  # m, by which a motion that is planned anew may differ


def accompany(
    path: Path,
    scene: Scene,
    *,
    platform: str,
    duration: float,
    seed: int,
    sensors: Sequence[str],
    attributes: Mapping[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Add what sensors would have measured to a recording that `simulate` made of a planned tour without them: the same
    values as if they had been there.

    Args:
        path: recording, replaced as a whole.
        scene, platform, duration, seed: as they were.
        sensors: names of `SENSORS`, none of which needs the radar.
        attributes: of the file, to replace or add.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: the tour is not the recording's any more, or the disk is full.
    """
    route, _ = np.random.default_rng(seed).spawn(2)
    motion = plan_motion(scene, platform, duration, route).until(duration)
    with Recording(path) as recording:
        config, times = recording.config, recording.times
        apart = np.abs(motion.position(recording.read("truth/time")) - recording.read("truth/pose")[:, :3]).max()
        if apart > _SAME:
            raise InputError(
                f"{path}: its tour differs by {apart:.3g} m from what this version plans, expected the same; "
                "--replace makes it anew"
            )
    rig = Rig(scene, motion, config, FrontEnd(config), Sight(scene))
    for name in sensors:
        sensor = SENSORS[name](rig, np.random.default_rng([seed, zlib.crc32(name.encode())]))
        rows = []
        for first in range(0, len(times), BATCH):  # as then: sensors draw their noise batch by batch
            rows.append(sensor.observe(Frames(times[first : first + BATCH], None, [], [], [])))
            if progress:
                progress(min(first + BATCH, len(times)), len(times))
        joined = {name: np.concatenate([each[name] for each in rows]) for name in sensor.streams}
        add(path, sensor.streams, joined, sensor.products, attributes)
    return path
