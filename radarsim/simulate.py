"""Recordings of scenarios: frame after frame to a file, and on from where a killed run stopped."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int16
from llvmlite.binding import get_host_cpu_name

from radarize import __version__
from radarize.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits
from radarize.radar.presets import load_config
from radarize.recording import Recording, RecordingWriter, spare
from radarsim.physics.frontend_config import FrontEndConfig
from radarsim.scenario import Scenario
from radarsim.scene.scene import Scene
from radarsim.sensors.suite import Suite, chosen
from radarsim.statistics import Statistics, crossings
from radarsim.walk import Walk

#: Frames that are made together, which is quicker: ray tests and loops over scatterers go well in large numbers.
TOGETHER = 16


def simulate(
    scene: str | Path | Scene,
    output: Path,
    *,
    seed: int = 0,
    radar: str | RadarConfig = "radarize",
    frontend: Path | FrontEndConfig | None = None,
    engine: str = "radarsim",
    sensors: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
    **walk: object,
) -> Path:
    """Simulate a recording.

    Args:
        scene: a scene, its YAML file, or the name of one that comes with the project.
        output: recording to write.
        seed: of the tour, the scatterers and the noise.
        radar: preset, configuration file or configuration.
        frontend: front end or file of one (see `FrontEndConfig`; `calibrate` writes them); default: an IWR1843BOOST's.
        engine: ``radarsim``, or ``sionna``: the paths of Sionna RT's own solver, for comparison. Its known defects
            stand at the head of `physics.pathsolver`: corners, small facets and half of the ghosts are wrong, and
            speckle is drawn anew for every frame.
        sensors: that accompany the radar: names from `radarsim.sensors.suite.SENSORS`, or ``all``. The radar's samples
            are the same whatever is chosen.
        progress: called with (frames done, frames in all).
        walk: how the radar goes, by the fields of `Walk`: platform, duration, trajectory, waypoints, mounting.

    Returns:
        the path written.

    Raises:
        InputError: unusable scene, configuration, trajectory, way-points, sensor or output.
    """
    config, cfg_text = load_config(radar)
    check_limits(config)
    way, names = Walk(**walk), tuple(chosen(sensors))
    settings = FrontEndConfig.load(frontend) if isinstance(frontend, (str, Path)) else frontend or FrontEndConfig()
    world = scene if isinstance(scene, Scene) else Scene.load(scene)
    scenario = Scenario(world, way.through(world, seed), config, settings, seed, names, engine)
    about = {"platform": "trajectory" if way.trajectory is not None else way.platform}
    return record(scenario, output, cfg_text=cfg_text, attributes=about, progress=progress)


def record(
    scenario: Scenario,
    output: Path,
    *,
    times: Float[np.ndarray, "frame"] | None = None,
    start: float = 0.0,
    valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    cfg_text: str = "",
    attributes: Mapping[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Write a recording of a scenario; what a killed run has left of the very same one is taken over.

    Args:
        scenario: to record.
        output: recording to write.
        times: of the frames' starts on the clock of the motion, s; default: `Scenario.times`.
        start: stamp of that clock's zero, s.
        valid: False where a chirp is lost; its samples are then zero, as a capture's are.
        cfg_text: original configuration text.
        attributes: of the file, beside those that say what the scenario is, or instead.
        progress: called with (frames done, frames in all).

    Returns:
        the path written.

    Raises:
        InputError: the motion is shorter than a frame, none of its frames has an echo, or the recording cannot be
            written.
    """
    spare(Path(output))
    times = scenario.times if times is None else times
    suite, about = Suite(scenario), facts(scenario) | dict(attributes or {})

    def made(first: int, last: int) -> tuple[Int16[np.ndarray, "frame loop tx rx sample 2"], dict[str, np.ndarray]]:
        frames = scenario.frames(times[first:last], times[last] if last < len(times) else None)
        if first == 0 and not any(map(len, frames.echoes)):
            _require_echoes(scenario, times)
        arrived = np.True_ if valid is None else valid[first:last, ..., None, None, None]
        return frames.samples * arrived, suite.observe(frames, first, start)

    with (
        _left_over(Path(output)) as found,
        RecordingWriter(
            output, scenario.config, cfg_text=cfg_text, attributes=about, products=suite.products, streams=suite.streams
        ) as writer,
    ):
        alike = found is not None and found.config == scenario.config
        begun = found if alike and _fits(found, suite.streams, about, times + start, made) else None
        for first in range(0, len(times), TOGETHER):
            last = min(first + TOGETHER, len(times))
            if begun is not None and last <= len(begun):
                samples, rows = begun.adc(first, last), {name: begun.rows(name, first, last) for name in suite.streams}
            else:
                samples, rows = made(first, last)
            arrived = None if valid is None else valid[first:last]
            writer.append(samples, times[first:last] + start, arrived, rows=rows)
            if progress:
                progress(last, len(times))
    return Path(output)


def _require_echoes(scenario: Scenario, times: Float[np.ndarray, "frame"]) -> None:
    """Refuse a recording of nothing, as a look at some frames all over it tells."""
    some = np.unique(np.linspace(0, len(times) - 1, TOGETHER).astype(int))
    if not any(map(len, scenario.frames(times[some]).echoes)):
        raise InputError(
            f"scene {scenario.scene.name}: no frame has an echo, expected surfaces that face the radar within "
            f"{scenario.config.max_range:.1f} m of it"
        )


def facts(scenario: Scenario) -> dict[str, object]:
    """What a recording says of its scenario. The same on the same kind of processor is the same to the bit; on another,
    compiled loops add up in another order."""
    others = [each.model_dump(mode="json") for each in scenario.scene.interferers]
    return {
        "source": "radarsim simulate",
        "scene": scenario.scene.name,
        "seed": scenario.seed,
        "radarsim_version": __version__,
        "engine": scenario.engine,
        "front_end": scenario.front_end.model_dump_json(),
        "motion": Statistics.of(scenario.motion, scenario.scene).json(),
        "warnings": crossings(scenario.motion, scenario.scene),
        "processor": get_host_cpu_name(),
    } | ({"interferers": json.dumps(others)} if others else {})


@contextmanager
def _left_over(output: Path) -> Iterator[Recording | None]:
    """What killed runs have left of a recording, which is kept beside it until it is whole; None if that is nothing."""
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
    """Whole frames in a recording; 0 where there is none."""
    try:
        with Recording(path) as recording:
            return len(recording)
    except InputError:
        return 0


def _fits(begun: Recording, streams: Iterable[str], about: Mapping, stamps: np.ndarray, made: Callable) -> bool:
    """Whether the frames of a recording are the first of one that is to be made; two of them are made to see."""
    count = len(begun)
    return (
        about.items() <= begun.attributes.items()
        and np.array_equal(begun.times, stamps[:count])
        and all(map(begun.has, streams))
        and all(np.array_equal(begun.adc(k, k + 1), made(k, k + 1)[0]) for k in (0, count - 1))
    )
