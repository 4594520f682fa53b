"""Steps: once each, whatever happens in between."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from radarize.evaluation.benchmark.steps import FOUND, kept, perform
from radarize.io.errors import InputError

ROOT = Path(__file__).parents[3]


@dataclass(frozen=True)
class Note:
    """A step that writes down that it was done, and by which process."""

    name: str
    of: int = 0
    seconds: float = field(default=0.0, compare=False)
    trouble: str = field(default="", compare=False)
    alone: bool = False
    frames: int = 10

    @property
    def place(self) -> str:
        return f"notes/{self.name}"

    def identity(self) -> dict[str, object]:
        return {"of": self.of}

    def do(self, folder: Path, report) -> dict[str, object]:
        if self.trouble:
            raise InputError(self.trouble)
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "log").open("a") as log:
            log.write(f"{os.getpid()}\n")
        time.sleep(self.seconds)
        report(1.0)
        return {"pair": (self.name, self.of)}


def log(step: Note, output: Path) -> list[int]:
    """Processes that did a step."""
    path = output / step.place / "log"
    return [int(line) for line in path.read_text().split()] if path.is_file() else []


def test_each_once_and_in_order(tmp_path):
    steps = [Note("a"), Note("b", trouble="nothing there"), Note("c", alone=True), Note("a")]
    moved = []
    found = perform(steps, tmp_path, 1, lambda *where: moved.append(where))
    assert found == {steps[0]: {"pair": ["a", 0]}, steps[1]: "nothing there", steps[2]: {"pair": ["c", 0]}}
    assert moved[0] == (0, 30) and moved[-1] == (30, 30) and moved == sorted(moved)
    assert perform(steps, tmp_path, 1, lambda *where: None) == found
    assert [len(log(step, tmp_path)) for step in steps[:3]] == [1, 0, 1]


def test_what_a_step_depends_on_counts(tmp_path):
    for of in (1, 1, 2):
        perform([Note("a", of)], tmp_path, 1, lambda *where: None)
    assert len(log(Note("a"), tmp_path)) == 2
    (tmp_path / "notes" / "a" / FOUND).write_text('{"of": {"of"')  # cut short
    assert kept(Note("a", 2), tmp_path) is None
    assert perform([Note("a", 2)], tmp_path, 1, lambda *where: None) == {Note("a", 2): {"pair": ["a", 2]}}


SCRIPT = """
import sys
from pathlib import Path
from radarize.evaluation.benchmark.steps import perform
from tests.evaluation.benchmark.test_steps import STEPS
if __name__ == "__main__":
    perform(STEPS, Path(sys.argv[1]), 2, lambda *where: None)
"""
#: Quick ones, two that a killed run is at, and one that it does not come to.
STEPS = [Note("a"), Note("b"), Note("c", seconds=600), Note("d", seconds=600), Note("e")]


def test_a_killed_run_goes_on(tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    run = subprocess.Popen([sys.executable, tmp_path / "script.py", tmp_path], env=environment)
    wait(lambda: log(STEPS[2], tmp_path) and log(STEPS[3], tmp_path))
    workers = {*log(STEPS[2], tmp_path), *log(STEPS[3], tmp_path)}
    assert len(workers) == 2
    run.send_signal(signal.SIGKILL)
    run.wait()
    wait(lambda: not any(alive(worker) for worker in workers))
    assert [kept(step, tmp_path) is not None for step in STEPS] == [True, True, False, False, False]
    rest = [Note(step.name) for step in STEPS]
    assert len(perform(rest, tmp_path, 2, lambda *where: None)) == 5
    assert [len(log(step, tmp_path)) for step in STEPS] == [1, 1, 2, 2, 1]
    assert json.loads((tmp_path / "notes" / "c" / FOUND).read_text())["found"] == {"pair": ["c", 0]}


def alive(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait(condition, patience: float = 120.0) -> None:
    deadline = time.monotonic() + patience
    while not condition():
        if time.monotonic() > deadline:
            pytest.fail("waited in vain")
        time.sleep(0.1)
