"""`radarize`: the pipeline's command line. Heavy modules load inside the commands, so that --help is instant."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from radarize.console import new_app, print_table, progress, run, until_interrupted, working
from radarize.errors import InputError

app = new_app("Radar-only indoor SLAM on raw I/Q of single-chip mmWave radars.")

RecordingFile = Annotated[Path, typer.Argument(metavar="REC.h5", help="A recording.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="Folder that `radarize run` wrote.")]
Beside = Annotated[list[Path] | None, typer.Option(help="Another run of the same recording; may be repeated.")]
RadarFile = Annotated[str | None, typer.Option("--config", help="A .cfg or a preset's name.")]
PortName = Annotated[str | None, typer.Option("--port", help="The radar's serial command port.")]
Baud = Annotated[int, typer.Option(help="Of the command port.")]
Host = Annotated[str, typer.Option(help="This computer's address, which the DCA1000 sends to.")]
Dca = Annotated[str, typer.Option(help="The DCA1000's address.")]
CommandPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port of the DCA1000's commands.")]
DataPort = Annotated[int, typer.Option(min=1, max=65535, help="UDP port of its samples.")]
Duration = Annotated[float | None, typer.Option(min=0.0, help="End after so many seconds.")]
FrameCount = Annotated[int | None, typer.Option(min=1, help="End after so many frames.")]
Reading = Literal["corrected", "published"]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace a recording that came from a radar, or what was left of one.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def _antennas(text: str | None, option: str) -> int | tuple[int, ...] | None:
    """A count (``3``), or TI's antenna numbers (``1,3,2``) as 0-based ones."""
    if text is None:
        return None
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option} is {text!r}, expected a count (3) or antenna numbers (1,3,2)") from None
    return numbers[0] if len(numbers) == 1 else tuple(number - 1 for number in numbers)


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
    walk: Annotated[int | None, typer.Option(help="Which walk of RadarHD's dataset_5.")] = None,
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
    board: Annotated[str | None, typer.Option(help="Antenna layout, e.g. iwr1843boost.")] = None,
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
    given = Given(radar, text, overrides, start_time, poses, shape, variable, latency, walk, encoding, layout)
    with keeping(output), progress("import") as report:
        _tell(import_recording(source, output, given, progress=report))


def _tell(written: Path) -> None:
    """How many frames a new recording has, and what its attributes warn of."""
    from radarize.recording import Recording

    with Recording(written) as recording:
        for name in ("warnings", "assumed", "found"):
            if text := recording.attributes.get(name):
                typer.echo(f"{name}: {text}", err=True)
        print(f"{written}: {len(recording)} frames")


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
    _tell(output)


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
    from radarize.methods.registry import Inputs, best_methods
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
            inputs = prepare(Inputs(radar), chosen)
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
    _warn([*warnings, *live.losses.warnings(), *live.pipeline.slam.warnings()])
    print(f"{live.losses.frames} frames, {1e3 * live.busy / max(live.losses.frames, 1):.1f} ms each")


@app.command()
def recover(
    part: Annotated[Path, typer.Argument(metavar="REC.h5.part", help="What a program that was killed has left.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Recording to write; else REC.h5.")] = None,
):
    """Make a recording of what is left of one: all whole frames, up to a second before its program was killed."""
    from radarize.recording import recover

    _tell(recover(part, output))


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


