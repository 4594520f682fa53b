"""Commands that train networks and compare methods."""

from pathlib import Path
from typing import Annotated, Any

import typer

from radarize.cli.app import BoardFile, Reading, app, names
from radarize.io.console import print_table, progress
from radarize.io.errors import InputError


@app.command()
def train(
    task: Annotated[str, typer.Argument(metavar="TASK", help=f"{names('radarize.tasks')}.")],
    data: Annotated[Path, typer.Option(help="Folder of recordings, see `radarsim dataset`.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Weights file to write (.safetensors).")],
    split: Annotated[
        str | None, typer.Option(help="Split of the data set; by default every 10th recording is for validation.")
    ] = None,
    width: Annotated[int | None, typer.Option(help="Width of the network in channels; 64 in the paper.")] = None,
    frames: Annotated[int | None, typer.Option(help="Frames per input window.")] = None,
    epochs: Annotated[int | None, typer.Option(help="Maximum number of epochs.")] = None,
    batch: Annotated[int | None, typer.Option(help="Batch size: windows per optimiser step.")] = None,
    rate: Annotated[float | None, typer.Option(help="Learning rate.")] = None,
    schedule: Annotated[
        str | None, typer.Option(help="Schedule of the learning rate: plateau, steps, or cosine for few epochs.")
    ] = None,
    patience: Annotated[
        int | None, typer.Option(help="Epochs without lower validation loss after which training ends.")
    ] = None,
    precision: Annotated[str | None, typer.Option(help="Precision of convolutions: float32 or bfloat16.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of initial weights, order and augmentation.")] = None,
    device: Annotated[str | None, typer.Option(help="Device: cpu or cuda; default: a GPU if available.")] = None,
    workers: Annotated[int, typer.Option(help="Number of processes that read recordings.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted training.")] = False,
    onnx: Annotated[bool, typer.Option("--onnx", help="Also write the network as ONNX.")] = False,
    start: Annotated[
        Path | None, typer.Option(help="Initial weights; recordings may then come from any radars.")
    ] = None,
    settings: Annotated[
        Reading, typer.Option(help="Variant of the paper's method: corrected, or published.")
    ] = "corrected",
    board: BoardFile = None,
) -> None:
    """Train a network on recordings. Options that are not given have the defaults of the task.

    On several GPUs: torchrun --nproc-per-node 4 -m radarize.cli train ...
    """
    import os
    from dataclasses import replace

    from radarize.io.recording.reader import BOARD
    from radarize.learning.task import find_task
    from radarize.learning.training.train import TrainOptions, train
    from radarize.radar.boards import load_board

    if board:
        os.environ[BOARD] = str(load_board(board) and board.resolve())  # inherited by reading processes
    if onnx:
        import onnxscript  # noqa: F401  fails before the training if missing, not after it

    choices = {
        "width": width, "frames": frames, "epochs": epochs, "batch": batch, "rate": rate, "schedule": schedule,
        "patience": patience, "precision": precision, "seed": seed,
    }  # fmt: skip
    given: dict[str, Any] = {name: value for name, value in choices.items() if value is not None}
    task = f"published-{task}" if settings == "published" and not task.startswith("published-") else task
    hyper = replace(find_task(task).defaults, **given)
    with progress("train", "the same command with --resume continues after the last complete epoch") as report:
        written = train(
            task, data, output, hyper, TrainOptions(split, device, workers, resume, onnx, start),
            progress=report, log=lambda line: typer.echo(line, err=True),
        )  # fmt: skip
    print(written)


@app.command()
def benchmark(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of a benchmark; list prints them, all runs all.")],
    data: Annotated[Path | None, typer.Option(help="Folder of recordings, or of bags.")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder to write; finished parts in it are reused.")
    ] = None,
    methods: Annotated[
        list[str] | None,
        typer.Option(
            help="Odometry and scan methods to compare, e.g. fused,doppler,threshold; default: all that read samples."
        ),
    ] = None,
    weights: Annotated[
        Path | None, typer.Option(help="Folder with network weights; by default the shipped ones.")
    ] = None,
    train: Annotated[bool, typer.Option("--train", help="Train the networks on each split first.")] = False,
    epochs: Annotated[int | None, typer.Option(min=1, help="Maximum number of epochs of that training.")] = None,
    protocol: Annotated[str | None, typer.Option(help="paper, or mended; both by default.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Number of processes; by default one per core.")] = None,
    ray: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Address of a Ray cluster; auto: of this machine.")
    ] = None,
    walks: Annotated[
        str | None, typer.Option(help="real: numbers of the walks, e.g. 227,230; by default the test set.")
    ] = None,
    predictions: Annotated[
        list[str] | None, typer.Option(metavar="NAME=FOLDER", help="real: results of another program on the walks.")
    ] = None,
    poses: Annotated[
        Path | None, typer.Option(help="real: folder of true poses, WALK.tum; by default from the lidar.")
    ] = None,
) -> None:
    """Compare methods on recordings: tables, plots and a page, with the paper's values beside ours."""
    import os

    from radarize.evaluation.benchmark.study import BENCHMARKS, Options, OwnBenchmark

    if name == "list":
        return print_table(("benchmark", "what it compares"), [(each, of.about) for each, of in BENCHMARKS.items()])
    for option, value in (("--data", data), ("--out", out)):
        if value is None:
            raise InputError(f"{option} is missing, expected a folder")
    assert data is not None and out is not None
    if name in BENCHMARKS and isinstance(own := BENCHMARKS[name], OwnBenchmark):
        given = {"weights": weights, "walks": walks, "poses": poses, "workers": workers, "ray": ray}
        return own.compare(data, out, predictions=predictions or [], **given)
    from radarize.evaluation.benchmark.run import benchmark as compare

    chosen = [method for word in methods or () for method in word.split(",")]
    options = Options(chosen, weights, train, epochs, protocol, workers or len(os.sched_getaffinity(0)), ray)
    with progress("benchmark", f"finished parts are kept in {out}; the same command continues") as report:
        published = compare(name, data, out, options, progress=report, say=lambda line: typer.echo(line, err=True))
    for each in published:
        print(out / f"{each}.html")
    print(out / "index.html")
