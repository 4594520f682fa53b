"""`radarize train`: from a folder of recordings to a file of weights."""

import csv
import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.features.table import Table
from radarize.methods.registry import find_task
from radarize.methods.task import Settings, Task
from radarize.nets.export import export_onnx
from radarize.nets.weights import save
from radarize.replacing import replacing
from radarize.training.dataset import recordings
from radarize.training.team import team
from radarize.training.trainer import Trainer

#: Without a split, every so manieth recording validates.
_TENTH = 10


def train(
    kind: str,
    data: Path,
    output: Path,
    *,
    split: str | None = None,
    settings: Settings | None = None,
    device: str | None = None,
    workers: int = 1,
    resume: bool = False,
    onnx: bool = False,
    progress: Callable[..., None] = lambda *where: None,
    say: Callable[[str], None] = lambda line: None,
) -> Path:
    """Train a network on recordings, alone or as one of the processes that `torchrun` started.

    Args:
        kind: a key of `radarize.methods.registry.TASKS`.
        data: folder of recordings, of samples or of maps.
        output: weights to write (.safetensors). The log is beside it (.csv), and so is the checkpoint of the last
            epoch (.checkpoint) until training has ended.
        split: of the data set; every tenth recording validates if None.
        settings: hyper-parameters; the task's own if None.
        device: ``cpu`` or ``cuda``; a GPU where there is one if None.
        workers: processes that read.
        resume: go on from the checkpoint, if there is one.
        onnx: write the network as ONNX as well.
        progress: called with (stage, done, in all).
        say: takes a line for every epoch.

    Returns:
        the weights' path.

    Raises:
        InputError: unusable data or settings, a checkpoint that was not to be resumed or does not fit, or a loss that
            is no number.
    """
    task, output, data = find_task(kind), Path(output), Path(data)
    settings = settings or task.defaults
    _check(kind, settings, output)
    checkpoint = output.with_suffix(".checkpoint")
    if checkpoint.exists() and not resume:
        raise InputError(f"{checkpoint}: is left of a training that did not end; --resume goes on, or remove it")
    with team(device) as crew:
        lead = crew.rank == 0
        report, note = (progress, say) if lead else (_nothing, _nothing)
        parts = _read(task, data, split, settings.seed, workers, report)
        _fit(Trainer(task, settings, *parts, crew), output, data, split, resume, onnx, report, note)
    return output


def _fit(
    trainer: Trainer,
    output: Path,
    data: Path,
    split: str | None,
    resume: bool,
    onnx: bool,
    progress: Callable[..., None],
    say: Callable[[str], None],
) -> None:
    checkpoint, log = output.with_suffix(".checkpoint"), output.with_suffix(".csv")
    network = trainer.task.network
    about = {"kind": network.kind, "setting": network.setting, "data": data.resolve().name, "split": split}
    lead, settings = trainer.team.rank == 0, trainer.settings
    if resume and checkpoint.exists():
        trainer.restore(checkpoint, about)
        say(f"resuming after epoch {len(trainer.history)}")
    trainer.team.wait()  # before the first one replaces what the others read
    while not trainer.finished:
        found = trainer.train_epoch(partial(progress, "training"))
        if lead:
            trainer.save(checkpoint, about)
            _write_log(trainer.history, log)
            say(_words(found))
    if lead:
        metrics = trainer.finish()
        header = trainer.task.header(
            settings, trainer.training.grid, data=about["data"], split=split, spacings=tuple(trainer.spacings),
            epochs=len(trainer.history), metrics=metrics,
        )  # fmt: skip
        save(trainer.net, header, output)
        if onnx:
            export_onnx(trainer.net, header, output.with_suffix(".onnx"))
        checkpoint.unlink(missing_ok=True)
        say("calibrated: " + _words(metrics))
    trainer.team.wait()


def _words(numbers: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.5g}" for name, value in numbers.items())


def _nothing(*where) -> None:
    pass


def _read(
    task: Task, data: Path, split: str | None, seed: int, workers: int, progress: Callable[..., None]
) -> tuple[Table, Table]:
    """Training and validation data."""
    if split is None:
        found = recordings(data)
        if len(found) < 2:
            raise InputError(f"{data}: holds one recording, expected at least two, one of which validates")
        apart = set(np.random.default_rng(seed).permutation(len(found))[: max(1, len(found) // _TENTH)])
        parts = [[p for k, p in enumerate(found) if (k in apart) == held] for held in (False, True)]
    else:
        parts = [recordings(data, split, part) for part in ("train", "validation")]
    return task.table(parts[0] + parts[1], workers, progress).divide(len(parts[0]))


def _check(kind: str, settings: Settings, output: Path) -> None:
    for name in ("width", "frames", "epochs", "batch", "rate", "plateau", "patience"):
        if not (value := getattr(settings, name)) > 0:
            raise InputError(f"{name} is {value}, expected a positive number")
    if kind in ("rotation", "milliego") and settings.frames < 2:
        raise InputError(f"frames is {settings.frames}, expected at least two to move between")
    for name, known in (("schedule", ("plateau", "cosine", "steps")), ("precision", ("float32", "bfloat16"))):
        if (value := getattr(settings, name)) not in known:
            raise InputError(f"{name} is {value!r}, expected one of: {', '.join(known)}")
    if settings.seed < 0:
        raise InputError(f"seed is {settings.seed}, expected no negative number")
    if output.is_dir() or output.suffix != ".safetensors":
        raise InputError(f"output is {output}, expected a file NAME.safetensors")


def _write_log(history: list[dict[str, float]], path: Path) -> None:
    text = io.StringIO()
    rows = csv.DictWriter(text, history[0])
    rows.writeheader()
    rows.writerows(history)
    with replacing(path) as part:
        part.write_text(text.getvalue())
