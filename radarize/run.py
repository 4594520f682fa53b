"""From a recording to a folder with trajectory, map and all that they were made of."""

import json
import platform as machine
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import torch

from radarize import __version__
from radarize.batch import BATCH, Intake
from radarize.errors import InputError
from radarize.mapping.scans import BEARINGS
from radarize.methods.configuration import Configuration
from radarize.methods.method import Inputs, Weights
from radarize.methods.registry import BEST, Workshop, best_methods
from radarize.pipeline import Pipeline, Result
from radarize.recording import Recording
from radarize.tum import planar_poses, write_tum

#: Heat maps kept for the report, spread over the recording.
_PICTURES = 6


def run(
    recording: Path,
    output: Path,
    *,
    odometry: str | None = None,
    scans: str | None = None,
    weights: Path | None = None,
    configuration: Configuration | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Run the pipeline on a recording.

    Args:
        recording: ``.h5`` file, simulated or real.
        output: folder to write: trajectory.tum (SLAM), odometry.tum, reference.tum (if the recording has true poses),
            map.pgm and map.yaml, scans.h5, run.json.
        odometry, scans: methods by name; if None, networks where they fit the radar, else the classical ones.
        weights: folder of the networks' weights; the shipped ones if None.
        configuration: of the pipeline.
        progress: called with (frames done, frames in all).

    Returns:
        the folder.

    Raises:
        InputError: unusable recording or unknown method.
    """
    with Recording(recording) as source:
        best, why = (BEST, "") if weights else best_methods(source.config)
        pair = odometry or best["odometry"], scans or best["scans"]
        inputs = Inputs(source.config, configuration or Configuration(), Weights(weights), source)
        for failed in _run_each(inputs, {Path(output): pair}, progress, {"no networks": why} if why else {}).values():
            raise failed
    return Path(output)


def run_each(
    recording: Path,
    pairs: dict[Path, tuple[str, str]],
    *,
    weights: Path | None = None,
    configuration: Configuration | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Path, InputError]:
    """Run the pipeline with several methods on a recording, at once: what they have in common is made once.

    Args:
        recording: ``.h5`` file.
        pairs: odometry and scans by name, for each folder to write; see `run`.
        weights, configuration, progress: see `run`.

    Returns:
        folders that were not written, and why not.

    Raises:
        InputError: unusable recording.
    """
    with Recording(recording) as source:
        inputs = Inputs(source.config, configuration or Configuration(), Weights(weights), source)
        return _run_each(inputs, pairs, progress, {})


def _run_each(
    inputs: Inputs, pairs: dict[Path, tuple[str, str]], progress: Callable[[int, int], None], facts: dict[str, str]
) -> dict[Path, InputError]:
    source, workshop, failed = inputs.recording, Workshop(inputs), {}
    if not len(source):
        raise InputError(f"{source.path}: has no whole frame, expected at least one")
    pipelines: dict[Path, Pipeline] = {}
    results: dict[Path, list[Result]] = {}

    def each(act: Callable[[Path], None], folders) -> None:
        for folder in list(folders):
            try:
                act(folder)
            except InputError as error:
                failed[folder] = error
                pipelines.pop(folder, None)

    def make(folder: Path) -> None:
        pipelines[folder], results[folder] = workshop.pipeline(*pairs[folder]), []

    each(make, pairs)
    intake = Intake(inputs.signal)
    for frames, adc in source.batches(BATCH):
        if not pipelines:
            break
        if batch := intake.take(adc, source.times[frames], source.valid(frames.start, frames.stop)):
            each(lambda folder, batch=batch: results[folder].append(pipelines[folder].push(batch)), pipelines)
        progress(frames.stop, len(source))

    def end(folder: Path) -> None:
        if intake.lost == intake.taken:
            frames = f"all its {len(source)} frames are lost or silent"
            raise InputError(f"{source.path}: {frames}, expected one with samples")
        pipelines[folder].finish()
        methods = dict(zip(("odometry", "scans"), pairs[folder], strict=True)) | facts
        _write(pipelines[folder], results[folder], inputs, folder, methods, intake.lost, timed=len(pairs) == 1)

    each(end, pipelines)
    return failed


def _write(
    pipeline: Pipeline,
    results: list[Result],
    inputs: Inputs,
    output: Path,
    methods: dict[str, str],
    lost: int,
    timed: bool,
) -> None:
    output.mkdir(parents=True, exist_ok=True)
    source = inputs.recording
    times, poses = (np.concatenate([getattr(r.track, name) for r in results]) for name in ("time", "pose"))
    write_tum(output / "odometry.tum", times, planar_poses(poses))
    slam_times, slam_poses = pipeline.slam.trajectory()
    write_tum(output / "trajectory.tum", slam_times, planar_poses(slam_poses))
    if source.has("truth/pose") and source.has("truth/time"):
        true_times, true_poses = source.read("truth/time"), source.read("truth/pose")
        known = np.isfinite(true_poses).all(axis=1)  # a tracking camera may have been blind for a while
        write_tum(output / "reference.tum", true_times[known], true_poses[known])
    pipeline.slam.map().save(output / "map")
    _write_scans(results, inputs, output / "scans.h5", times)
    frames = len(source)
    facts = {
        "recording": source.path.name,
        "recording_attributes": {k: v for k, v in source.attributes.items() if isinstance(v, (str, int, float))},
        "frames": frames,
        "frames_lost": lost,
        "duration_s": float(times[-1] - times[0] + source.config.frame_period),
        "methods": methods,
        "radar": source.config_json(),
        "configuration": inputs.configuration.model_dump(),
        "closures": int(pipeline.slam.graph.accepted.sum()),
        "closures_rejected": int((~pipeline.slam.graph.accepted).sum()),
        "nodes": len(pipeline.slam.nodes),
        "radarize_version": __version__,
        "python": machine.python_version(),
        "machine": f"{machine.system()} {machine.machine()}",
    }
    if timed:  # what several share is nobody's
        facts["ms_per_frame"] = {name: 1e3 * seconds / frames for name, seconds in pipeline.seconds.items()}
    (output / "run.json").write_text(json.dumps(facts, indent=2))


def _write_scans(results: list[Result], inputs: Inputs, path: Path, times: np.ndarray) -> None:
    source, used = inputs.recording, np.concatenate([result.frames for result in results])

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(result.track, name) for result in results])

    with h5py.File(path, "w") as file:

        def put(name: str, data: np.ndarray, unit: str) -> None:
            file.create_dataset(name, data=data).attrs["unit"] = unit

        put("time", times, "s, burst middles")
        put("ranges", np.concatenate([result.ranges for result in results]), "m, inf: nothing seen")
        put("azimuths", BEARINGS, "rad")
        put("velocity", joined("velocity"), "m/s, sensor frame")
        put("velocity_covariance", joined("velocity_covariance"), "m^2/s^2")
        put("step_covariance", joined("covariance"), "m^2, m rad, rad^2: of odometry since before")
        for name in ("velocity", "scan", "scan_azimuths", "floor_plan", "pose", "time"):
            if source.has(f"truth/{name}"):
                truth = source.read(f"truth/{name}")
                truth = truth[used] if name in ("velocity", "scan") else truth  # a row for every frame
                put(f"truth/{name}", truth, str(source.describe(f"truth/{name}")["unit"]))
        shown = np.unique(np.linspace(0, len(used) - 1, _PICTURES).astype(int))
        maps = inputs.signal.heatmaps
        spectrum = torch.cat([maps.spectrum(source.adc(k, k + 1), source.valid(k, k + 1)) for k in used[shown]])
        put("heatmaps/frames", shown, "index into /time")
        put("heatmaps/range_azimuth", maps.range_azimuth_of(spectrum).numpy(), "counts^2")
        put("heatmaps/doppler_azimuth", maps.doppler_azimuth_of(spectrum).numpy(), "counts^2")
        if maps.pairs is not None:
            put("heatmaps/elevation_aware", maps.elevation_aware_of(spectrum).numpy(), "counts^2")
        put("heatmaps/ranges", maps.ranges, "m")
        put("heatmaps/azimuths", maps.azimuths, "rad")
        put("heatmaps/velocities", maps.velocities, "m/s, closing positive")
