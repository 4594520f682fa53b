"""Run of a data set with fake recordings: progress, failures, killed workers, resuming, refusals."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from radarize.io.errors import DiskFull, InputError
from radarize.io.jobs import News
from radarize.io.recording import Recording
from radarsim.dataset import physics, run
from radarsim.dataset.run import make
from tests.dataset.fakes import FakeSpecification, fake

ROOT = Path(__file__).parents[2]


def made(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.h5*")}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Recordings made in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    for name in "abcd":
        fake(name).make(folder, lambda done, total: None)
    return made(folder)


def test_every_recording_is_made_once(undisturbed, tmp_path):
    seen, lines = [], []
    specification = FakeSpecification(*(fake(name) for name in "abcd"))
    arguments = {"workers": 2, "progress": lambda *p: seen.append(p), "log": lines.append}
    outcome = make(specification, tmp_path, **arguments)
    assert sorted(outcome.made) == ["a", "b", "c", "d"] and not outcome.kept and not outcome.failed
    assert seen[0] == (0, 16) and seen[-1] == (16, 16) and seen == sorted(seen)
    assert sorted(lines) == [f"{name}: 1 m" for name in "abcd"]
    assert made(tmp_path) == undisturbed and len(undisturbed) == 4
    again = make(specification, tmp_path, **arguments)
    assert sorted(again.kept) == ["a", "b", "c", "d"] and not again.made and seen[-1] == (16, 16)


def test_failures_do_not_stop_the_others(undisturbed, tmp_path):
    """A bad tour, a bug, and a process that is killed every time: all are reported, and no partial recording stays."""
    tasks = fake("a", "fails"), fake("b", "breaks"), fake("x", "killed"), fake("c"), fake("d")
    lines = []
    outcome = make(FakeSpecification(*tasks), tmp_path, workers=1, log=lines.append)
    assert sorted(outcome.made) == ["c", "d"]
    assert outcome.failed["a"] == "a: no room to move"
    assert outcome.failed["b"] == "b: internal error, ZeroDivisionError: odd"
    assert outcome.failed["x"].startswith("x: its process was killed twice")
    assert "failed: a: no room to move" in lines
    assert made(tmp_path) == {name: undisturbed[name] for name in ("c.h5", "d.h5")}


def test_a_killed_worker_is_replaced_and_its_task_begun_again(tmp_path):
    outcome = make(FakeSpecification(fake("a", "killed once"), fake("b")), tmp_path, workers=1, log=lambda line: None)
    assert sorted(outcome.made) == ["a", "b"] and not outcome.failed
    with Recording(tmp_path / "a.h5") as recording:
        assert len(recording) == 4


def test_half_written_recordings_are_redone(undisturbed, tmp_path):
    specification = FakeSpecification(*(fake(name) for name in "abcd"))
    for name, cut in (("a.h5.part", 5000), ("b.h5", 5000), ("c.h5", None)):  # half-written, cut short, whole
        (tmp_path / name).write_bytes(undisturbed[name[:4]][:cut])
    outcome = make(specification, tmp_path, workers=1, log=lambda line: None)
    assert outcome.kept == ["c"] and sorted(outcome.made) == ["a", "b", "d"]
    assert made(tmp_path) == undisturbed


def test_recordings_of_other_parameters_are_named_and_kept(tmp_path):
    for name in "ab":
        fake(name).make(tmp_path, lambda done, total: None)
    before = made(tmp_path)
    longer = FakeSpecification(fake("a"), fake("b", frames=5))
    with pytest.raises(InputError, match=r"b has frames 4, now 5; --replace makes such recordings again"):
        make(longer, tmp_path)
    assert made(tmp_path) == before
    outcome = make(longer, tmp_path, workers=1, replace=True, log=lambda line: None)
    assert outcome.kept == ["a"] and outcome.made == ["b"]


def test_a_full_disk_ends_the_run(small_disk):
    """In any system language, because the worker's error has a code; a room without space is a different error."""
    tasks = fake("a", "small rooms"), fake("b"), fake("c", "full disk"), fake("d")
    with pytest.raises(DiskFull, match="no space left on the device; 1 of 4 recordings are finished"):
        make(FakeSpecification(*tasks), small_disk, workers=1, log=lambda line: None)