@app.command("run")
def run_(
    recording: RecordingFile,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")],
    odometry: Annotated[
        str | None, typer.Option(help="Where motion comes from: fused, learned, doppler or scan-matching.")
    ] = None,
    scans: Annotated[
        str | None, typer.Option(help="How scans are made: segmentation, first-echo, elevation-aware...")
    ] = None,
    settings: Annotated[
        Reading, typer.Option(help="Reading of the paper: published is --odometry published --scans published.")
    ] = "corrected",
    weights: Annotated[
        Path | None, typer.Option(help="Folder of networks' weights; by default the shipped ones.")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="Settings of the pipeline (YAML), see `radarize config`.")] = None,
):
    """Estimate trajectory and map of a recording."""
    from radarize.effort import effort
    from radarize.methods.configuration import Configuration
    from radarize.recording import Recording
    from radarize.run import run
    from radarize.runfolder import RunFolder

    if settings == "published":
        for option, value in (("--odometry", odometry), ("--scans", scans)):
            if value not in (None, "published"):
                raise InputError(f"{option} is {value!r}, expected none with --settings published, which has its own")
        odometry = scans = "published"
    configuration = Configuration() if config is None else Configuration.load(config)
    with Recording(recording) as source:
        words = effort(source.config, len(source)) if source.has_samples else ""
    _warn([words] if words else [])
    with progress("run", f"{output} is as it was before, and so is the recording") as report:
        written = run(
            recording, output, odometry=odometry, scans=scans, weights=weights, configuration=configuration,
            progress=report,
        )  # fmt: skip
    _warn(RunFolder(written).warnings)
    print(written)


def _warn(warnings: list[str]) -> None:
    for words in warnings:
        typer.echo(f"warning: {words}", err=True)


@app.command("config")
def config_():
    """Print all settings of the pipeline as YAML, with what they mean: `radarize config > mine.yaml`."""
    from radarize.methods.configuration import Configuration

    print(Configuration().text(), end="")


@app.command()
def train(
    task: Annotated[
        str, typer.Argument(metavar="TASK", help="translation, rotation, segmentation, radarhd, milliego or rnin.")
    ],
    data: Annotated[Path, typer.Option(help="Folder of recordings, see `radarsim dataset`.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Weights to write (.safetensors).")],
    split: Annotated[str | None, typer.Option(help="Of the data set; else every tenth recording validates.")] = None,
    width: Annotated[int | None, typer.Option(help="Of the network (16); the paper's is 64.")] = None,
    frames: Annotated[int | None, typer.Option(help="That the network sees (2, 2, 1).")] = None,
    epochs: Annotated[int | None, typer.Option(help="At most (30, 30, 5).")] = None,
    batch: Annotated[int | None, typer.Option(help="Items of a step (128, 128, 48).")] = None,
    rate: Annotated[float | None, typer.Option(help="Learning rate (1e-3, 1e-3, 1e-4).")] = None,
    schedule: Annotated[str | None, typer.Option(help="Of the rate: plateau, steps, or cosine for few epochs.")] = None,
    patience: Annotated[int | None, typer.Option(help="Epochs without progress before it ends (15).")] = None,
    precision: Annotated[str | None, typer.Option(help="Of convolutions: float32, or bfloat16.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of everything random (0).")] = None,
    device: Annotated[str | None, typer.Option(help="cpu or cuda; a GPU where there is one.")] = None,
    workers: Annotated[int, typer.Option(help="Processes that read recordings.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where a training was stopped.")] = False,
    onnx: Annotated[bool, typer.Option("--onnx", help="Write the network as ONNX as well.")] = False,
    settings: Annotated[Reading, typer.Option(help="Reading of the paper: corrected, or published.")] = "corrected",
):
    """Train a network on recordings; figures in brackets are the three tasks' defaults.

    On several GPUs: torchrun --nproc-per-node 4 -m radarize.cli train ...
    """
    from dataclasses import replace

    from radarize.methods.registry import find_task
    from radarize.training.train import Options, train

    if onnx:
        import onnxscript  # noqa: F401  missed now, not after the training

    choices = {
        "width": width, "frames": frames, "epochs": epochs, "batch": batch, "rate": rate, "schedule": schedule,
        "patience": patience, "precision": precision, "seed": seed,
    }  # fmt: skip
    given = {name: value for name, value in choices.items() if value is not None}
    task = f"published-{task}" if settings == "published" and not task.startswith("published-") else task
    hyper = replace(find_task(task).defaults, **given)
    with progress("train", "with --resume the same command goes on after the last whole epoch") as report:
        written = train(
            task, data, output, hyper, Options(split, device, workers, resume, onnx),
            progress=report, say=lambda line: typer.echo(line, err=True),
        )  # fmt: skip
    print(written)


