"""The command lines: instant help, one sentence and exit code 2 for whatever goes wrong, what an interrupt keeps."""

import errno
import json
import os
import re
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from radarize import __version__
from radarize import cli as radarize_cli
from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.io.recording import RecordingWriter
from radarize.radar.presets import PRESETS
from radarsim import cli as radarsim_cli
from tests.disk import disk

APPS = {"radarize": radarize_cli.app, "radarsim": radarsim_cli.app}


def call(capsys, command: str, *arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command."""
    name, *rest = command.split()
    with pytest.raises(SystemExit) as exit_:
        run(APPS[name], name, [*rest, *map(str, arguments)])
    out, err = capsys.readouterr()
    return exit_.value.code, out, err


def small_recording(path: Path, frames: int = 2) -> Path:
    config = PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 8})
    with RecordingWriter(path, config, attributes={"scene": "nowhere"}) as writer:
        valid = np.ones((frames, 2, 3), bool)
        valid[0, 0, 0] = False
        writer.append(np.zeros((frames, *config.frame_shape), np.int16), np.arange(frames) / 30, valid)
    return path


@pytest.mark.parametrize("name", APPS)
def test_help_is_instant(name):
    """Measured in processor time, which does not depend on other processes."""
    seconds = []
    for _ in range(3):
        before = os.times()
        done = subprocess.run([Path(sys.executable).parent / name, "--help"], capture_output=True, text=True)
        after = os.times()
        seconds.append(after.children_user + after.children_system - before.children_user - before.children_system)
        assert done.returncode == 0 and "Usage" in done.stdout
    assert min(seconds) < 0.7


@pytest.mark.parametrize(
    "command",
    ["radarize import", "radarize info", "radarize run", "radarize slam", "radarize train", "radarize evaluate",
     "radarize check", "radarize config", "radarize report", "radarize benchmark", "radarize export", "radarize view",
     "radarsim simulate", "radarsim dataset", "radarsim calibrate", "radarsim twin", "radarsim scene",
     "radarsim scene info", "radarsim scene preview", "radarsim scene import", "radarsim export", "radarsim emulate",
     "radarsim schema", "radarsim doctor"],
)  # fmt: skip
def test_every_command_explains_itself(capsys, command):
    code, out, _ = call(capsys, command, "--help")
    assert code == 0 and "Usage" in out


@pytest.mark.parametrize("name", APPS)
def test_version(capsys, name):
    assert call(capsys, name, "--version") == (0, f"{name} {__version__}\n", "")


@pytest.mark.parametrize(
    ("command", "group"),
    [
        ("radarize train", "radarize.tasks"),
        ("radarize run", "radarize.odometry"),
        ("radarize run", "radarize.scans"),
        ("radarize export", "radarize.exporters"),
        ("radarsim export", "radarize.exporters"),
    ],
)
def test_help_names_every_part_that_is_installed(capsys, command, group):
    _, out, _ = call(capsys, command, "--help")
    words = set(re.split(r"[^\w-]+", out))
    assert {point.name for point in entry_points(group=group)} <= words


@pytest.mark.parametrize(
    ("command", "arguments", "expected"),
    [
        ("radarize info", ["missing.h5"], "missing.h5: no such file"),
        ("radarize run", ["missing.h5", "-o", "out"], "missing.h5: no such file"),
        ("radarize evaluate", ["nowhere"], "has no trajectory.tum"),
        ("radarize report", ["missing.h5"], "missing.h5: no such file"),
        ("radarize import", ["missing.bin", "-o", "out.h5"], "missing.bin"),
        ("radarize import", ["missing.bin", "-o", "out.h5", "--rx", "a,b"], "--rx is 'a,b', expected a count"),
        ("radarize import", ["missing.bin", "-o", "out.h5", "--config", "bogus"], "bogus: no such radar configuration"),
        ("radarize export", ["missing.h5", "--format", "tum", "-o", "x"], "missing.h5: no such file"),
        ("radarize export", ["x.h5", "--format", "wav", "-o", "x"], "export format is 'wav', expected one of bin"),
        ("radarize view", ["missing.h5", "--save", "x.rrd"], "missing.h5: no such file"),
        ("radarize info", [], "Missing argument"),
        ("radarize info", ["a", "--bogus"], "No such option"),
        ("radarize fly", [], "No such command"),
        ("radarsim simulate", ["castle", "-o", "out.h5"], "castle"),
        ("radarsim simulate", ["office", "-o", "out.h5", "--duration", "0"], "duration is 0"),
        ("radarsim simulate", ["office", "-o", "out.h5", "--platform", "drone"], "drone"),
        ("radarsim simulate", ["office", "-o", "out.h5", "--frontend", "no.yaml"], "no.yaml: no such file"),
        ("radarsim dataset", ["missing.yaml", "-o", "out"], "no specification 'missing.yaml', expected"),
        ("radarsim calibrate", ["missing.h5", "-o", "board.yaml"], "missing.h5: no such file"),
        ("radarsim twin", ["missing.h5", "--scene", "office", "-o", "twin.h5"], "missing.h5: no such file"),
        ("radarsim export", ["missing.h5", "--format", "tum", "-o", "x.tum"], "missing.h5: no such file"),
        ("radarsim scene info", ["castle"], "castle"),
        ("radarsim scene import", ["castle.glb", "-o", "out"], "castle.glb: no such file"),
        ("radarsim scene import", ["castle.glb"], "Missing option"),
    ],
)
def test_bad_input_is_one_sentence(capsys, tmp_path, monkeypatch, command, arguments, expected):
    monkeypatch.chdir(tmp_path)
    code, out, err = call(capsys, command, *arguments)
    assert code == 2
    assert expected in err and "Traceback" not in err and len(err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "x.h5"), "x.h5: no space left on the device"),
        (PermissionError(errno.EACCES, "Permission denied", "/x"), "/x: Permission denied"),
        (MemoryError("Unable to allocate 9 GiB"), "not enough memory (Unable to allocate 9 GiB)"),
        (ValueError("odd\nsecond line"), "internal error, ValueError: odd; --debug"),
        (InputError("x is 1, expected 2"), "radarsim: x is 1, expected 2"),
        (KeyboardInterrupt(), "stopped; nothing was written"),
    ],
)
def test_errors_of_libraries_are_one_sentence(capsys, monkeypatch, tmp_path, error, expected):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr("radarize.io.exporters.export", fail)
    code, _, err = call(capsys, "radarsim export", tmp_path / "a.h5", "--format", "tum", "-o", tmp_path / "b")
    assert code == 2 and expected in err and "Traceback" not in err
    with pytest.raises((type(error), SystemExit)):
        run(APPS["radarsim"], "radarsim", ["export", "a.h5", "--format", "tum", "-o", "b", "--debug"])


def test_debug_shows_the_traceback():
    command = [sys.executable, "-m", "radarize.cli", "info", "missing.h5", "--debug"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode != 0 and "Traceback" in done.stderr and "InputError" in done.stderr


def test_an_interrupt_reports_what_was_kept(capsys, monkeypatch, tmp_path):
    def interrupted(scene, output, **_):
        config = PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 8})
        with RecordingWriter(output, config) as writer:
            writer.append(np.zeros((3, *config.frame_shape), np.int16), np.arange(3) / 30)
            raise KeyboardInterrupt

    monkeypatch.setattr("radarsim.api.simulate_to", interrupted)
    path = tmp_path / "walk.h5"
    code, _, err = call(capsys, "radarsim simulate", "office", "-o", path)
    assert code == 2 and f"stopped; 3 whole frames are kept in {path}" in " ".join(err.split())

    def too_early(*_, **__):
        raise KeyboardInterrupt

    # The old recording is not what this call kept.
    monkeypatch.setattr("radarsim.api.simulate_to", too_early)
    code, _, err = call(capsys, "radarsim simulate", "office", "-o", path)
    assert code == 2 and "stopped; nothing was written" in err


def test_import_hands_over_what_was_typed(capsys, monkeypatch, tmp_path):
    seen = {}

    def record(source, output, given, progress):
        seen.update(vars(given), source=source)
        return small_recording(output)

    monkeypatch.setattr("radarize.io.load.import_recording", record)
    arguments = "--samples 256 --loops 16 --rx 1 --tx 1,3,2 --iq-order qqii --slope 80e12 --frame-period 0.1".split()
    code, out, _ = call(capsys, "radarize import", "a.bin", "-o", tmp_path / "a.h5", *arguments)
    assert code == 0 and "2 frames" in out
    assert seen["overrides"] == {
        "samples": 256, "loops": 16, "rx": 1, "tx": (0, 2, 1), "iq_order": "qqii", "slope": 80e12, "frame_period": 0.1,
    }  # fmt: skip
    assert seen["config"] is None and seen["poses"] is None and seen["start_time"] is None
    axes = ["--shape", "loop,virtual,sample", "--variable", "adc", "--latency", "0.03", "--start-time", "5"]
    call(capsys, "radarize import", "a.npz", "-o", tmp_path / "a.h5", "--config", "radarize", *axes)
    assert (seen["shape"], seen["variable"]) == ("loop,virtual,sample", "adc")
    assert (seen["latency"], seen["start_time"]) == (0.03, 5.0)
    assert seen["config"] == PRESETS["radarize"] and "profileCfg" in seen["cfg_text"]


def test_info(capsys, tmp_path):
    path = small_recording(tmp_path / "small.h5")
    code, out, _ = call(capsys, "radarize info", path, "--json")
    found = json.loads(out)
    assert code == 0
    assert found["frames"] == 2 and found["lost_chirps"] == 1
    assert found["derived"]["range_resolution"] == pytest.approx(299792458 / 2 / (80e12 * 8 / 2.285e6))
    assert found["data_sets"]["radar/time"]["unit"] == "s" and found["attributes"]["scene"] == "nowhere"
    code, out, _ = call(capsys, "radarize info", path)
    assert code == 0 and "2 frames" in out and "range_resolution" in out and "nowhere" in out


def test_info_shows_attributes_as_they_are(capsys, tmp_path):
    """Text that looks like markup, an emoji or a terminal's control sequence is shown as it is."""
    odd = {"[imu]": "a [bold]plate[/bold]", "closing": "[/x]", "smile": ":smile:", "red": "\x1b[31mred"}
    path, config = tmp_path / "[b]odd[imu].h5", PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 8})
    with RecordingWriter(path, config, attributes=odd) as writer:
        writer.append(np.zeros((1, *config.frame_shape), np.int16), np.zeros(1))
    code, out, err = call(capsys, "radarize info", path)
    assert (code, err) == (0, "")
    for words in (path.name, "[imu]", "a [bold]plate[/bold]", "[/x]", ":smile:", "\\x1b[31mred"):
        assert words in out
    assert "\x1b" not in out


def test_a_full_disk_is_one_sentence(tmp_path):
    source = small_recording(tmp_path / "small.h5", frames=2000)
    with disk(tmp_path / "disk", 64) as folder:
        command = [
            Path(sys.executable).parent / "radarsim",
            "export",
            source,
            "--format",
            "bin",
            "-o",
            folder / "x.bin",
        ]
        done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "x.bin" in done.stderr and "space" in done.stderr.lower() and "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