def test_recordings_of_other_physics_are_named_and_made_anew(tmp_path, monkeypatch):
    task = FakeSpecification(fake("a"))
    make(task, tmp_path, workers=1, log=lambda line: None)
    monkeypatch.setattr(physics, "digest", lambda: "other")
    with pytest.raises(InputError, match=r'a has physics "[0-9a-f]{16}", now "other"; --replace makes such recordings'):
        make(task, tmp_path)


def test_physics_are_the_sources_wherever_they_are(tmp_path):
    """The digest is the same after installation, without compiled files; a changed line of propagation changes it, a
    comment, a docstring or a line of a report does not."""
    for package in ("radarsim", "radarize"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "weights"))
    shutil.copytree(ROOT / "scenes", tmp_path / "radarsim" / "scenes")
    digest = physics.digest.__wrapped__
    same = digest(tmp_path)
    assert same == digest(ROOT) == physics.digest()
    for file, old, new, changes in (
        ("radarsim/twin/report.py", "import", "import json\nimport", False),
        ("radarsim/propagation/fields.py", "import numpy as np", "import numpy as np  # changed", False),
        ("radarsim/propagation/fields.py", "The three numbers of an array.", "Three numbers.\n\n    Changed.", False),
        ("radarsim/propagation/fields.py", "return array[0]", "return array[1]", True),
    ):
        before = (tmp_path / file).read_text()
        assert old in before
        (tmp_path / file).write_text(before.replace(old, new, 1))
        assert (digest(tmp_path) != same) == changes, new
        (tmp_path / file).write_text(before)


def test_an_interrupt_loses_nothing(tmp_path, monkeypatch):
    def interrupted(jobs, workers, ray):
        yield News(next(iter(jobs)), ended=True, result="1 m")
        (tmp_path / "b.h5.part").touch()
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "perform", interrupted)
    with pytest.raises(InputError, match="stopped; 1 of 2 recordings are finished in .*; the same command continues"):
        make(FakeSpecification(fake("a"), fake("b")), tmp_path, log=lambda line: None)
    assert list(made(tmp_path)) == ["b.h5.part"]  # to go on from


def test_only_a_held_folder_is_anothers(tmp_path):
    with pytest.raises(BlockingIOError), run._alone(tmp_path):
        raise BlockingIOError("of something else")
    with run._alone(tmp_path), pytest.raises(InputError, match="another program"), run._alone(tmp_path):
        pass


ORPHANS = """
import sys
from pathlib import Path
from tests.dataset.fakes import FakeSpecification, fake
from radarsim.dataset.run import make

if __name__ == "__main__":
    make(FakeSpecification(fake("a"), fake("b", "slow", 40)), Path(sys.argv[1]), workers=2)
"""


def test_workers_end_with_a_killed_parent_and_runs_exclude_each_other(tmp_path):
    script, folder = tmp_path / "script.py", tmp_path / "out"
    script.write_text(ORPHANS)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, script, folder], env=environment)
    part = folder / "b.h5.part"
    waited = time.monotonic() + 60
    while not ((folder / "a.h5").exists() and part.exists()):
        assert time.monotonic() < waited and parent.poll() is None
        time.sleep(0.02)
    tasks = FakeSpecification(fake("a"), fake("b", "slow", 40))
    with pytest.raises(InputError, match="another program is writing there"):
        make(tasks, folder)
    children = subprocess.run(["ps", "--ppid", str(parent.pid), "-o", "pid="], capture_output=True, text=True)
    parent.kill()
    parent.wait()
    waited = time.monotonic() + 5
    while any(Path(f"/proc/{pid}").exists() for pid in children.stdout.split()):
        assert time.monotonic() < waited, "a worker outlives its parent"
        time.sleep(0.02)
    outcome = make(FakeSpecification(fake("a")), folder, workers=1, log=lambda line: None)
    assert outcome.kept == ["a"]
