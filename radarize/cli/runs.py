"""Commands that run odometry and SLAM, and evaluate, export, report or show the result."""

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
    output: Annotated[Path, typer.Option("--output", "-o", help="Run folder to write.")],
    odometry: Annotated[str | None, typer.Option(help=f"Method of odometry: {names('radarize.odometry')}.")] = None,
    scans: Annotated[str | None, typer.Option(help=f"Method of scans: {names('radarize.scans')}.")] = None,
    settings: Annotated[
        Reading,
        typer.Option(help="Variant of the paper's method: published is --odometry published --scans published."),
    ] = "corrected",
    weights: Annotated[
        Path | None, typer.Option(help="Folder with network weights; by default the shipped ones.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Pipeline settings (YAML), see `radarize config`.")] = None,
    every: Annotated[int, typer.Option(min=1, help="Use every N-th frame.")] = 1,
    board: BoardFile = None,
) -> None:
    """Estimate the trajectory and the map of a recording."""
    from radarize.io.load import load
    from radarize.pipeline.check.check import warnings_before
    from radarize.pipeline.odometry import configuration
    from radarize.pipeline.run import run
    from radarize.signal.effort import effort

    tuned = configuration(config)
    with load(recording, board=str(board) if board else None) as source:
        slow = effort(source.config, len(source)) if source.has_samples else ""
        warned = warnings_before(source[:])
        warn([*([slow] if slow else []), *warned])
        with progress("run", f"{output} and the recording are unchanged") as report:
            made = run(
                source[::every], output, odometry=odometry, scans=scans, settings=settings, weights=weights,
                config=tuned, progress=report,
            )  # fmt: skip
    warn([each for each in made.warnings if each not in warned])
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
    scans: Annotated[Path, typer.Argument(metavar="SCANS|RUN", help="Scans (.npz), or a run folder.")],
    odometry: Annotated[
        Path | None,
        typer.Argument(metavar="[ODOMETRY]", help="Odometry poses (TUM file); without them scans alone are used."),
    ] = None,
    *,
    output: Annotated[Path, typer.Option("--output", "-o", help="Run folder to write.")],
    preset: Annotated[
        str | None,
        typer.Option(help="Preset of settings: radar (default for a RUN), lidar (default for a file), cartographer."),
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Settings that differ from the preset (.yaml).")] = None,
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM file), for `radarize evaluate`.")] = None,
) -> None:
    """Estimate trajectory and map from scans, and odometry if there is any, of any sensor.

    SCANS has the arrays ranges (scan, beam), angle_min, angle_increment, range_max, and times (s) unless 1 s apart.
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
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM file); by default those in the run.")] = None,
    as_json: AsJson = False,
) -> None:
    """Compare a run with true poses; write metrics.json."""
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
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="Recording or run folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File or, of ros2 and roverd, folder to write.")],
    format: Annotated[
        str,
        typer.Option(
            help=f"Format: {names('radarize.exporters')}. bin: DCA1000 samples and .cfg; ros2: a bag; radarize-ae: "
            "a ROS 1 bag for the paper's code; tum: poses; ply: points; map: a run's map for map_server."
        ),
    ],
    run: Annotated[
        Path | None, typer.Option(help="Run of the recording; its scans and odometry are added to the bag.")
    ] = None,
    iq_order: Annotated[
        Literal["iiqq", "qqii"] | None,
        typer.Option(help="Of bin: mmWave Studio's order, or the SDK demo's; default: the recording's."),
    ] = None,
    time_offset: Annotated[
        float | None, typer.Option(help="Of bags: s, added to stamps; default: 1.7e9 where they begin near zero.")
    ] = None,
) -> None:
    """Convert a recording or a run to a file format of other programs."""
    from radarize.io.exporters import export

    with progress("export") as report:
        written = export(source, format, output, run=run, iq_order=iq_order, time_offset=time_offset, progress=report)
    warn(damage(source))
    print(written)


@app.command()
def report(
    source: Annotated[Path, typer.Argument(metavar="RUN|REC.h5", help="Run folder or recording.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="HTML page to write.")] = None,
    beside: Beside = None,
) -> None:
    """Write an HTML page with plots of a run or a recording."""
    from radarize.evaluation.report.recording import report_recording
    from radarize.evaluation.report.run import report_run

    with working("drawing"):
        written = report_run(source, output, beside or ()) if source.is_dir() else report_recording(source, output)
    print(written)


@app.command()
def view(
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="Recording or run folder.")],
    run: Annotated[Path | None, typer.Option(help="Run of the recording, shown together with it.")] = None,
    save: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="File to write instead of opening a window: .rrd, or .mcap for Foxglove."),
    ] = None,
) -> None:
    """Show a recording or a run in the Rerun viewer: maps, poses, scans, depth and path types on one time line."""
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
