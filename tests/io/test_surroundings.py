"""Environment of a command: file names, working folder, shared memory, and early interrupts."""

import errno
import os
import shutil
import signal
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import pytest

from radarize.io import entry, errors
from radarize.io.replacing import write_whole

ROOT = Path(__file__).parents[2]
COMMAND = [sys.executable, "-c", "import sys; from radarize.io.entry import radarize; radarize()"]


def command(*words, **options):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run([*COMMAND, *words], capture_output=True, env=environment, timeout=120, **options)


def test_names_that_are_no_utf8(tmp_path, monkeypatch):
    from radarize.io.recording import RecordingWriter
    from tests.io.test_damaged import ADC, TIMES
    from tests.virtual import SMALL

    name = os.fsencode(tmp_path) + b"/walk \xff.h5"
    with RecordingWriter(os.fsdecode(name), SMALL) as writer:
        writer.append(ADC, TIMES)
    done = command("report", name)
    assert done.returncode == 0 and done.stdout.strip() == name.replace(b".h5", b".html"), done.stderr
    assert r"Recording walk \udcff.h5" in Path(os.fsdecode(done.stdout.strip())).read_text(encoding="utf-8")
    assert command("info", name).returncode == 0
    refused = command("info", name + b"x")
    assert refused.returncode == 2 and b"no such file" in refused.stderr and b"internal" not in refused.stderr


def test_text_is_written_whatever_it_holds(tmp_path):
    assert write_whole(tmp_path / "a.txt", "a \udcff").read_bytes() == b"a \\udcff"


def test_a_working_folder_that_was_deleted(tmp_path):
    gone = tmp_path / "gone"
    begin = "from radarize.io.entry import radarize; radarize()"
    script = f"mkdir {gone}; cd {gone}; rmdir {gone}; exec {sys.executable} -c '{begin}' info a.h5"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, env=environment, timeout=120)
    assert done.returncode == 2
    assert done.stderr == "radarize: the working folder was deleted, expected an existing one: cd to another\n"


def test_shared_memory_that_is_full(monkeypatch):
    """Semaphores are unnamed files in shared memory."""
    error = OSError(errno.ENOSPC, "No space left on device")
    usage = namedtuple("usage", "total used free")
    for free, words in (
        (0, "/dev/shm: no space left on the device, expected room"),
        (1 << 30, "no space left on the device"),
    ):
        monkeypatch.setattr(shutil, "disk_usage", lambda path, free=free: usage(1 << 30, 0, free))
        monkeypatch.setattr(errors, "SHARED_MEMORY", "/dev/shm" if os.path.isdir("/dev/shm") else "/")
        assert errors.of_system(error).startswith(words)


def test_ctrl_c_while_it_begins(monkeypatch, capsys):
    def interrupted(name):
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(entry, "import_module", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(SystemExit) as ended:
            entry.radarize()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended.value.code == 2 and capsys.readouterr().err == "\nradarize: stopped; nothing was written\n"
