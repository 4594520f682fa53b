"""`radarize.baselines` can be deleted: the rest is imported, runs and is tested without it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from radarize.io.plugins import Plugins

ROOT = Path(__file__).parents[1]
#: Editable installation, whose finder maps the package to its folder.
ALONE = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder).lower()]
"""
IMPORT_ALL = f"""{ALONE}
import pkgutil
from importlib import import_module
import radarize
from radarize.io.importers.format import FORMATS
from radarize.learning.task import TASKS
from radarize.pipeline.methods import ODOMETRY, SCANS
assert radarize.__file__.startswith(sys.argv[1])
for module in pkgutil.walk_packages(radarize.__path__, "radarize."):
    if not module.name.endswith("__main__"):
        import_module(module.name)
assert not [name for name in sys.modules if name.startswith("radarize.baselines")]
print(*ODOMETRY, *SCANS, *(of.noun for of in FORMATS.values()), *(type(of).__name__ for of in TASKS.values()))
"""


@pytest.fixture(scope="module")
def core(tmp_path_factory) -> dict[str, str]:
    """Environment of a copy of the package without the folder."""
    folder = tmp_path_factory.mktemp("core")
    left_out = shutil.ignore_patterns("baselines", "__pycache__")
    shutil.copytree(ROOT / "radarize", folder / "radarize", ignore=left_out)
    for about in ROOT.glob("*.egg-info"):  # entry points
        shutil.copytree(about, folder / about.name)
    return {**os.environ, "PYTHONPATH": str(folder)}


def test_every_module_is_imported_without_it(core, tmp_path):
    command = [sys.executable, "-c", IMPORT_ALL, core["PYTHONPATH"]]
    done = subprocess.run(command, env=core, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    listed = done.stdout.split()
    assert "fused" in listed and "segmentation" in listed and ".bin" in listed
    assert not {"milliego", "rnin", "published", "radarhd", "pictures"} & {*listed}


def test_a_method_of_it_is_then_refused(core, tmp_path):
    code = (
        f"{ALONE}\nfrom radarize.io.plugins import Plugins\nPlugins('radarize.odometry', 'odometry').find('milliego')"
    )
    done = subprocess.run([sys.executable, "-c", code], env=core, cwd=tmp_path, capture_output=True, text=True)
    assert "odometry milliego: radarize.baselines.milliego.odometry:METHOD cannot be imported" in done.stderr


def test_what_is_installed_is_what_the_sources_declare():
    """Each entry point can be imported here."""
    for group in ("odometry", "scans", "tasks", "importers", "exporters", "benchmarks"):
        parts = Plugins(f"radarize.{group}", group)
        assert len(parts) > 3 and all(parts[name] is not None for name in parts)


def test_other_tests_and_modules_do_not_name_it():
    ours = {ROOT / "tests" / name for name in ("test_baselines.py", "test_architecture.py")}
    for folder in ("tests", "radarize", "radarsim"):
        for path in (ROOT / folder).rglob("*.py"):
            if "baselines" not in path.parts and path not in ours:
                assert not re.search(r"(from|import) radarize\.baselines", path.read_text()), path
