"""Commands that make recordings, and say what they hold."""

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from radarize.cli.app import (
    AsJson,
    Baud,
    BoardFile,
    CommandPort,
    DataPort,
    Dca,
    Duration,
    FrameCount,
    Host,
    Overwrite,
    PortName,
    RadarFile,
    RecordingFile,
    app,
    tell,
    warn,
)
from radarize.io.console import print_table, progress, until_interrupted, working


@app.command("import")
def import_(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A DCA1000 .bin, a .pcap or .pcapng, a folder of mmWave Studio, a ROS bag (.bag, .mcap, .db3 or its "
            "folder), an array of samples (.npy, .npz, .mat), a sequence of I/Q-1M (roverd), or RadarHD's dataset_5.",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5).")],
    config: Annotated[str | None, typer.Option(help="A .cfg, a .mmwave.json or a preset's name.")] = None,
    poses: Annotated[Path | None, typer.Option(help="True poses of the sensor (TUM).")] = None,
    shape: Annotated[
        str | None,
        typer.Option(metavar="AXES", help="Of an array: frame, loop, tx, rx, sample in its order, or lengths."),
    ] = None,
    variable: Annotated[str | None, typer.Option(help="Name of the array in an .npz or .mat.")] = None,
    latency: Annotated[
        float | None,
        typer.Option(
            help="From a frame's start to its receipt in a bag, s; else as headers say, or the burst's length."
        ),
    ] = None,
    imu_turn: Annotated[
        str | None, typer.Option(metavar="'ROLL PITCH YAW'", help="Of a bag's IMU on the radar, degrees.")
    ] = None,
    capture: Annotated[
        int | None,
        typer.Option(help="Which capture of a .pcap with several (boards, ports, starts of the radar); else all."),
    ] = None,
    walk: Annotated[int | None, typer.Option(help="Which walk of RadarHD's dataset_5.")] = None,
    align: Annotated[
        bool, typer.Option("--align", help="Of a walk: the lidar's pictures of the same instants, not numbers.")
    ] = False,
    samples: Annotated[int | None, typer.Option(help="Complex samples per chirp.")] = None,
    loops: Annotated[int | None, typer.Option(help="Loops per frame.")] = None,
    rx: Annotated[str | None, typer.Option(help="How many receivers (4), or which (1,3).")] = None,
    tx: Annotated[str | None, typer.Option(help="How many transmitters (3), or their firing order (1,3,2).")] = None,
    iq_order: Annotated[Literal["iiqq", "qqii"] | None, typer.Option(help="mmWave Studio, or SDK demo.")] = None,
    encoding: Annotated[
        Literal["signed", "offset-binary"], typer.Option(help="Of a .bin's words; a warning says where it looks other.")
    ] = "signed",
    layout: Annotated[
        Literal["pairs", "interleaved", "real"],
        typer.Option(
            metavar="LAYOUT",
            help="Of a .bin's words: pairs (I and Q), interleaved (receivers by turns, four lanes), or real samples.",
        ),
    ] = "pairs",
    board: Annotated[str | None, typer.Option(help="The board: iwr1843boost, ..., or its YAML file.")] = None,
    start_frequency: Annotated[float | None, typer.Option(help="Hz.")] = None,
    slope: Annotated[float | None, typer.Option(help="Hz/s (80 MHz/us is 80e12).")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="Hz.")] = None,
    idle_time: Annotated[float | None, typer.Option(help="s.")] = None,
    adc_start_time: Annotated[float | None, typer.Option(help="s.")] = None,
    ramp_end_time: Annotated[float | None, typer.Option(help="s.")] = None,
    frame_period: Annotated[float | None, typer.Option(help="s.")] = None,
    start_time: Annotated[float | None, typer.Option(help="Stamp of the first frame, s.")] = None,
) -> None:
    """Make a recording from a capture of a real radar."""
    given = dict(locals())  # all options, by name
    from radarize.io.load import load
    from radarize.io.recording import keeping

    with keeping(output), progress("import") as report:
        tell(load(**given, progress=report).path)


@app.command()
def capture(
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5).")],
    config: RadarFile = None,
    port: PortName = None,
    baud: Baud = 115200,
    host: Host = "192.168.33.30",
    dca: Dca = "192.168.33.180",
    command_port: CommandPort = 4096,
    data_port: DataPort = 4098,
    duration: Duration = None,
    frames: FrameCount = None,
    overwrite: Overwrite = False,
) -> None:
    """Record a real radar: IWR1843BOOST with a DCA1000. Whatever ends it, Ctrl-C too, leaves a whole file."""
    from radarize.capture.api import frames_within, sensor
    from radarize.capture.record import record
    from radarize.io.recording import spare

    if not overwrite:
        spare(output, anything=True)
    network: Any = {"host": host, "dca": dca, "command_port": command_port, "data_port": data_port}
    radar = sensor(config, port, {"baud": baud, **network})
    most = frames_within(duration, frames, radar.config.frame_period)
    with until_interrupted() as stopping, progress("capture") as report, radar:
        record(radar, output, stopping, frames=most, overwrite=overwrite, progress=report)
    tell(output)


