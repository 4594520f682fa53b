"""Installed package: built like a published one, used outside of the repository."""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from radarize import __version__
from radarize.io.extras import EXTRAS
from radarize.radar.boards import BOARDS
from radarsim.dataset import physics
from tests.documents.pages import commands

ROOT = Path(__file__).parents[1]
#: What the locked packages bring along in any case: numba's and matplotlib's.
ALWAYS_THERE = {"contourpy", "llvmlite"}
HIDDEN = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Hidden())
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from the sdist, which is built from a copy, so that nothing comes along that only this checkout has."""
    folder = tmp_path_factory.mktemp("build")
    source = folder / "source"
    for name in ("radarize", "radarsim", "scenes", "docs"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.iterdir():
        if file.is_file() and file.name != ".git":
            shutil.copy(file, source)
    build = "from setuptools import build_meta; print(build_meta.build_sdist('..'))"
    subprocess.run([sys.executable, "-c", build], cwd=source, check=True, capture_output=True)
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, f"radarize-{__version__}.tar.gz"], cwd=folder, check=True)
    return next(folder.glob("*.whl"))


def _take_kernels(packages: Path) -> None:
    """Kernels that the checkout has compiled, for sources of the same stamps: compiling takes minutes."""
    for name in ("radarize", "radarsim"):
        for source in (ROOT / name).rglob("*.py"):
            shutil.copystat(source, packages / source.relative_to(ROOT))
        for pattern in ("*.nb[ic]", "*.sources"):
            for kernel in (ROOT / name).rglob(f"__pycache__/{pattern}"):
                if (packages / kernel.relative_to(ROOT)).parent.is_dir():  # not of a folder that is gone
                    shutil.copy2(kernel, packages / kernel.relative_to(ROOT))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A function that types a command where the wheel is, beside the locked packages and nothing else."""
    folder = tmp_path_factory.mktemp("elsewhere")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    python = folder / "venv" / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel]
    subprocess.run(pip, check=True)
    packages = next((folder / "venv" / "lib").glob("python*/site-packages"))
    _take_kernels(packages)
    (packages / "locked.pth").write_text(sysconfig.get_path("purelib") + "\n")
    hidden = folder / "hidden"
    hidden.mkdir()
    (hidden / "sitecustomize.py").write_text(HIDDEN.format(names=EXTRAS["sim"] - ALWAYS_THERE))

    def type_(command: str, simulator: bool = True) -> subprocess.CompletedProcess:
        bare = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "NUMBA_CACHE_DIR")}
        environment = bare if simulator else bare | {"PYTHONPATH": str(hidden)}
        return subprocess.run(
            [python.parent / command.split()[0], *command.split()[1:]],
            cwd=folder, env=environment, capture_output=True, text=True,
        )  # fmt: skip

    type_.folder = folder
    return type_


def test_the_wheel_holds_what_the_repository_does(wheel):
    found = set(zipfile.ZipFile(wheel).namelist())
    scenes = {f"radarsim/scenes/{path.relative_to(ROOT / 'scenes')}" for path in (ROOT / "scenes").rglob("*.*")}
    weights = {
        f"radarize/learning/weights/{path.name}" for path in (ROOT / "radarize" / "learning" / "weights").iterdir()
    }
    boards = {f"radarize/radar/boards/{name}.yaml" for name in BOARDS}
    pages = {"radarize/capture/live.html", "radarize/evaluation/report/templates/page.html"}
    types = {f"{package}/{name}" for package in ("radarize", "radarsim") for name in ("__init__.py", "py.typed")}
    assert found >= scenes | weights | boards | pages | types
    assert {name.split("/")[0] for name in found} == {"radarize", "radarsim", f"radarize-{__version__}.dist-info"}
    assert wheel.stat().st_size < 20e6


@pytest.fixture(scope="module")
def walked(installed) -> Path:
    """Folder of a walk that was simulated there, and of its run."""
    for command in (
        "radarsim simulate office -o walk.h5 --duration 0.4",
        "radarize run walk.h5 -o run",
        "radarize report run",
    ):
        done = installed(command)
        assert done.returncode == 0, done.stderr
    return installed.folder


def test_simulate_run_and_report_anywhere(walked, installed):
    assert {"trajectory.tum", "map.yaml", "report.html"} <= {path.name for path in (walked / "run").iterdir()}
    listed = installed("radarsim scene info nowhere")
    assert listed.returncode == 2 and "office" in listed.stderr and "stress/corner" in listed.stderr
    unknown = installed("radarsim dataset nothing -o data")
    assert unknown.returncode == 2 and "evaluation" in unknown.stderr


def test_the_page_on_python_runs_anywhere(walked, installed):
    """Each block of ``docs/howto/python.md`` is a script, in order, on the walk that is there."""
    blocks = [block for block in commands("docs/howto/python.md") if block.script]
    assert len(blocks) == 4
    for block in blocks:
        (walked / "block.py").write_text(block.text)
        done = installed("python block.py")
        assert done.returncode == 0, f"{block.text}\n{done.stderr}"


def test_its_physics_are_the_checkouts(installed):
    """Data sets go on with either."""
    done = installed("python -c print(__import__('radarsim.dataset.physics').dataset.physics.digest())")
    assert done.stdout.strip() == physics.digest(), done.stderr


def test_the_pipeline_needs_nothing_of_the_simulator(walked, installed):
    done = installed("radarize run walk.h5 -o alone", simulator=False)
    assert done.returncode == 0, done.stderr
    assert (walked / "alone" / "trajectory.tum").read_bytes() == (walked / "run" / "trajectory.tum").read_bytes()


@pytest.mark.parametrize(
    "command",
    ["simulate office -o x.h5", "dataset small -o x", "scene info office", "emulate office"],
)
def test_what_needs_the_simulator_names_how_to_get_it(walked, installed, command):
    done = installed(f"radarsim {command}", simulator=False)
    assert done.returncode == 2, done.stderr
    assert "pip install 'radarize[sim]'" in done.stderr and done.stderr.count("\n") == 1


def test_the_simulators_help_needs_nothing(installed):
    assert installed("radarsim simulate --help", simulator=False).returncode == 0
