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

from radarize.benchmark.steps import FOUND, kept, perform
from radarize.errors import InputError

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Note:
    """A step that writes down that it was done, and by which process."""

    name: str
    of: int = 0
    seconds: float = field(default=0.0, compare=False)
    trouble: str = field(default="", compare=False)
    alone: bool = False
    frames: int = 10
    together: str | None = None

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

    def do_each(self, places, report) -> dict[Path, dict[str, object] | str]:
        assert len({step.together for step in places.values()}) == 1
        with (next(iter(places)).parent / "units").open("a") as units:
            units.write(",".join(step.name for step in places.values()) + "\n")
        return {folder: step.trouble or step.do(folder, report) for folder, step in places.items()}


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


@pytest.mark.parametrize("workers", [1, 2])
def test_some_are_done_together(tmp_path, workers):
    """All of a kind that have not been done, in one go; one that fails spoils no other."""
    (tmp_path / "notes").mkdir()
    steps = [Note(name, together=name[0]) for name in ("a1", "b1", "a2", "a3", "b2", "c1")] + [Note("d")]
    steps[3] = Note("a3", together="a", trouble="no")
    perform(steps[:1], tmp_path, 1, lambda *where: None)
    moved = []
    found = perform(steps, tmp_path, workers, lambda *where: moved.append(where))
    assert found == {step: step.trouble or {"pair": [step.name, 0]} for step in steps}
    assert sorted((tmp_path / "notes" / "units").read_text().split()) == ["a1", "a2,a3", "b1,b2", "c1"]
    assert [len(log(step, tmp_path)) for step in steps] == [1, 1, 1, 0, 1, 1, 1]
    assert moved[:2] == [(0, 70), (10, 70)] and moved[-1] == (70, 70)


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
from radarize.benchmark.steps import perform
from tests.benchmark.test_steps import STEPS
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
