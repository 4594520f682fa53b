"""Training loop: an epoch, its validation, a checkpoint, repeated until the validation loss no longer decreases.

All random numbers follow from the seed, the epoch and the step, so that an interrupted training continues from its
checkpoint with the same result: bit for bit on CPUs, while GPUs add in varying order.
"""

import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Generator, Tensor
from torch.optim.lr_scheduler import ReduceLROnPlateau

from radarize.io.errors import InputError
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets import weights
from radarize.learning.task import Settings, Task
from radarize.learning.training.team import Team

#: Share of a cosine schedule in which the rate rises.
_WARM = 0.05
#: Factor of the rate per step of a step schedule, and epochs per step.
_DROP, _LASTS = 0.75, 25


class Trainer:
    """Trains one network.

    Attributes:
        net: the network.
        history: log entries of all epochs so far.
        best: least validation loss so far, and the weights of that epoch.

    Raises:
        InputError: too few frames.
    """

    def __init__(
        self, task: Task[Any], settings: Settings, training: FeatureTable, validation: FeatureTable, team: Team
    ):
        self.task, self.settings, self.team = task, settings, team
        self.training, self.validation = training.on(team.device), validation.on(team.device)
        self.spacings = task.spacings(training.frame_period)
        reach = (settings.frames - 1) * max(self.spacings) + 1
        self._starts = training.starts(reach)
        self._validated = validation.starts(reach)[:: round(1 / task.share)]
        for name, starts in (("training", self._starts), ("validation", self._validated)):
            if len(starts) < 2 * team.size:
                raise InputError(f"{name} has {len(starts)} windows of {reach} frames, expected longer recordings")
        if settings.batch < 2 * team.size:
            raise InputError(
                f"batch is {settings.batch}, expected at least two items for each of {team.size} processes"
            )
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(settings.seed)
            self.net = task.net(settings, training.grid).to(  # type: ignore[call-overload]  # torch's hints lack memory_format
                team.device, memory_format=torch.channels_last
            )
        for module in self.net.modules():
            if hasattr(module, "coarse"):
                module.coarse = settings.precision == "bfloat16"
        self._shared = team.share(self.net)
        self._optimiser = task.optimise(self.net.parameters(), settings)
        self._schedule = ReduceLROnPlateau(self._optimiser, factor=0.5, patience=settings.plateau)
        self.history: list[dict[str, float]] = []
        self.best: tuple[float, dict[str, Tensor]] = (math.inf, {})

    @property
    def steps(self) -> int:
        """Number of steps of an epoch."""
        return max(1, int(self.task.share * len(self._starts)) // self.settings.batch)

    @property
    def finished(self) -> bool:
        """Whether all epochs are done, or the validation loss has not decreased for `patience` epochs."""
        done = len(self.history)
        losses = [epoch["loss"] for epoch in self.history]
        return done >= self.settings.epochs or (
            done > 0 and done - 1 - int(np.argmin(losses)) >= self.settings.patience
        )

    def train_epoch(self, progress: Callable[[int, int], None] = lambda done, total: None) -> dict[str, float]:
        """Train one epoch, then validate.

        Args:
            progress: called with (steps done, steps in all), over all epochs.

        Raises:
            InputError: the loss is not finite.
        """
        began, epoch, settings = time.monotonic(), len(self.history), self.settings
        order, spacings = self._order(epoch)
        self._shared.train()
        total = torch.zeros(())
        for step in range(self.steps):
            self._warm_or_cool(epoch * self.steps + step)
            mine = slice(step * settings.batch + self.team.rank, (step + 1) * settings.batch, self.team.size)
            maps, label = self._items(self.training, order[mine], spacings[mine])
            maps, label = self.task.augment(maps, label, self._generator(epoch, step))
            loss = self.task.loss(self._shared, maps, label).mean()
            if not loss.isfinite():
                raise InputError(
                    f"the loss is {loss.item()} in epoch {epoch + 1}, step {step + 1}: it diverged, expected a smaller "
                    f"--rate than {settings.rate:g}"
                )
            self._optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(self.net.parameters(), self.task.steepest)
            self._optimiser.step()
            total += loss.detach().cpu()
            progress(epoch * self.steps + step + 1, settings.epochs * self.steps)
        self.team.agree(self.net)
        rate = self._optimiser.param_groups[0]["lr"]
        found = self.validate()
        if not math.isfinite(found["loss"]):
            raise InputError(
                f"the validation loss is {found['loss']} after epoch {epoch + 1}, expected a smaller --rate"
            )
        if settings.schedule == "plateau":
            self._schedule.step(found["loss"])
        if found["loss"] < self.best[0]:
            self.best = found["loss"], {name: values.clone() for name, values in self.net.state_dict().items()}
        trained = float(self.team.sum(total)) / self.team.size / self.steps
        seconds = round(time.monotonic() - began, 1)
        self.history.append({"epoch": epoch + 1, "seconds": seconds, "rate": rate, "training_loss": trained, **found})
        return self.history[-1]

    def _warm_or_cool(self, step: int) -> None:
        """Set the rate of a step, for schedules by step: cosine (Loshchilov and Hutter, "SGDR", 2017, without
        restarts), or steps."""
        if self.settings.schedule == "plateau":
            return
        total = self.settings.epochs * self.steps
        if self.settings.schedule == "cosine":
            share = min(1.0, (step + 1) / (_WARM * total)) * (1 + math.cos(math.pi * step / total)) / 2
        else:
            share = _DROP ** (step // self.steps // _LASTS)
        for group in self._optimiser.param_groups:
            group["lr"] = self.settings.rate * share

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """Return metrics on the validation data with the current weights."""
        self.net.eval()
        return self.task.metrics(self.team.sum(self._judged(self.team.rank, self.team.size)) / len(self._validated))

    @torch.no_grad()
    def finish(self) -> dict[str, float]:
        """Load the best weights, calibrate them, and return their metrics. Only for rank 0."""
        self.net.load_state_dict(self.best[1])
        self.net.eval()
        self.task.calibrate(self.net, self._validation(0, 1))
        return self.task.metrics(self._judged(0, 1).cpu() / len(self._validated))

    def _judged(self, rank: int, size: int) -> Float[Tensor, "number"]:
        """Return sums of the task's evaluation of validation items; each process evaluates a part of them."""
        judged = (self.task.judge(self.net, *batch).double().sum(dim=0) for batch in self._validation(rank, size))
        return sum(judged, start=torch.zeros(()))

    def save(self, path: Path, about: dict) -> None:
        """Write a checkpoint.

        Args:
            path: file, replaced as a whole.
            about: properties that `restore` compares.
        """
        state = self._optimiser.state_dict()
        tensors = {f"net/{name}": values for name, values in self.net.state_dict().items()}
        tensors |= {f"best/{name}": values for name, values in self.best[1].items()}
        for number, moments in state["state"].items():
            tensors |= {f"adam/{number}/{name}": values for name, values in moments.items()}
        progress = {
            "best_loss": self.best[0],
            "history": self.history,
            "groups": state["param_groups"],
            "schedule": self._schedule.state_dict(),
        }
        weights.write(tensors, {**about, "settings": asdict(self.settings), "progress": progress}, path)

    def restore(self, path: Path, about: dict) -> None:
        """Continue from a checkpoint.

        Raises:
            InputError: unreadable, or of another training: only number of epochs and patience may differ.
        """
        tensors, found = weights.read(path)
        flexible = ("patience",) if self.settings.schedule == "cosine" else ("epochs", "patience")
        expected = {**about, **{n: v for n, v in asdict(self.settings).items() if n not in flexible}}
        for name, value in expected.items():
            other = {**found, **found.get("settings", {})}.get(name)
            if (list(value) if isinstance(value, tuple) else value) != other:
                raise InputError(
                    f"{path}: is of a training with {name} {other!r}, expected {value!r}; omit --resume or remove it"
                )
        progress = found["progress"]
        best: dict[str, Tensor] = {}
        moments: defaultdict[int, dict[str, Tensor]] = defaultdict(dict)
        parts: dict[str, dict[str, Tensor]] = {"net": {}, "best": best}
        for name, values in tensors.items():
            group, _, rest = name.partition("/")
            if group == "adam":
                number, _, moment = rest.partition("/")
                moments[int(number)][moment] = values
            else:
                parts[group][rest] = values.to(self.team.device)
        self.net.load_state_dict(parts["net"])
        self._optimiser.load_state_dict({"state": moments, "param_groups": progress["groups"]})
        self._schedule.load_state_dict(progress["schedule"])
        self.best = progress["best_loss"], best
        self.history = progress["history"]

    def _order(self, epoch: int) -> tuple[Tensor, Tensor]:
        """Return windows of an epoch and their spacings, the same for all processes."""
        rng = np.random.default_rng((self.settings.seed, epoch))
        order = self._starts[torch.from_numpy(rng.permutation(len(self._starts)))]
        return order, torch.from_numpy(rng.choice(np.asarray(self.spacings), len(order)))

    def _generator(self, epoch: int, step: int) -> Generator:
        seed = np.random.SeedSequence((self.settings.seed, epoch, step, self.team.rank)).generate_state(1, np.uint64)
        return Generator(self.team.device).manual_seed(int(seed[0] >> 1))

    def _items(self, table: FeatureTable, starts: Tensor, spacings: Tensor) -> tuple[Any, Tensor]:
        inputs, label = self.task.items(table, starts, spacings, self.settings.frames)
        device = self.team.device
        inputs = tuple(each.to(device) for each in inputs) if isinstance(inputs, tuple) else inputs.to(device)
        return inputs, label.to(device)

    def _validation(self, rank: int, size: int) -> Iterator[tuple[Any, Tensor]]:
        mine = self._validated[rank::size]
        spacing = torch.tensor(self.spacings[-1])
        for starts in mine.split(self.settings.batch):
            yield self._items(self.validation, starts, spacing.expand(len(starts)))