@app.command()
def live(
    replay: Annotated[Path | None, typer.Option(metavar="REC.h5", help="Play a recording instead of a radar.")] = None,
    config: RadarFile = None,
    port: PortName = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Record as well (.h5).")] = None,
    baud: Baud = 115200,
    host: Host = "192.168.33.30",
    dca: Dca = "192.168.33.180",
    command_port: CommandPort = 4096,
    data_port: DataPort = 4098,
    duration: Duration = None,
    frames: FrameCount = None,
    odometry: Annotated[str | None, typer.Option(help="See `radarize run`.")] = None,
    scans: Annotated[str | None, typer.Option(help="See `radarize run`.")] = None,
    weights: Annotated[Path | None, typer.Option(help="See `radarize run`.")] = None,
    pipeline: Annotated[
        Path | None, typer.Option(help="Settings of the pipeline (YAML), see `radarize config`.")
    ] = None,
    every: Annotated[
        int | None, typer.Option(min=1, help="Follow every N-th frame; by default as the networks were trained.")
    ] = None,
    address: Annotated[str, typer.Option(help="Where to show the page; port 0 is any.")] = "127.0.0.1:8470",
    foxglove: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Serve Foxglove as well, e.g. 127.0.0.1:8765.")
    ] = None,
    overwrite: Overwrite = False,
    board: BoardFile = None,
) -> None:
    """Run the pipeline on a real radar, or on a recording in real time, and show it on a local page. Ctrl-C ends it."""
    given = dict(locals())  # all options, by name
    from radarize.capture.api import live

    with until_interrupted() as stopping:
        with working("warming up"):
            session = live(**given)
        with progress("live") as report, session:
            print(f"page: {session.url}", flush=True)
            if session.server is not None:
                print(f"Foxglove: {session.server.url}", flush=True)
            for _ in session.frames(stopping, report):
                pass
    warn(session.warnings)
    followed = session.live.losses.frames
    print(f"{followed} frames, {1e3 * session.live.busy / max(followed, 1):.1f} ms each")


@app.command()
def recover(
    part: Annotated[Path, typer.Argument(metavar="REC.h5.part", help="What a program that was killed has left.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Recording to write; else REC.h5.")] = None,
) -> None:
    """Make a recording of what is left of one: all whole frames, up to a second before its program was killed."""
    from radarize.io.recording import recover

    tell(recover(part, output))


@app.command()
def calibrate(
    recording: RecordingFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Board's file to write (board.yaml), or the radar's .cfg.")
    ],
    target: Annotated[
        float | None,
        typer.Option(metavar="M", help="Corner reflector straight ahead at so many m; the radar stands still."),
    ] = None,
) -> None:
    """Calibrate a radar from an ordinary walk of 20 s: channels, range bias, mounting. No reflector is needed.

    radarize calibrate walk.h5 -o board.yaml; then radarize run other.h5 --board board.yaml -o RUN
    """
    from radarize.pipeline.calibration.calibration import calibrate

    with progress("calibrate") as report:
        found = calibrate(recording, output, target=target, progress=report)
    for table in found.tables:
        print_table(*table)
    warn(found.warnings)
    print(output)


@app.command()
def info(recording: RecordingFile, as_json: AsJson = False) -> None:
    """Say what a recording holds."""
    from radarize.evaluation.report.contents import contents, show

    found = contents(recording)
    print(json.dumps(found, indent=2)) if as_json else show(found)


@app.command()
def check(
    recording: RecordingFile,
    fix: Annotated[
        Path | None,
        typer.Option(metavar="OUTPUT", help="Write a mended recording (.h5), or the right board's file (.yaml)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find what is wrong with a recording: I and Q, antennas, chirps, frames, stamps. Exit code 1 if anything is.

    Ten seconds of a walk are enough: radarize check walk.h5
    """
    from radarize.io.load import load
    from radarize.pipeline.check.check import check

    with load(recording) as source, working("checking"):
        found = check(source, fix)
    print(found.to_json() if as_json else found)
    if fix is not None:
        typer.echo(f"written: {fix}", err=True)
    raise typer.Exit(0 if found.well else 1)
