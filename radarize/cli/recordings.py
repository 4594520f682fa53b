"""Commands that import, capture, repair, calibrate, describe and check recordings."""

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
    print_summary,
    warn,
)
from radarize.io.console import print_table, progress, until_interrupted, working


@app.command("import")
def import_(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="DCA1000 .bin, .pcap or .pcapng, folder of mmWave Studio, ROS bag (.bag, .mcap, .db3 or its folder), "
            "array of samples (.npy, .npz, .mat), sequence of I/Q-1M (roverd), or RadarHD's dataset_5.",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.h5).")],
    config: Annotated[
        str | None, typer.Option(help="Radar configuration: a .cfg, a .mmwave.json or the name of a preset.")
    ] = None,
    poses: Annotated[Path | None, typer.Option(help="True poses of the sensor (TUM file).")] = None,
    shape: Annotated[
        str | None,
        typer.Option(metavar="AXES", help="Axes of an array in order: frame, loop, tx, rx, sample; or their lengths."),
    ] = None,
    variable: Annotated[str | None, typer.Option(help="Name of the array in an .npz or .mat file.")] = None,
    latency: Annotated[
        float | None,
        typer.Option(
            help="Time from the start of a frame to its receipt in a bag, s; default: from message headers, else "
            "the burst duration."
        ),
    ] = None,
    imu_turn: Annotated[
        str | None,
        typer.Option(metavar="'ROLL PITCH YAW'", help="Orientation of a bag's IMU relative to the radar, degrees."),
    ] = None,
    capture: Annotated[
        int | None,
        typer.Option(help="Number of the capture in a .pcap that holds several (boards, ports, starts); default: all."),
    ] = None,
    walk: Annotated[int | None, typer.Option(help="Number of the walk in RadarHD's dataset_5.")] = None,
    align: Annotated[
        bool,
        typer.Option(
            "--align", help="Match radar and lidar images of RadarHD by time stamp instead of by frame index."
        ),
    ] = False,
    samples: Annotated[int | None, typer.Option(help="Complex samples per chirp.")] = None,
    loops: Annotated[int | None, typer.Option(help="Loops per frame.")] = None,
    rx: Annotated[str | None, typer.Option(help="Number of receivers (4), or the enabled ones (1,3).")] = None,
    tx: Annotated[str | None, typer.Option(help="Number of transmitters (3), or their firing order (1,3,2).")] = None,
    iq_order: Annotated[
        Literal["iiqq", "qqii"] | None, typer.Option(help="Order of I and Q: iiqq (mmWave Studio) or qqii (SDK demo).")
    ] = None,
    encoding: Annotated[
        Literal["signed", "offset-binary"],
        typer.Option(help="Encoding of .bin words; a mismatch is reported as a warning."),
    ] = "signed",
    layout: Annotated[
        Literal["pairs", "interleaved", "real"],
        typer.Option(
            metavar="LAYOUT",
            help="Order of .bin words: pairs (I and Q), interleaved (receivers alternate, 4 lanes), or real samples.",
        ),
    ] = "pairs",
    board: Annotated[str | None, typer.Option(help="Name of the board (iwr1843boost, ...) or its YAML file.")] = None,
    start_frequency: Annotated[float | None, typer.Option(help="Start frequency of the chirp, Hz.")] = None,
    slope: Annotated[float | None, typer.Option(help="Chirp slope, Hz/s (80 MHz/us is 80e12).")] = None,
    sample_rate: Annotated[float | None, typer.Option(help="ADC sample rate, Hz.")] = None,
    idle_time: Annotated[float | None, typer.Option(help="Idle time before each chirp, s.")] = None,
    adc_start_time: Annotated[
        float | None, typer.Option(help="Time from the start of the ramp to the first sample, s.")
    ] = None,
    ramp_end_time: Annotated[float | None, typer.Option(help="Duration of the ramp, s.")] = None,
    frame_period: Annotated[float | None, typer.Option(help="Frame period, s.")] = None,
    start_time: Annotated[float | None, typer.Option(help="Time stamp of the first frame, s.")] = None,
) -> None:
    """Convert raw data of a real radar to a recording."""
    given = dict(locals())  # all options, by name
    from radarize.io.load import load
    from radarize.io.recording import keeping

    with keeping(output), progress("import") as report:
        print_summary(load(**given, progress=report).path)


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
    """Record a real radar: IWR1843BOOST with a DCA1000. The file is complete even if Ctrl-C ends the capture."""
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
    print_summary(output)


@app.command()
def live(
    replay: Annotated[Path | None, typer.Option(metavar="REC.h5", help="Play a recording instead of a radar.")] = None,
    config: RadarFile = None,
    port: PortName = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Also write a recording (.h5).")] = None,
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
    pipeline: Annotated[Path | None, typer.Option(help="Pipeline settings (YAML), see `radarize config`.")] = None,
    every: Annotated[
        int | None,
        typer.Option(min=1, help="Use every N-th frame; by default to match the frame rate of the networks."),
    ] = None,
    address: Annotated[
        str, typer.Option(help="Address and port of the page; port 0 picks a free one.")
    ] = "127.0.0.1:8470",
    foxglove: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Also serve Foxglove, e.g. at 127.0.0.1:8765.")
    ] = None,
    overwrite: Overwrite = False,
    board: BoardFile = None,
) -> None:
    """Run the pipeline on a real radar, or on a recording in real time, and show the result on a local web page.

    Ctrl-C ends it.
    """
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
    frames = session.live.losses.frames
    print(f"{frames} frames, {1e3 * session.live.busy / max(frames, 1):.1f} ms each")


@app.command()
def recover(
    part: Annotated[Path, typer.Argument(metavar="REC.h5.part", help="File that an interrupted program left.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Recording to write; default: REC.h5.")] = None,
) -> None:
    """Recover an interrupted recording: all whole frames, up to a second before the program was killed."""
    from radarize.io.recording import recover

    print_summary(recover(part, output))


@app.command()
def calibrate(
    recording: RecordingFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Board file (board.yaml) or radar configuration (.cfg) to write.")
    ],
    target: Annotated[
        float | None,
        typer.Option(metavar="M", help="Distance of a corner reflector straight ahead, m; the radar stands still."),
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
    """Print what a recording contains."""
    from radarize.evaluation.report.contents import contents, show

    found = contents(recording)
    print(json.dumps(found, indent=2)) if as_json else show(found)


@app.command()
def check(
    recording: RecordingFile,
    fix: Annotated[
        Path | None,
        typer.Option(metavar="OUTPUT", help="Write a corrected recording (.h5) or board file (.yaml)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find faults of a recording: I and Q, antennas, chirps, frames, time stamps. Exit code 1 if there are any.

    Ten seconds of a walk are sufficient: radarize check walk.h5
    """
    from radarize.io.load import load
    from radarize.pipeline.check.check import check

    with load(recording) as source, working("checking"):
        found = check(source, fix)
    print(found.to_json() if as_json else found)
    if fix is not None:
        typer.echo(f"written: {fix}", err=True)
    raise typer.Exit(0 if found.well else 1)
