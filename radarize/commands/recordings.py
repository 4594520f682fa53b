"""Commands that make recordings, and say what they hold."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.commands.app import (
    AsJson,
    Baud,
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
from radarize.console import progress, until_interrupted, working
from radarize.errors import InputError


def _antennas(text: str | None, option: str) -> int | tuple[int, ...] | None:
    """A count (``3``), or TI's antenna numbers (``1,3,2``) as 0-based ones."""
    if text is None:
        return None
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option} is {text!r}, expected a count (3) or antenna numbers (1,3,2)") from None
    return numbers[0] if len(numbers) == 1 else tuple(number - 1 for number in numbers)


def _angles(text: str | None, option: str) -> tuple[float, float, float] | None:
    """Roll, pitch, yaw."""
    if text is None:
        return None
    try:
        roll, pitch, yaw = map(float, text.split())
    except ValueError:
        raise InputError(f"{option} is {text!r}, expected three numbers: roll pitch yaw in degrees") from None
    return roll, pitch, yaw


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
):
    """Make a recording from a capture of a real radar."""
    fields = {
        "samples": samples, "loops": loops, "rx": _antennas(rx, "--rx"), "tx": _antennas(tx, "--tx"),
        "iq_order": iq_order, "board": board, "start_frequency": start_frequency, "slope": slope,
        "sample_rate": sample_rate, "idle_time": idle_time, "adc_start_time": adc_start_time,
        "ramp_end_time": ramp_end_time, "frame_period": frame_period,
    }  # fmt: skip
    overrides = {name: value for name, value in fields.items() if value is not None}
    from radarize.importers import Given, import_recording
    from radarize.radar.presets import load_config
    from radarize.recording import keeping

    radar, text = load_config(config) if config is not None else (None, "")
    given = Given(
        radar, text, overrides, start_time, poses, shape, variable, latency, walk, align, encoding, layout,
        _angles(imu_turn, "--imu-turn"),
    )  # fmt: skip
    with keeping(output), progress("import") as report:
        tell(import_recording(source, output, given, progress=report))


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
):
    """Record a real radar: IWR1843BOOST with a DCA1000. Whatever ends it, Ctrl-C too, leaves a whole file."""
    from radarize.capture.record import record
    from radarize.recording import spare

    if not overwrite:
        spare(output, anything=True)
    sensor = _sensor(config, port, baud, host, dca, command_port, data_port)
    most = _frames_within(duration, frames, sensor.config.frame_period)
    with until_interrupted() as stopping, progress("capture") as report, sensor:
        record(sensor, output, stopping, frames=most, overwrite=overwrite, progress=report)
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
    every: Annotated[
        int | None, typer.Option(min=1, help="Follow every so many-th frame; by default as the networks were taught.")
    ] = None,
    address: Annotated[str, typer.Option(help="Where to show the page; port 0 is any.")] = "127.0.0.1:8470",
    foxglove: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Serve Foxglove as well, e.g. 127.0.0.1:8765.")
    ] = None,
    overwrite: Overwrite = False,
):
    """Run the pipeline on a real radar, or on a recording in real time, and show it on a local page. Ctrl-C ends it."""
    from contextlib import ExitStack

    from radarize.capture.live import Live, prepare
    from radarize.capture.page import Page
    from radarize.capture.record import recording
    from radarize.capture.replay import Replay
    from radarize.methods.registry import Inputs, best_methods, pace
    from radarize.recording import spare

    if output and not overwrite:
        spare(output, anything=True)
    if replay and (config or port):
        raise InputError(f"--replay {replay} is given with --config or --port, expected one of the two")
    stream = Replay(replay) if replay else _sensor(config, port, baud, host, dca, command_port, data_port)
    radar, methods = stream.config, best_methods(stream.config)[0]
    chosen = {"odometry": odometry or methods["odometry"], "scans": scans or methods["scans"]}
    keeper = None
    with until_interrupted() as stopping, ExitStack() as stack:
        with working("warming up"):
            inputs = prepare(Inputs(radar, every=every or pace(chosen["odometry"], radar)), chosen)
        server = None
        if foxglove is not None:
            from radarize.foxglove import Server

            server = stack.enter_context(Server(foxglove))
        live = Live(inputs, chosen, stack.enter_context(Page(address)), server)
        report = stack.enter_context(progress("live"))
        stack.enter_context(stream)
        print(f"page: {live.page.url}", flush=True)
        if server is not None:
            print(f"Foxglove: {server.url}", flush=True)
        if output:
            keeper = stack.enter_context(recording(stream, output, overwrite))
        most = _frames_within(duration, frames, radar.frame_period)
        live.run(stream, stopping, frames=most, keeper=keeper, progress=report)
        warnings = live.troubles(stream)
    warn([*warnings, *live.losses.warnings(), *live.pipeline.slam.warnings()])
    print(f"{live.losses.frames} frames, {1e3 * live.busy / max(live.losses.frames, 1):.1f} ms each")


@app.command()
def recover(
    part: Annotated[Path, typer.Argument(metavar="REC.h5.part", help="What a program that was killed has left.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Recording to write; else REC.h5.")] = None,
):
    """Make a recording of what is left of one: all whole frames, up to a second before its program was killed."""
    from radarize.recording import recover

    tell(recover(part, output))


def _sensor(config: str | None, port: str | None, baud: int, *network):
    """The sensor that the options of `capture` and `live` describe."""
    from radarize.capture.board import Network
    from radarize.capture.sensor import Sensor
    from radarize.radar.presets import load_config

    for name, value in (("--config", config), ("--port", port)):
        if value is None:
            raise InputError(f"{name} is missing, expected {'a .cfg or a preset' if name == '--config' else 'a TTY'}")
    radar, text = load_config(config)
    return Sensor(radar, text, config, port, baud=baud, network=Network(*network))


def _frames_within(duration: float | None, frames: int | None, period: float) -> int | None:
    limits = [frames, None if duration is None else max(round(duration / period), 1)]
    return min((limit for limit in limits if limit is not None), default=None)


@app.command()
def info(recording: RecordingFile, as_json: AsJson = False):
    """Say what a recording holds."""
    from radarize.contents import contents, show

    found = contents(recording)
    print(json.dumps(found, indent=2)) if as_json else show(found)
