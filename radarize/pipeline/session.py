"""Run the pipeline on a recording and write the run folder."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.recording import Clip
from radarize.pipeline.check.check import warnings_after, warnings_before
from radarize.pipeline.check.summary import Summary
from radarize.pipeline.config import Configuration
from radarize.pipeline.method import Inputs, Weights
from radarize.pipeline.methods import make_pipeline
from radarize.pipeline.runfolder import RunWriter
from radarize.signal.batch import Batch, Preprocessor
from radarize.signal.effort import together
from radarize.signal.polar import PICTURE, pictured


def run_recording(
    frames: Clip,
    folder: Path,
    methods: Mapping[str, str],
    *,
    weights: str | Path | None = None,
    configuration: Configuration | None = None,
    facts: Mapping[str, str] | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Run the pipeline on a recording and write a run folder.

    Args:
        frames: frames of a recording: all, a part, or every N-th.
        folder: folder to write.
        methods: names of ``odometry`` and ``scans``.
        weights: folder with network weights; None: the shipped ones.
        configuration: settings of the pipeline.
        facts: further entries of ``methods`` in ``run.json``.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: an unusable recording, an unknown method or one that lacks something, or a folder that cannot be
            written.
    """
    inputs = inputs_of(frames, weights, configuration)
    pipeline, preprocessor = (
        make_pipeline(inputs, methods["odometry"], methods["scans"]),
        Preprocessor(inputs.signal, inputs.every),
    )
    source, warnings, summary = frames.recording, warnings_before(frames), Summary(frames.recording.config)
    with RunWriter(folder, source.config) as writer:
        for result in pipeline.run(batches(frames, preprocessor, progress, summary)):
            writer.add(result)
        if preprocessor.lost == preprocessor.taken:
            lost = f"all its {preprocessor.taken} frames are lost or silent"
            raise InputError(f"{source.path}: {lost}, expected one with samples")
        warnings += warnings_after(frames, summary.sequence) if source.has_samples else []
        writer.describe(frames, inputs.signal.heatmaps, warnings)
        made = {**methods, **(facts or {})}
        if frames.numbers.step > 1:
            made["frames"] = f"one of {frames.numbers.step}"
        about = {
            "frames_lost": preprocessor.lost,
            "frames_missing": preprocessor.numbering.missing,
            "chirps_disturbed": preprocessor.disturbed,
            "methods": made,
            "configuration": inputs.configuration.model_dump(),
            "ms_per_frame": {name: 1e3 * spent / preprocessor.taken for name, spent in pipeline.seconds.items()},
        }
        writer.finish(pipeline.slam, about)


def inputs_of(frames: Clip, weights: str | Path | None, configuration: Configuration | None) -> Inputs:
    """Return the inputs of methods, for frames of a recording.

    Raises:
        InputError: the recording has no frames.
    """
    source = frames.recording
    if not len(frames):
        raise InputError(f"{source.path}: has no whole frame, expected at least one")
    return Inputs(source.config, configuration or Configuration(), Weights(weights), source, frames.numbers.step)


def batches(
    frames: Clip,
    preprocessor: Preprocessor,
    progress: Callable[[int, int], None] = lambda done, total: None,
    summary: Summary | None = None,
) -> Iterator[Batch]:
    """Yield frames in batches, and call `progress` with (frames done, frames in all); `summary` collects all frames."""
    source, span = frames.recording, frames.span
    size = together(source.config)
    for start in range(span.start, span.stop, size):
        stop = min(start + size, span.stop)
        stamps = source.times[start:stop]
        if pictured(source):
            yield preprocessor.process_maps({"picture": source.rows(PICTURE, start, stop)}, stamps)
        else:
            adc = source.adc(start, stop)
            if summary is not None:
                summary.add(adc)
            yield preprocessor.process(adc, stamps, source.valid(start, stop))
        progress(stop - span.start, len(span))
