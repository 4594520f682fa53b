"""From a recording to a folder with trajectory, map and all that they were made of."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from radarize.batch import Batch, Intake
from radarize.effort import together
from radarize.errors import InputError
from radarize.methods.configuration import Configuration
from radarize.methods.method import Inputs, Weights
from radarize.methods.registry import BEST, PICTURED, Workshop, best_methods
from radarize.pipeline import Pipeline
from radarize.polar import PICTURE, pictured
from radarize.recording import Recording
from radarize.runfolder import RunWriter


def run(
    recording: Path,
    output: Path,
    *,
    odometry: str | None = None,
    scans: str | None = None,
    weights: Path | None = None,
    configuration: Configuration | None = None,
    every: int = 1,
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
        every: use every so many-th frame.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: unusable recording or unknown method.
    """
    with Recording(recording) as source:
        best, why = (BEST, "") if weights else best_methods(source.config.every(every))
        if pictured(source):
            best, why = PICTURED, ""
    pairs = {Path(output): (odometry or best["odometry"], scans or best["scans"])}
    failed = run_each(
        recording, pairs, weights=weights, configuration=configuration,
        facts={"no networks": why} if why else None, every=every, progress=progress,
    )  # fmt: skip
    for error in failed.values():
        raise error
    return Path(output)


def run_each(
    recording: Path,
    pairs: dict[Path, tuple[str, str]],
    *,
    weights: Path | None = None,
    configuration: Configuration | None = None,
    facts: Mapping[str, str] | None = None,
    every: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Path, InputError]:
    """Run the pipeline with several methods on a recording, at once: what they have in common is made once.

    Args:
        recording: ``.h5`` file.
        pairs: odometry and scans by name, for each folder to write; see `run`.
        weights, configuration, every, progress: see `run`.
        facts: what ``run.json`` says of the methods beside their names.

    Returns:
        folders that were not written, and why not.

    Raises:
        InputError: unusable recording.
    """
    failed: dict[Path, InputError] = {}
    pipelines: dict[Path, Pipeline] = {}
    writers: dict[Path, RunWriter] = {}

    def each(act: Callable[[Path], None], folders: Iterable[Path]) -> None:
        for folder in list(folders):
            try:
                act(folder)
            except InputError as error:
                failed[folder] = error
                pipelines.pop(folder, None)

    def make(folder: Path) -> None:
        pipelines[folder] = workshop.pipeline(*pairs[folder])
        writers[folder] = stack.enter_context(RunWriter(folder, source.config))

    def push(batch: Batch, folder: Path) -> None:
        writers[folder].add(pipelines[folder].push(batch))

    def end(folder: Path) -> None:
        if intake.lost == intake.taken:
            frames = f"all its {intake.taken} frames are lost or silent"
            raise InputError(f"{source.path}: {frames}, expected one with samples")
        pipeline, writer = pipelines[folder], writers[folder]
        pipeline.finish()
        writer.describe(source, inputs.signal.heatmaps)
        made = dict(zip(("odometry", "scans"), pairs[folder], strict=True)) | dict(facts or {})
        if every > 1:
            made["frames"] = f"one of {every}"
        told = {
            "frames_lost": intake.lost,
            "frames_missing": intake.numbering.missing,
            "chirps_disturbed": intake.disturbed,
            "methods": made,
            "configuration": inputs.configuration.model_dump(),
        }
        if len(pairs) == 1:  # what several share is nobody's
            told["ms_per_frame"] = {name: 1e3 * seconds / intake.taken for name, seconds in pipeline.seconds.items()}
        writer.finish(pipeline.slam, told)

    with Recording(recording) as source, ExitStack() as stack:
        if not len(source):
            raise InputError(f"{source.path}: has no whole frame, expected at least one")
        inputs = Inputs(source.config, configuration or Configuration(), Weights(weights), source, every)
        workshop, intake = Workshop(inputs), Intake(inputs.signal, every)
        each(make, pairs)
        for done, batch in _batches(source, intake):
            if not pipelines:
                break
            if batch:
                each(partial(push, batch), pipelines)
            progress(done, len(source))
        each(end, pipelines)
    return failed


def _batches(source: Recording, intake: Intake) -> Iterator[tuple[int, Batch]]:
    """A recording's batches, each with how many frames have been read."""
    size = together(source.config)
    for start in range(0, len(source), size):
        stop = min(start + size, len(source))
        stamps = source.times[start:stop]
        if pictured(source):
            yield stop, intake.take_maps({"picture": source.rows(PICTURE, start, stop)}, stamps)
        else:
            yield stop, intake.take(source.adc(start, stop), stamps, source.valid(start, stop))
