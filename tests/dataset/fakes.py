"""Fake tasks that make small recordings without simulation, and fail on request."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.recording import RecordingWriter
from radarize.radar.presets import PRESETS
from radarsim.dataset.task import ATTRIBUTE, Task
from tests.disk import fill

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 8})


@dataclass(frozen=True)
class FakeTask(Task):
    """Attributes:
    trouble: ``killed once``, ``killed``, ``fails``, ``breaks``, ``full disk``, ``small rooms``, ``slow``, or none.
    """

    trouble: str = ""

    def make(self, folder: Path, progress=None) -> str:
        if self.trouble == "fails":
            raise InputError(f"{self.name}: no room to move")
        if self.trouble == "breaks":
            raise ZeroDivisionError("odd")
        if self.trouble == "small rooms":
            raise InputError(f"{self.name}: no space left for a desk")
        if self.trouble == "full disk":
            fill(folder / "others")
        rng = np.random.default_rng(self.seed)
        with RecordingWriter(self.path(folder), CONFIG, attributes={ATTRIBUTE: self.identity}) as writer:
            for k in range(self.frames):
                writer.append(rng.integers(-9, 9, (1, *CONFIG.frame_shape), np.int16), np.array([k / 30]))
                progress(k + 1, self.frames)
                if self.trouble.startswith("killed") and k == 1:
                    tried = folder / f"{self.name}.tried"
                    if self.trouble == "killed" or not tried.exists():
                        tried.touch()
                        os.kill(os.getpid(), signal.SIGKILL)
                if self.trouble == "slow":
                    time.sleep(0.5)
        return "1 m"


def fake(name: str, trouble: str = "", frames: int = 4) -> FakeTask:
    """Task that takes no time."""
    return FakeTask(
        name=name, building="A", floor=None, platform="cart", scene={}, duration=1.0, frames=frames,
        seed=sum(name.encode()), radar="radarize", frontend=None, settings="", sensors=(), storage="raw",
        trouble=trouble,
    )  # fmt: skip


class FakeSpecification:
    """List of tasks in place of a specification."""

    def __init__(self, *tasks: Task):
        self.tasks = tasks

    def as_data(self) -> dict:
        """Empty specification data."""
        return {"splits": {}}