@app.command()
def slam(
    scans: Annotated[Path, typer.Argument(metavar="SCANS|RUN", help="Scans (.npz), or a run's folder.")],
    odometry: Annotated[
        Path | None, typer.Argument(metavar="[ODOMETRY]", help="Poses (TUM); else scans alone.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder to write.")] = ...,
    preset: Annotated[str | None, typer.Option(help="radar (of a RUN), lidar (of a file) or cartographer.")] = None,
    config: Annotated[Path | None, typer.Option(help="Settings that differ from the preset (.yaml).")] = None,
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM), for `radarize evaluate`.")] = None,
):
    """Estimate trajectory and map from scans and odometry of any sensor.

    SCANS holds ranges (scan, beam), angle_min, angle_increment, range_max and, unless one a second, times.
    """
    from radarize.log import run
    from radarize.runfolder import RunFolder
    from radarize.slam.config import SlamConfig

    name = preset or ("radar" if scans.is_dir() else "lidar")
    settings = SlamConfig.load(config, name) if config else SlamConfig.preset(name)
    with progress("slam") as report:
        written = run(scans, odometry, output, config=settings, reference=reference, progress=report)
    _warn(RunFolder(written).warnings)
    print(written)


@app.command()
def evaluate(
    run: RunPath,
    beside: Beside = None,
    reference: Annotated[Path | None, typer.Option(help="True poses (TUM); by default the run's own.")] = None,
    as_json: AsJson = False,
):
    """Compare a run with the truth; writes metrics.json."""
    from radarize.evaluation.evaluate import evaluate
    from radarize.report import words
    from radarize.report.run import methods
    from radarize.runfolder import RunFolder

    with working("evaluating"):
        folder, others = RunFolder(run), [RunFolder(other) for other in beside or ()]
        metrics = evaluate(folder, reference)
        compared = [(methods(other), evaluate(other, reference)) for other in others]
        folder.write_metrics(metrics)
    if as_json:
        print(json.dumps(metrics, indent=2))
        return
    for part in words.everything(metrics):
        print(part) if isinstance(part, str) else print_table(*part)
    if compared:
        print_table(*words.beside([(methods(folder), metrics), *compared]))


@app.command()
def export(
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="A recording, or a run's folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File or, of a bag, folder to write.")],
    format: Annotated[
        str, typer.Option(help="bin (DCA1000 and .cfg), ros2 (a bag), tum (poses) or map (for map_server).")
    ],
    run: Annotated[Path | None, typer.Option(help="Run of the recording, for scans and odometry in the bag.")] = None,
):
    """Write a recording or a run for other programs."""
    from radarize.exporters import export

    with progress("export") as report:
        written = export(source, format, output, run=run, progress=report)
    print(written)


@app.command()
def report(
    source: Annotated[Path, typer.Argument(metavar="RUN|REC.h5", help="A run's folder, or a recording.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Page to write (.html).")] = None,
    beside: Beside = None,
):
    """Draw a run or a recording as one HTML page."""
    from radarize.report.recording import report_recording
    from radarize.report.run import report_run

    with working("drawing"):
        written = report_run(source, output, beside or ()) if source.is_dir() else report_recording(source, output)
    print(written)


