"""From a recording to a folder with trajectory, map and all that they were made of."""

import json
import platform as machine
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import torch

from radarize import __version__
from radarize.errors import InputError
from radarize.mapping.scans import BEARINGS, ScanConfig
from radarize.methods import BEST, ODOMETRY, SCANS, Weights, best_methods
from radarize.pipeline import BATCH, Pipeline
from radarize.published.chain import CHAINS, Chain
from radarize.published.heatmaps import PublishedMaps
from radarize.recording import Recording
from radarize.settings import SETTINGS
from radarize.tum import planar, planar_poses, write_tum

#: Heat maps kept for the report, spread over the recording.
_PICTURES = 6


def run(
    recording: Path,
    output: Path,
    *,
    odometry: str | None = None,
    scans: str | None = None,
    settings: str = "corrected",
    weights: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Run the pipeline on a recording.

    Args:
        recording: ``.h5`` file, simulated or real.
        output: folder to write: trajectory.tum (SLAM), odometry.tum, reference.tum (if the recording has true poses),
            map.pgm and map.yaml, scans.h5, run.json.
        odometry, scans: methods by name; if None, networks where they fit the radar, else the classical ones.
        settings: reading of the paper, a key of `SETTINGS`. ``published`` is a chain of its own, which needs weights
            and, like the artefact, starts from true headings where the recording has them.
        weights: folder of the networks' weights; the shipped ones if None.
        progress: called with (frames done, frames in all).

    Returns:
        the folder.

    Raises:
        InputError: unusable recording or unknown method.
    """
    chosen = (("odometry", odometry, ODOMETRY), ("scans", scans, SCANS), ("settings", settings, SETTINGS))
    for name, value, known in chosen:
        if value is not None and value not in known:
            raise InputError(f"{name} is {value!r}, expected one of {', '.join(known)}")
    output = Path(output)
    with Recording(recording) as source:
        if settings == "published":
            chain, why = _published(source, weights, odometry, scans), ""
            pipeline, odometry, scans = Pipeline(source.config, chain=chain), settings, settings
        else:
            methods, why = (BEST, "") if weights else best_methods(source.config)
            odometry, scans = odometry or methods["odometry"], scans or methods["scans"]
            pipeline = Pipeline(source.config, scans, odometry, Weights(weights), source)
        methods = {"odometry": odometry, "scans": scans, "settings": settings} | ({"no networks": why} if why else {})
        for failed in _through(source, {output: (pipeline, methods)}, progress).values():
            raise failed
    return output


def run_each(
    recording: Path,
    pairs: dict[Path, tuple[str, str]],
    *,
    weights: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[Path, InputError]:
    """Run the pipeline with several methods on a recording, at once: what they have in common is made once.

    Args:
        recording: ``.h5`` file.
        pairs: odometry and scans by name, for each folder to write; see `run`.
        weights, progress: see `run`.

    Returns:
        folders that were not written, and why not.

    Raises:
        InputError: unusable recording.
    """
    failed, pipelines = {}, {}
    with Recording(recording) as source:
        for folder, (odometry, scans) in pairs.items():
            first = next((pipeline for pipeline, _ in pipelines.values()), None)
            try:
                pipeline = Pipeline(source.config, scans, odometry, Weights(weights), source, beside=first)
                pipelines[folder] = pipeline, {"odometry": odometry, "scans": scans, "settings": "corrected"}
            except InputError as error:
                failed[folder] = error
        return failed | (_through(source, pipelines, progress) if pipelines else {})


def _through(
    source: Recording,
    pipelines: dict[Path, tuple[Pipeline, dict[str, str]]],
    progress: Callable[[int, int], None] | None,
) -> dict[Path, InputError]:
    """Push a recording through pipelines and write what they made; returns what went wrong, by folder."""
    failed: dict[Path, InputError] = {}
    if not len(source):
        raise InputError(f"{source.path}: has no whole frame, expected at least one")

    def each(act: Callable[[Path, Pipeline], None]) -> None:
        for folder, (pipeline, _) in pipelines.items():
            if folder not in failed:
                try:
                    act(folder, pipeline)
                except InputError as error:
                    failed[folder] = error

    def end(folder: Path, pipeline: Pipeline) -> None:
        if not pipeline.times:
            frames = f"all its {len(source)} frames are lost or silent"
            raise InputError(f"{source.path}: {frames}, expected one with samples")
        pipeline.finish()
        folder.mkdir(parents=True, exist_ok=True)
        _write(pipeline, source, folder, pipelines[folder][1], timed=len(pipelines) == 1)

    for frames, adc in source.batches(BATCH):
        times, valid = source.times[frames], source.valid(frames.start, frames.stop)
        each(lambda folder, pipeline, batch=(adc, times, valid): pipeline.push(*batch))
        if progress:
            progress(frames.stop, len(source))
    each(end)
    return failed


def _published(source: Recording, weights: Path | None, odometry: str | None, scans: str | None) -> Chain:
    """The artefact's chain for a recording."""
    for name, value in (("odometry", odometry), ("scans", scans)):
        if value is not None:
            raise InputError(f"{name} is {value!r}, expected none with settings published, which has its own")
    if weights is None:
        raise InputError(
            "settings is 'published', which comes without weights: train them (`radarize train --settings published`) "
            "and name their folder with --weights"
        )
    headings, stride = None, PublishedMaps.stride(source.config)
    if source.has("truth/pose"):
        yaws = planar(source.rows("truth/pose", 0, CHAINS * stride)[::stride])[:, 2]
        headings = yaws if len(yaws) == CHAINS and np.isfinite(yaws).all() else None
    return Chain(source.config, weights, headings)


def _write(pipeline: Pipeline, source: Recording, output: Path, methods: dict[str, str], timed: bool) -> None:
    times, poses = np.concatenate(pipeline.times), np.concatenate(pipeline.poses)
    write_tum(output / "odometry.tum", times, planar_poses(poses))
    slam_times, slam_poses = pipeline.slam.trajectory()
    write_tum(output / "trajectory.tum", slam_times, planar_poses(slam_poses))
    if source.has("truth/pose") and source.has("truth/time"):
        true_times, true_poses = source.read("truth/time"), source.read("truth/pose")
        known = np.isfinite(true_poses).all(axis=1)  # a tracking camera may have been blind for a while
        write_tum(output / "reference.tum", true_times[known], true_poses[known])
    pipeline.slam.map().save(output / "map")
    _write_scans(pipeline, source, output / "scans.h5", times)
    frames = len(source)
    facts = {
        "recording": source.path.name,
        "recording_attributes": {k: v for k, v in source.attributes.items() if isinstance(v, (str, int, float))},
        "frames": frames,
        "frames_lost": pipeline.lost,
        "duration_s": float(times[-1] - times[0] + source.config.frame_period),
        "methods": methods,
        "radar": source.config_json(),
        "scan_settings": ScanConfig().model_dump(),
        "slam_settings": pipeline.slam.config.model_dump(),
        "closures": int(pipeline.slam.graph.accepted.sum()),
        "closures_rejected": int((~pipeline.slam.graph.accepted).sum()),
        "nodes": len(pipeline.slam.nodes),
        "radarize_version": __version__,
        "python": machine.python_version(),
        "machine": f"{machine.system()} {machine.machine()}",
    }
    if timed:  # what several share is nobody's
        facts["ms_per_frame"] = {name: 1e3 * seconds / frames for name, seconds in pipeline.stage_seconds.items()}
    (output / "run.json").write_text(json.dumps(facts, indent=2))


def _write_scans(pipeline: Pipeline, source: Recording, path: Path, times: np.ndarray) -> None:
    used = np.concatenate(pipeline.frames)
    with h5py.File(path, "w") as file:

        def put(name: str, data: np.ndarray, unit: str) -> None:
            file.create_dataset(name, data=data).attrs["unit"] = unit

        put("time", times, "s, burst middles")
        put("ranges", np.concatenate(pipeline.ranges), "m, inf: nothing seen")
        put("azimuths", BEARINGS, "rad")
        put("velocity", np.concatenate(pipeline.velocities), "m/s, sensor frame")
        put("velocity_covariance", np.concatenate(pipeline.velocity_covariances), "m^2/s^2")
        put("step_covariance", np.concatenate(pipeline.step_covariances), "m^2, m rad, rad^2: of odometry since before")
        for name in ("velocity", "scan", "scan_azimuths", "floor_plan", "pose", "time"):
            if source.has(f"truth/{name}"):
                truth = source.read(f"truth/{name}")
                truth = truth[used] if name in ("velocity", "scan") else truth  # a row for every frame
                put(f"truth/{name}", truth, str(source.describe(f"truth/{name}")["unit"]))
        shown = np.unique(np.linspace(0, len(used) - 1, _PICTURES).astype(int))
        maps = pipeline.heatmaps
        spectrum = torch.cat([maps.spectrum(source.adc(k, k + 1), source.valid(k, k + 1)) for k in used[shown]])
        put("heatmaps/frames", shown, "index into /time")
        put("heatmaps/range_azimuth", maps.range_azimuth_of(spectrum).numpy(), "counts^2")
        put("heatmaps/doppler_azimuth", maps.doppler_azimuth_of(spectrum).numpy(), "counts^2")
        if maps.pairs is not None:
            put("heatmaps/elevation_aware", maps.elevation_aware_of(spectrum).numpy(), "counts^2")
        put("heatmaps/ranges", maps.ranges, "m")
        put("heatmaps/azimuths", maps.azimuths, "rad")
        put("heatmaps/velocities", maps.velocities, "m/s, closing positive")
