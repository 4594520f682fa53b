"""Sensors that a simulated recording gets afterwards."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.recording import Recording, add
from radarsim.recording.batches import Batches
from radarsim.scenario import Scenario
from radarsim.sensors.suite import Suite

_SAME = 1e-6  # m, by which a motion that is planned anew may differ


def add_sensors(
    path: Path,
    scenario: Scenario,
    sensors: Sequence[str],
    attributes: Mapping[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Add what sensors would have measured to a recording that was made without them: the same values as if they had
    been there. Only those that look at the radar's echoes or samples have these simulated anew.

    Args:
        path: recording, replaced as a whole.
        scenario: that was recorded.
        sensors: names from `radarsim.sensors.suite.SENSORS`.
        attributes: of the file, to replace or add.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: the motion is not the recording's any more, or the disk is full.
    """
    with Recording(path) as recording:
        times = recording.times
        apart = recording.read("truth/pose")[:, :3] - scenario.motion.position(recording.read("truth/time"))
        if np.abs(apart).max() > _SAME:
            raise InputError(
                f"{path}: its tour differs by {np.abs(apart).max():.3g} m from what this version plans, expected the "
                "same; --replace makes it anew"
            )
    suite, batches, rows = Suite(scenario, sensors), Batches(scenario, times), []
    for first, last in batches.spans():
        rows.append(suite.observe(batches.frames(first, last), first))
        if progress:
            progress(last, len(times))
    joined = {name: np.concatenate([each[name] for each in rows]) for name in suite.streams}
    return add(path, suite.streams, joined, suite.products, attributes)
