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
from radarize.methods.registry import Workshop
from radarize.pipeline import Pipeline
from radarize.polar import PICTURE, pictured
from radarize.recording import Clip
from radarize.runfolder import RunWriter


def run_each(
    frames: Clip,
    pairs: dict[Path, tuple[str, str]],
    *,
    weights: Path | None = None,
    configuration: Configuration | None = None,
    facts: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[Path, InputError]:
    """Run the pipeline with several methods on a recording, at once: what they have in common is made once.

    Args:
        frames: of a recording: all, some, or every N-th.
        pairs: odometry and scans by name, for each folder to write.
        weights: folder of the networks' weights; the shipped ones if None.
        configuration: of the pipeline.
        facts: what ``run.json`` says of the methods beside their names.
        progress: called with (frames done, frames in all).

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
            lost = f"all its {intake.taken} frames are lost or silent"
            raise InputError(f"{source.path}: {lost}, expected one with samples")
        pipeline, writer = pipelines[folder], writers[folder]
        pipeline.finish()
        writer.describe(frames, inputs.signal.heatmaps)
        made = dict(zip(("odometry", "scans"), pairs[folder], strict=True)) | dict(facts or {})
        if frames.numbers.step > 1:
            made["frames"] = f"one of {frames.numbers.step}"
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

    source = frames.recording
    with ExitStack() as stack:
        inputs = inputs_of(frames, weights, configuration)
        workshop, intake = Workshop(inputs), Intake(inputs.signal, inputs.every)
        each(make, pairs)
        for done, batch in batches(frames, intake):
            if not pipelines:
                break
            if batch:
                each(partial(push, batch), pipelines)
            progress(done, len(frames.span))
        each(end, pipelines)
    return failed


def inputs_of(frames: Clip, weights: Path | None, configuration: Configuration | None) -> Inputs:
    """What methods are made from, for frames of a recording.

    Raises:
        InputError: there are none.
    """
    source = frames.recording
    if not len(frames):
        raise InputError(f"{source.path}: has no whole frame, expected at least one")
    return Inputs(source.config, configuration or Configuration(), Weights(weights), source, frames.numbers.step)


def batches(frames: Clip, intake: Intake) -> Iterator[tuple[int, Batch]]:
    """Frames in batches, each with how many have been read, those between every N-th included."""
    source, span = frames.recording, frames.span
    size = together(source.config)
    for start in range(span.start, span.stop, size):
        stop = min(start + size, span.stop)
        stamps = source.times[start:stop]
        if pictured(source):
            batch = intake.take_maps({"picture": source.rows(PICTURE, start, stop)}, stamps)
        else:
            batch = intake.take(source.adc(start, stop), stamps, source.valid(start, stop))
        yield stop - span.start, batch
