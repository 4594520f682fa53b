"""Training from a folder of recordings to a file of weights, as `radarize train` does."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from radarize.io.errors import InputError
from radarize.io.replacing import replacing
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets.export import export_onnx
from radarize.learning.nets.weights import load, save
from radarize.learning.task import Settings, Task, find_task
from radarize.learning.training.dataset import recordings
from radarize.learning.training.team import team
from radarize.learning.training.trainer import Trainer

#: Without a split, every N-th recording is used for validation.
_TENTH = 10


@dataclass(frozen=True)
class TrainOptions:
    """Options of a training run.

    Attributes:
        split: split of the data set; None: every 10th recording is used for validation.
        device: ``cpu`` or ``cuda``; None: a GPU if available.
        workers: number of processes that read.
        resume: continue from the checkpoint, if there is one.
        start: initial weights, of a network of the same task, instead of random ones; they determine width, frames and
            grid, and recordings may come from any radars.
        onnx: also write the network as ONNX.
    """

    split: str | None = None
    device: str | None = None
    workers: int = 1
    resume: bool = False
    onnx: bool = False
    start: Path | None = None


def train(
    kind: str,
    data: Path,
    output: Path,
    settings: Settings | None = None,
    options: TrainOptions | None = None,
    *,
    progress: Callable[..., None] = lambda *where: None,
    log: Callable[[str], None] = lambda line: None,
) -> Path:
    """Train a network on recordings, in a single process or in one of those that `torchrun` started.

    Args:
        kind: a key of `radarize.learning.task.TASKS`.
        data: folder of recordings, of samples or of maps.
        output: weights to write (.safetensors). The log (.csv) is written beside it, and the checkpoint of the last
            epoch (.checkpoint) until training has ended.
        settings: hyper-parameters; None: those of the task.
        options: options of the run.
        progress: called with (stage, done, in all).
        log: called with a line for every epoch, and if this processor is slow with the precision.

    Raises:
        InputError: unusable data or settings, an existing checkpoint without `resume` or of other settings, or a loss
            that is not finite.
    """
    task, output, data, options = find_task(kind), Path(output), Path(data), options or TrainOptions()
    settings = settings or task.defaults
    begun, before = load(options.start, task.network) if options.start else (None, None)
    if before is not None:
        settings = replace(settings, width=before.width, frames=before.frames)
    _check(task, settings, output)
    checkpoint, log_file = output.with_suffix(".checkpoint"), output.with_suffix(".csv")
    if checkpoint.exists() and not options.resume:
        raise InputError(
            f"{checkpoint}: belongs to an interrupted training; continue it with --resume, or remove the file"
        )
    network = task.network
    about = {"kind": network.kind, "setting": network.setting, "data": data.resolve().name, "split": options.split}
    if before is not None and options.start is not None:
        about |= {"start": options.start.name, "data": f"{before.data}, then {about['data']}"}
    with team(options.device) as crew:
        lead = crew.rank == 0
        progress, log = (progress, log) if lead else (_nothing, _nothing)
        if settings.precision == "bfloat16" and crew.device.type == "cpu" and not _has_bfloat16():
            log("precision bfloat16: this processor emulates it, several times slower than float32")
        parts = _read(task, data, options, settings.seed, progress, before.grid if before else None)
        trainer = Trainer(task, settings, *parts, crew)
        if begun is not None:
            trainer.net.load_state_dict(begun.state_dict())
        if options.resume and checkpoint.exists():
            trainer.restore(checkpoint, about)
            log(f"resuming after epoch {len(trainer.history)}")
        crew.wait()  # until all have read the checkpoint, which rank 0 replaces
        while not trainer.finished:
            found = trainer.train_epoch(partial(progress, "training"))
            if lead:
                trainer.save(checkpoint, about)
                with replacing(log_file) as part:
                    pd.DataFrame(trainer.history).to_csv(part, index=False)
                log(_words(found))
        if lead:
            metrics = trainer.finish()
            header = task.header(
                settings, trainer.training.grid, data=about["data"], split=options.split,
                spacings=tuple(trainer.spacings), metrics=metrics,
                hours=round(trainer.training.duration / 3600 + (before.hours if before else 0.0), 4),
                epochs=len(trainer.history) + (before.epochs if before else 0),
            )  # fmt: skip
            save(trainer.net, header, output)
            if options.onnx:
                export_onnx(trainer.net, header, output.with_suffix(".onnx"))
            checkpoint.unlink(missing_ok=True)
            log("calibrated: " + _words(metrics))
        crew.wait()
    return output


def _has_bfloat16() -> bool:
    """Whether this processor has instructions for bfloat16, or PyTorch is too old to list them."""
    capabilities = getattr(torch.cpu, "get_capabilities", None)
    return capabilities is None or any(there for name, there in capabilities().items() if "bf16" in name)


def _words(numbers: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.5g}" for name, value in numbers.items())


def _nothing(*where: object) -> None:
    pass


def _read(
    task: Task, data: Path, options: TrainOptions, seed: int, progress: Callable[..., None], grid: MapGrid | None
) -> tuple[FeatureTable, FeatureTable]:
    """Read training and validation data, resampled to a grid if given."""
    if options.split is None:
        found = recordings(data)
        if len(found) < 2:
            raise InputError(f"{data}: has one recording, expected at least two, one of them for validation")
        apart = set(np.random.default_rng(seed).permutation(len(found))[: max(1, len(found) // _TENTH)])
        parts = [[p for k, p in enumerate(found) if (k in apart) == held] for held in (False, True)]
    else:
        parts = [recordings(data, options.split, part) for part in ("train", "validation")]
    return task.table(parts[0] + parts[1], options.workers, progress, grid).divide(len(parts[0]))


def _check(task: Task, settings: Settings, output: Path) -> None:
    for name in ("width", "frames", "epochs", "batch", "rate", "plateau", "patience"):
        if not (value := getattr(settings, name)) > 0:
            raise InputError(f"{name} is {value}, expected a positive number")
    if settings.frames < task.least_frames:
        raise InputError(
            f"frames is {settings.frames}, expected at least {task.least_frames} for a motion between them"
        )
    for name, known in (("schedule", ("plateau", "cosine", "steps")), ("precision", ("float32", "bfloat16"))):
        if (value := getattr(settings, name)) not in known:
            raise InputError(f"{name} is {value!r}, expected one of: {', '.join(known)}")
    if settings.seed < 0:
        raise InputError(f"seed is {settings.seed}, expected a number of at least 0")
    if output.is_dir() or output.suffix != ".safetensors":
        raise InputError(f"output is {output}, expected a file NAME.safetensors")
