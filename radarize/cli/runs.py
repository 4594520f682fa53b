"""Commands that make runs, and what comes after one."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.cli.app import (
    AsJson,
    Beside,
    BoardFile,
    Reading,
    RecordingFile,
    RunPath,
    app,
    damage,
    names,
    warn,
)
from radarize.io.console import print_table, progress, working


@app.command("run")
def run_(
    recording: RecordingFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    odometry: Annotated[str | None, typer.Option(help=f"Method of odometry: {names('radarize.odometry')}.")] = None,
    scans: Annotated[str | None, typer.Option(help=f"Method of scans: {names('radarize.scans')}.")] = None,
    settings: Annotated[
        Reading, typer.Option(help="Reading of the paper: published is --odometry published --scans published.")
    ] = "corrected",
    weights: Annotated[
        Path | None, typer.Option(help="Folder of networks' weights; by default the shipped ones.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Settings of the pipeline (YAML), see `radarize config`.")] = None,
    every: Annotated[int, typer.Option(min=1, help="Use every N-th frame.")] = 1,
    board: BoardFile = None,
) -> None:
    """Estimate trajectory and map of a recording."""
    from radarize.io.load import load
    from radarize.pipeline.check.check import warnings_before
    from radarize.pipeline.odometry import configuration
    from radarize.pipeline.run import run
    from radarize.signal.effort import effort

    tuned = configuration(config)
    with load(recording, board=str(board) if board else None) as source:
        words = effort(source.config, len(source)) if source.has_samples else ""
        told = warnings_before(source[:])
        warn([*([words] if words else []), *told])
        with progress("run", f"{output} is as it was before, and so is the recording") as report:
            made = run(
                source[::every], output, odometry=odometry, scans=scans, settings=settings, weights=weights,
                config=tuned, progress=report,
            )  # fmt: skip
    warn([words for words in made.warnings if words not in told])
    print(made.path)


@app.command("config")
def config_(
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of such files instead.")] = False,
) -> None:
    """Print all settings of the pipeline as YAML with description and unit: `radarize config > mine.yaml`."""
    import json

    from radarize.io.schema import json_schema
    from radarize.pipeline.config import Configuration

    if schema:
        print(json.dumps(json_schema(Configuration, "Configuration of the pipeline"), indent=2))
        return
    print(Configuration().text(), end="")


@app.command()
def slam(
    scans: Annotated[Path, typer.Argument(metavar="SCANS|RUN", help="Scans (.npz), or a run's folder.")],
    odometry: Annotated[
        Path | None, typer.Argument(metavar="[ODOMETRY]", help="Poses (TUM); else scans alone.")
    ] = None,
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    preset: Annotated[str | None, typer.Option(help="radar (of a RUN), lidar (of a file) or cartographer.")] = None,
    config: Annotated[Path | None, typer.Option(help="Settings that differ from the preset (.yaml).")] = None,
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM), for `radarize evaluate`.")] = None,
) -> None:
    """Estimate trajectory and map from scans and odometry of any sensor.

    SCANS holds ranges (scan, beam), angle_min, angle_increment, range_max and, unless one a second, times.
    """
    from radarize.pipeline.log import run
    from radarize.pipeline.runfolder import RunFolder
    from radarize.slam.config import SlamConfig

    name = preset or ("radar" if scans.is_dir() else "lidar")
    settings = SlamConfig.load(config, name) if config else SlamConfig.preset(name)
    with progress("slam") as report:
        written = run(scans, odometry, output, config=settings, reference=reference, progress=report)
    warn(RunFolder(written).warnings)
    print(written)


@app.command()
def evaluate(
    run: RunPath,
    beside: Beside = None,
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM); by default the run's own.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare a run with the truth; writes metrics.json."""
    from radarize.evaluation.evaluation import evaluate
    from radarize.evaluation.report.words import beside as compared

    with working("evaluating"):
        found = evaluate(run, reference=reference)
        others = [evaluate(other, reference=reference) for other in beside or ()]
        found.save()
    if as_json:
        print(found.to_json())
        return
    for part in found.tables:
        print(part) if isinstance(part, str) else print_table(*part)
    if others:
        print_table(*compared([(each.method, each) for each in (found, *others)]))


@app.command()
def export(
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="A recording, or a run's folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File or, of ros2 and roverd, folder to write.")],
    format: Annotated[
        str,
        typer.Option(
            help=f"Format: {names('radarize.exporters')}. bin: DCA1000 samples and .cfg; ros2: a bag; radarize-ae: "
            "a ROS 1 bag for the paper's code; tum: poses; ply: points; map: a run's map for map_server."
        ),
    ],
    run: Annotated[Path | None, typer.Option(help="Run of the recording, for scans and odometry in the bag.")] = None,
    iq_order: Annotated[
        Literal["iiqq", "qqii"] | None,
        typer.Option(help="Of bin: mmWave Studio's order, or the SDK demo's; default: the recording's."),
    ] = None,
    time_offset: Annotated[
        float | None, typer.Option(help="Of bags: s, added to stamps; default: 1.7e9 where they begin near zero.")
    ] = None,
) -> None:
    """Write a recording or a run for other programs."""
    from radarize.io.exporters import export

    with progress("export") as report:
        written = export(source, format, output, run=run, iq_order=iq_order, time_offset=time_offset, progress=report)
    warn(damage(source))
    print(written)


@app.command()
def report(
    source: Annotated[Path, typer.Argument(metavar="RUN|REC.h5", help="A run's folder, or a recording.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write (.html).")] = None,
    beside: Beside = None,
) -> None:
    """Draw a run or a recording as one HTML page."""
    from radarize.evaluation.report.recording import report_recording
    from radarize.evaluation.report.run import report_run

    with working("drawing"):
        written = report_run(source, output, beside or ()) if source.is_dir() else report_recording(source, output)
    print(written)


@app.command()
def view(
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="A recording, or a run's folder.")],
    run: Annotated[Path | None, typer.Option(help="Run of the recording, to show with it.")] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write .rrd, or .mcap for Foxglove, instead of a window.")
    ] = None,
) -> None:
    """Look at a recording or a run in the Rerun viewer: maps, poses, scans, depth and path types on one time line."""
    written: Path | None
    warn(damage(source))
    with progress("view") as report:
        if save is not None and save.suffix == ".mcap":
            from radarize.evaluation.mcap import write_mcap

            written = write_mcap(source, run, save, progress=report)
        else:
            from radarize.evaluation.viewer import view

            written = view(source, run, save, progress=report)
    if written:
        print(written)