@app.command()
def benchmark(
    name: Annotated[str, typer.Argument(metavar="NAME", help="list, all, or a benchmark of the list.")],
    data: Annotated[Path | None, typer.Option(help="Folder of recordings, see `radarsim dataset`.")] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder to write; goes on where it was left.")] = None,
    methods: Annotated[
        list[str] | None, typer.Option(help="Odometry and scans to compare, all by default: fused,doppler,threshold.")
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="Folder of networks' weights; by default the shipped ones.")
    ] = None,
    train: Annotated[bool, typer.Option("--train", help="Train networks on each split first.")] = False,
    epochs: Annotated[int | None, typer.Option(min=1, help="Of that training, at most.")] = None,
    protocol: Annotated[str | None, typer.Option(help="paper, or mended; both by default.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; by default one per core.")] = None,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Ray cluster; auto: of this machine.")] = None,
    walks: Annotated[str | None, typer.Option(help="real: walks to judge, 227,230; by default all that test.")] = None,
    predictions: Annotated[
        list[str] | None, typer.Option(metavar="NAME=FOLDER", help="real: what another program says of the walks.")
    ] = None,
    poses: Annotated[Path | None, typer.Option(help="real: folder of true poses, WALK.tum; else by the lidar.")] = None,
):
    """Compare methods on recordings: tables, plots and a page, with the paper's figures beside ours."""
    import os

    from radarize.benchmark.registry import BENCHMARKS

    if name == "list":
        listed = [(each, about.about) for each, about in BENCHMARKS.items()]
        real = ("real", "Points, turns and maps of real walks against a lidar (RadarHD's repository).")
        return print_table(("benchmark", "what it compares"), [*listed, real])
    for option, value in (("--data", data), ("--out", out)):
        if value is None:
            raise InputError(f"{option} is missing, expected a folder")
    if name == "real":
        return _benchmark_real(data, out, weights, walks, predictions or [], poses)
    from radarize.benchmark.run import benchmark as compare
    from radarize.benchmark.study import Options

    chosen = [method for word in methods or () for method in word.split(",")]
    options = Options(chosen, weights, train, epochs, protocol, workers or len(os.sched_getaffinity(0)), ray)
    with progress("benchmark", f"what has ended is kept in {out}, and the same command goes on after it") as report:
        published = compare(name, data, out, options, progress=report, say=lambda line: typer.echo(line, err=True))
    for each in published:
        print(out / f"{each}.html")
    print(out / "index.html")


def _benchmark_real(
    data: Path, out: Path, weights: Path | None, walks: str | None, predictions: list[str], poses: Path | None
) -> None:
    from radarize.benchmark.real import SHOWN, Options, real

    numbers = [number.strip() for number in walks.split(",")] if walks else []
    if wrong := [number for number in numbers if not number.isdecimal()]:
        raise InputError(f"--walks names {wrong[0]!r}, expected numbers as in 227,230")
    named = dict(each.partition("=")[::2] for each in predictions)
    for name, folder in named.items():
        if not (name and folder and Path(folder).is_dir()):
            raise InputError(f"--predictions is {name}={folder}, expected NAME=FOLDER of a folder that is there")
    others = {name: Path(each) for name, each in named.items()}
    options = Options([int(number) for number in numbers], others, weights, poses)
    with progress("real") as report:
        results = real(data, out, options, progress=report)
    print_table(*results.tables[0].in_terminal(SHOWN))
    print(out / "real.md")


@app.command()
def view(
    source: Annotated[Path, typer.Argument(metavar="REC.h5|RUN", help="A recording, or a run's folder.")],
    run: Annotated[Path | None, typer.Option(help="Run of the recording, to show with it.")] = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write .rrd, or .mcap for Foxglove, instead of a window.")
    ] = None,
):
    """Look at a recording or a run in the Rerun viewer: maps, poses, scans, depth and causes on one time line."""
    with progress("view") as report:
        if save is not None and save.suffix == ".mcap":
            from radarize.mcap import write_mcap

            written = write_mcap(source, run, save, progress=report)
        else:
            from radarize.viewer import view

            written = view(source, run, save, progress=report)
    if written:
        print(written)


def main() -> None:
    """Entry point of the `radarize` command."""
    run(app, "radarize")


if __name__ == "__main__":
    main()
