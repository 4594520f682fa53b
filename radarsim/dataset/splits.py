"""Splits into training, validation and test recordings: random, by platform, or by building (paper, section 7)."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from radarize.io.errors import InputError
from radarize.io.plain import Frozen
from radarsim.dataset.task import Task

Members = dict[str, list[str]]
Share = Annotated[float, Field(ge=0, le=1)]


class RandomSplit(Frozen):
    """Drawn anew for each of `folds` splits, called NAME-0, NAME-1, ...

    Attributes:
        kind: of split.
        folds: number of splits.
        train: fraction of the recordings that train.
        validation: fraction that validates.
        test: fraction that tests.
    """

    kind: Literal["random"]
    folds: int = Field(5, gt=0, le=100)
    train: Share = 0.7
    validation: Share = 0.1
    test: Share = 0.2

    @model_validator(mode="after")
    def _whole(self) -> "RandomSplit":
        if abs((total := self.train + self.validation + self.test) - 1) > 1e-6:
            raise ValueError(f"train + validation + test is {total:g}, expected 1")
        return self

    def members(self, name: str, tasks: Sequence[Task], rng: np.random.Generator) -> dict[str, Members]:
        """Parts of each split by its name."""
        ends = np.round(np.cumsum([self.train, self.validation]) * len(tasks)).astype(int)
        found = {}
        for fold in range(self.folds):
            parts = np.split(rng.permutation(len(tasks)), ends)
            found[f"{name}-{fold}"] = {
                part: [tasks[k].name for k in sorted(chosen)]
                for part, chosen in zip(("train", "validation", "test"), parts, strict=True)
            }
        return found


class PlatformSplit(Frozen):
    """Trained on some platforms, tested on others.

    Attributes:
        kind: of split.
        train: platforms that train.
        test: platforms that test; default: all others.
        validation: fraction of the training recordings that validates instead.
    """

    kind: Literal["platform"]
    train: tuple[str, ...] = Field(min_length=1)
    test: tuple[str, ...] | None = None
    validation: Share = 0.1

    def members(self, name: str, tasks: Sequence[Task], rng: np.random.Generator) -> dict[str, Members]:
        """Parts of each split by its name.

        Raises:
            InputError: a platform without recordings, or one in both parts.
        """
        present = sorted({task.platform for task in tasks})
        tested = tuple(p for p in present if p not in self.train) if self.test is None else self.test
        for field, chosen in (("train", self.train), ("test", tested)):
            _require_known(field, chosen, present)
        if both := set(self.train) & set(tested):
            raise InputError(f"{sorted(both)[0]!r} is in train and in test, expected it in one of them")
        training = [task for task in tasks if task.platform in self.train]
        return {name: _parts(training, [t for t in tasks if t.platform in tested], self.validation, rng)}


class BuildingSplit(Frozen):
    """Leave one building out: for each of `held_out` a split NAME-BUILDING, trained on all others.

    Attributes:
        kind: of split.
        held_out: buildings that test, one per split; default: every building.
        validation: fraction of the training recordings that validates instead.
    """

    kind: Literal["building"]
    held_out: tuple[str, ...] | None = None
    validation: Share = 0.1

    def members(self, name: str, tasks: Sequence[Task], rng: np.random.Generator) -> dict[str, Members]:
        """Parts of each split by its name.

        Raises:
            InputError: a building without recordings, or no building left to train on.
        """
        present = sorted({task.building for task in tasks})
        _require_known("held_out", self.held_out or (), present)
        if len(present) < 2:
            raise InputError(f"there is only building {present[0]}, expected another one to train on")
        return {
            f"{name}-{out}": _parts(
                [t for t in tasks if t.building != out], [t for t in tasks if t.building == out], self.validation, rng
            )
            for out in self.held_out or present
        }


def _require_known(field: str, names: Sequence[str], present: Sequence[str]) -> None:
    for name in names:
        if name not in present:
            raise InputError(f"{field} names {name!r}, expected some of: {', '.join(present)}")


def _parts(training: Sequence[Task], tested: Sequence[Task], share: float, rng: np.random.Generator) -> Members:
    chosen = set(rng.permutation(len(training))[: round(share * len(training))])
    return {
        "train": [task.name for k, task in enumerate(training) if k not in chosen],
        "validation": [task.name for k, task in enumerate(training) if k in chosen],
        "test": [task.name for task in tested],
    }


Split = Annotated[RandomSplit | PlatformSplit | BuildingSplit, Field(discriminator="kind")]
