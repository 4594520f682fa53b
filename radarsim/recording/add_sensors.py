"""Sensors added to an existing simulated recording."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.recording import Recording, add
from radarsim.recording.batches import Batches
from radarsim.scenario import Scenario
from radarsim.sensors.suite import Suite

_SAME = 1e-6  # m, tolerance of a motion that is planned again


def add_sensors(
    path: Path,
    scenario: Scenario,
    sensors: Sequence[str],
    attributes: Mapping[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Add sensors to a recording, with the values that they would have had from the start. Radar echoes or samples are
    simulated again only for sensors that use them.

    Args:
        path: recording; replaced by a new file.
        scenario: scenario of the recording.
        sensors: names from `radarsim.sensors.suite.SENSORS`.
        attributes: attributes of the file to replace or add.
        progress: called with (frames done, total frames).

    Raises:
        InputError: the motion differs from the recording's, or the disk is full.
    """
    with Recording(path) as recording:
        times = recording.times
        apart = recording.read("truth/pose")[:, :3] - scenario.motion.position(recording.read("truth/time"))
        if np.abs(apart).max() > _SAME:
            raise InputError(
                f"{path}: its tour differs by {np.abs(apart).max():.3g} m from what this version plans, expected the "
                "same; --replace makes the recording again"
            )
    suite, batches, rows = Suite(scenario, sensors), Batches(scenario, times), []
    for first, last in batches.spans():
        rows.append(suite.observe(batches.frames(first, last), first))
        if progress:
            progress(last, len(times))
    joined = {name: np.concatenate([each[name] for each in rows]) for name in suite.streams}
    return add(path, suite.streams, joined, suite.products, attributes)
