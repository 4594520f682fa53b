"""A third-party package, installed by pip: its methods and its format are found without a change of our files."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from radarize.io.recording import Recording, RecordingWriter
from radarize.io.tum import read_tum
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.cfg import write_cfg
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from tests.echoes import record

PLUGIN = Path(__file__).parents[2] / "examples" / "plugin"


@pytest.fixture(scope="module")
def radarize(tmp_path_factory):
    """The command with the package installed; without it the same arguments end in an error."""
    folder = tmp_path_factory.mktemp("installed")
    shutil.copytree(PLUGIN, folder / "source")
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*install, "--target", folder / "site", folder / "source"], check=True)

    def run(*arguments, plugin: bool = True) -> subprocess.CompletedProcess:
        path = os.pathsep.join([*([str(folder / "site")] if plugin else []), *sys.path])
        command = [sys.executable, "-m", "radarize.cli", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path})

    return run


@pytest.fixture(scope="module")
def words(tmp_path_factory) -> Path:
    """Frames of a point target 3 m ahead, as a file that only the plug-in can read."""
    config = PRESETS["radarize"].model_copy(update={"loops": 8})
    stamps, point = np.arange(4) * config.frame_period, np.array([[3.0, 0.0, 0.0]])
    still = lambda t: (np.zeros((*t.shape, 3)), np.zeros(t.shape))  # noqa: E731
    file = tmp_path_factory.mktemp("words") / "point.words"
    record(config, still, point, np.array([900.0]), stamps, np.random.default_rng(0), noise=3.0).tofile(file)
    file.with_suffix(".cfg").write_text(write_cfg(config))
    return file


def test_its_format_is_read_and_its_method_runs(radarize, words, tmp_path):
    done = radarize("import", words, "-o", tmp_path / "point.h5")
    assert done.returncode == 0, done.stderr
    with Recording(tmp_path / "point.h5") as recording:
        assert recording.adc(0, 4).tobytes() == words.read_bytes()
    arguments = "run", tmp_path / "point.h5", "-o", tmp_path / "run", "--odometry", "doppler", "--scans", "nearby"
    done = radarize(*arguments)
    assert done.returncode == 0, done.stderr
    ahead = np.abs(BEARINGS).argmin()
    assert RunFolder(tmp_path / "run").scans["ranges"][:, ahead] == pytest.approx(3.0, abs=0.1)
    assert "nearby" in radarize("run", "--help").stdout


def test_its_odometry_runs(radarize, tmp_path):
    """A radar that moves at 0.6 m/s forward and 0.3 m/s to the left, among 25 points 2 to 4 m away."""
    config, rng = PRESETS["radarize"], np.random.default_rng(0)
    stamps, angles = np.arange(8) * config.frame_period, np.radians(np.arange(-60, 61, 5))
    move = lambda t: (t[..., None] * [0.6, 0.3, 0.0], np.zeros(t.shape))  # noqa: E731
    points = rng.uniform(2, 4, (25, 1)) * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(25)])
    frames = record(config, move, points, np.full(25, 300.0), stamps, rng, noise=3.0)
    with RecordingWriter(tmp_path / "moving.h5", config) as writer:
        writer.append(frames, stamps)
    arguments = "run", tmp_path / "moving.h5", "-o", tmp_path / "run", "--odometry", "straight", "--scans", "nearby"
    done = radarize(*arguments)
    assert done.returncode == 0, done.stderr
    velocity = RunFolder(tmp_path / "run").scans["velocity"]
    assert velocity.mean(axis=0) == pytest.approx([0.6, 0.3], abs=0.03)
    time, pose = read_tum(tmp_path / "run" / "odometry.tum")
    assert pose[-1, :2] == pytest.approx(velocity.mean(axis=0) * (time[-1] - time[0]), abs=0.005)


def test_the_how_to_quotes_its_odometry():
    text = (PLUGIN / "nearby" / "odometry.py").read_text()
    quoted = text[text.index("class ") : text.index("METHOD")].strip()
    assert quoted in (PLUGIN.parents[1] / "docs" / "howto" / "method.md").read_text()


def test_without_it_both_are_refused(radarize, words, tmp_path):
    done = radarize("import", words, "-o", tmp_path / "point.h5", plugin=False)
    assert done.returncode == 2 and "unknown format, expected" in done.stderr
    done = radarize("run", tmp_path / "point.h5", "-o", tmp_path / "run", "--scans", "nearby", plugin=False)
    assert done.returncode == 2


def test_damaged_files_are_refused_by_the_plug_in(radarize, words, tmp_path):
    short = tmp_path / "short.words"
    short.write_bytes(words.read_bytes()[:-2])
    shutil.copy(words.with_suffix(".cfg"), short.with_suffix(".cfg"))
    done = radarize("import", short, "-o", tmp_path / "short.h5")
    assert done.returncode == 2 and "expected frames of" in done.stderr
