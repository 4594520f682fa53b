"""Simulation of a recording: frames are written to a file as they are computed; an interrupted run can be resumed."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite.binding import get_host_cpu_name

from radarize import __version__
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, spare
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits
from radarize.radar.presets import load_config
from radarsim.motion.pedestrians import with_pedestrians
from radarsim.motion.statistics import Statistics, crossings
from radarsim.motion.walk import Walk
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.recording.batches import Batch, Batches
from radarsim.scenario import Scenario
from radarsim.sensors.suite import chosen
from radarsim.world.scene import Scene


def simulate(
    scene: str | Path | Scene,
    output: Path,
    *,
    workers: int | None = 1,
    progress: Callable[[int, int], None] | None = None,
    **plan: Any,
) -> Path:
    """Simulate a recording.

    Args:
        scene: a scene, its YAML file, or the name of a scene of the project.
        output: recording to write.
        workers: number of processes that compute frames, 16 at a time; 1: this process only; None: one per core, fewer
            where starting them would take longer than they save. A script that uses more than 1 needs an ``if __name__
            == "__main__"``, as always with multiprocessing.
        progress: called with (frames done, total frames).
        plan: options of the simulation, the arguments of `planned`: seed, radar, frontend, sensors, platform, duration,
            trajectory, waypoints, mounting, people.

    Returns:
        Path of the recording.

    Raises:
        InputError: unusable scene, configuration, trajectory, way-points, sensor or output.
    """
    scenario, cfg_text, about = planned(scene, **plan)
    return record(Batches.of(scenario), output, cfg_text=cfg_text, attributes=about, workers=workers, progress=progress)


def planned(
    scene: str | Path | Scene,
    *,
    seed: int = 0,
    radar: str | RadarConfig = "radarize",
    frontend: Path | FrontEndConfig | None = None,
    sensors: Sequence[str] = (),
    people: int = 0,
    walk_in: Scene | None = None,
    **walk: Any,
) -> tuple[Scenario, str, dict[str, object]]:
    """Build the scenario of a simulation.

    Args:
        scene: see `simulate`.
        seed: seed of the tour, the scatterers and the noise.
        radar: preset, configuration file or configuration.
        frontend: front end or its file (see `FrontEndConfig`; `calibrate` writes them); default: the board's own.
        sensors: sensors beside the radar: names from `radarsim.sensors.suite.SENSORS`, or ``all``. They do not affect
            the radar's samples.
        people: number of pedestrians near the radar's path (see `with_pedestrians`).
        walk_in: scene in which the walk is planned; default: `scene`.
        walk: path of the radar, by the fields of `Walk`: platform, duration, trajectory, waypoints, mounting.

    Returns:
        The scenario, the radar's original configuration text, and attributes of the recording in addition to `facts`.

    Raises:
        InputError: unusable scene, configuration, trajectory, way-points or sensor.
    """
    config, cfg_text = load_config(radar)
    check_limits(config)
    way, names = Walk(**walk), tuple(chosen(sensors))
    settings = FrontEndConfig.load(frontend, config.board) if isinstance(frontend, (str, Path)) else frontend
    world = scene if isinstance(scene, Scene) else Scene.load(scene)
    motion = way.through(walk_in or world, seed)
    world = with_pedestrians(world, motion, people, seed)
    scenario = Scenario(world, motion, config, settings, seed, names)
    about: dict[str, object] = {"platform": "trajectory" if way.trajectory is not None else way.platform}
    if unreached := way.unreached(motion):
        about["warnings"] = "; ".join(filter(None, (unreached, crossings(motion, world))))
    return scenario, cfg_text, about | ({"people": people} if people else {})


def record(
    batches: Batches,
    output: Path,
    *,
    cfg_text: str = "",
    attributes: Mapping[str, object] | None = None,
    workers: int | None = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a recording of a scenario; a partial recording of an interrupted run of the same scenario is continued.

    Args:
        batches: frames to record.
        output: recording to write.
        cfg_text: original configuration text.
        attributes: attributes of the file, in addition to or instead of `facts`.
        workers: see `simulate`; the bytes do not depend on it.
        progress: called with (frames done, total frames).

    Returns:
        Path of the recording.

    Raises:
        InputError: the motion is shorter than a frame, none of its frames has an echo, the recording cannot be
            written, or a process died.
    """
    spare(Path(output))
    scenario, times, suite = batches.scenario, batches.times, batches.suite
    about = facts(scenario) | dict(attributes or {})
    with (
        _left_over(Path(output)) as found,
        RecordingWriter(
            output, scenario.config, cfg_text=cfg_text, attributes=about, products=suite.products, streams=suite.streams
        ) as writer,
    ):
        begun = found if found is not None and _fits(found, batches, about) else None
        spans = batches.spans()
        kept = [span for span in spans if begun is not None and span[1] <= len(begun)]
        taken = (Batch(begun.adc(*s), {n: begun.rows(n, *s) for n in suite.streams}) for s in kept) if begun else ()
        made = batches.each(spans[len(kept) :], workers)
        for (first, last), batch in zip(spans, chain(taken, made), strict=True):
            arrived = None if batches.valid is None else batches.valid[first:last]
            writer.append(batch.samples, times[first:last] + batches.start, arrived, rows=batch.rows)
            if progress:
                progress(last, len(times))
    return Path(output)


def facts(scenario: Scenario) -> dict[str, object]:
    """Attributes of a recording that describe its scenario. A recording is reproduced bit for bit on the same kind of
    processor; on another one, compiled loops sum in another order."""
    others = [each.model_dump(mode="json") for each in scenario.scene.interferers]
    return {
        "source": "radarsim simulate",
        "scene": scenario.scene.name,
        "seed": scenario.seed,
        "radarsim_version": __version__,
        "engine": "radarsim",
        "front_end": scenario.board.settings.model_dump_json(),
        "motion": Statistics.of(scenario.motion, scenario.scene).json(),
        "warnings": crossings(scenario.motion, scenario.scene),
        "processor": get_host_cpu_name(),
    } | ({"interferers": json.dumps(others)} if others else {})


@contextmanager
def _left_over(output: Path) -> Iterator[Recording | None]:
    """Partial recording of an interrupted run, kept beside the output until it is whole; None if there is none."""
    part, kept = (output.with_name(output.name + suffix) for suffix in (".part", ".begun"))
    if _length(part) > _length(kept):
        part.replace(kept)
    if not _length(kept):
        yield None
    else:
        with Recording(kept) as recording:
            yield recording
    kept.unlink(missing_ok=True)


def _length(path: Path) -> int:
    """Number of whole frames in a recording; 0 if it does not exist."""
    try:
        with Recording(path) as recording:
            return len(recording)
    except InputError:
        return 0


def _fits(begun: Recording, batches: Batches, about: Mapping) -> bool:
    """Whether a partial recording is the start of the requested one; two of its frames are computed to compare."""
    count = len(begun)
    return (
        begun.config == batches.scenario.config
        and about.items() <= begun.attributes.items()
        and np.array_equal(begun.times, (batches.times + batches.start)[:count])
        and all(map(begun.has, batches.suite.streams))
        and all(np.array_equal(begun.adc(k, k + 1), batches.made(k, k + 1).samples) for k in (0, count - 1))
    )
