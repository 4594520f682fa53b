"""Compiled kernels follow the sources of the whole package that they inline."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import radarsim
from radarsim.machine.kernels import drop_stale

FILES = {
    "__init__.py": "from pathlib import Path\nfrom radarsim.machine.kernels import drop_stale\n"
    "drop_stale(Path(__file__).parent)\n",
    "world/__init__.py": "",
    "world/crossing.py": "from numba import njit\n\n@njit\ndef crossing(x):\n    return x + 1\n",
    "propagation/__init__.py": "",
    "propagation/rays.py": "from numba import njit\nfrom rays.world.crossing import crossing\n\n@njit(cache=True)\n"
    "def kernel(x):\n    return 10 * crossing(x)\n",
}
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
from rays.propagation.rays import kernel
print(kernel(1.0), sum(kernel.stats.cache_hits.values()))
"""


@pytest.mark.parametrize("elsewhere", [False, True], ids=["beside the sources", "NUMBA_CACHE_DIR"])
def test_a_changed_source_of_another_folder_recompiles(tmp_path, elsewhere):
    """A kernel is taken from the cache until what it inlines changes, even to a file that is older than the kernel."""
    for name, text in FILES.items():
        path = tmp_path / "rays" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    outside = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment = outside | ({"NUMBA_CACHE_DIR": str(tmp_path / "kernels")} if elsewhere else {})

    def run() -> str:
        command = [sys.executable, "-c", RUN, tmp_path]
        done = subprocess.run(command, env=environment, cwd=Path(__file__).parents[2], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    assert [run(), run()] == ["20.0 0", "20.0 1"]
    assert any((tmp_path / "kernels" if elsewhere else tmp_path / "rays").rglob("*.nbi"))
    inlined = tmp_path / "rays" / "world" / "crossing.py"
    inlined.write_text(FILES["world/crossing.py"].replace("x + 1", "x + 2"))
    os.utime(inlined, (1e9, 1e9))
    assert run() == "30.0 0"


def test_looking_takes_no_time(monkeypatch):
    """At every import of the simulator: below 5 ms."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    package, spent = Path(radarsim.__file__).parent, []
    for _ in range(5):
        begun = time.perf_counter()
        drop_stale(package)
        spent.append(time.perf_counter() - begun)
    assert min(spent) < 5e-3
