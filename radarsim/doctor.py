"""Check of the machine: what simulation needs, what is missing, and the command that installs it.

``python -m radarsim.doctor --missing-packages`` prints the missing system packages. `setup.sh` calls it before any
Python package is installed, so everything beyond the standard library is imported late. ``python -m radarsim.doctor
--first-frame`` simulates a frame, which compiles the simulator: the last step of set-up.
"""

import ctypes
import importlib.metadata
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.extras import EXTRAS
from radarsim.machine import llvm

#: Shared libraries that Python packages load from the system (all of them open3d's), and their Debian packages.
LIBRARIES = {
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libudev.so.1": "libudev1",
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libidn2.so.0": "libidn2-0",
}
#: Command that installs the Python packages: the checkout's set-up, or pip where there is none.
REPAIR = "./setup.sh" if Path(__file__).parents[1].joinpath("setup.sh").is_file() else "pip install 'radarize[sim]'"
PACKAGES = ("torch", "sionna-rt", "mitsuba", "drjit", "gtsam", "open3d", "numba", "h5py", "evo")
#: Required disk space, bytes; a recording of a minute takes about a quarter of it.
FREE_DISK = 2e9

# Runs in its own process, because the failure it tests for aborts the process.
_RAY_TEST = """
from radarsim.machine import llvm
llvm.require()
import mitsuba as mi
mi.set_variant("llvm_ad_mono_polarized")
scene = mi.load_dict({"type": "scene", "wall": {"type": "rectangle"}})
hit = scene.ray_intersect(mi.Ray3f(o=[0, 0, 2], d=[0, 0, -1]))
assert abs(hit.t[0] - 2) < 1e-5, hit.t
import sionna.rt
print("Mitsuba's llvm_ad_mono_polarized variant hits a wall; Sionna RT imports")
"""


@dataclass(frozen=True)
class Finding:
    """One line of the check.

    Attributes:
        what: component that is checked.
        state: ``"ok"``, ``"missing"`` (required) or ``"optional"`` (missing, but not required).
        detail: result of the check.
        remedy: command that fixes it, if any.
    """

    what: str
    state: str
    detail: str
    remedy: str = ""


def missing_packages() -> list[str]:
    """Names of missing system packages (Debian, Ubuntu); empty on systems other than Linux."""
    if platform.system() != "Linux":
        return []
    packages = [] if llvm.find() else [llvm.PACKAGE]
    return packages + [package for library, package in LIBRARIES.items() if not _loads(library)]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
        return True
    except OSError:
        return False


def findings() -> list[Finding]:
    """Run all checks; takes a few seconds."""
    return [
        _python(),
        *(_package(name) for name in PACKAGES),
        *(_extra(name) for name in EXTRAS if name != "sim"),
        _llvm(),
        *(_library(library) for library in LIBRARIES if platform.system() == "Linux"),
        _ray_test(),
        _first_frame(),
        _cuda(),
        _chromium(),
        _disk(),
    ]


def _python() -> Finding:
    found = f"{platform.python_version()}, {sys.prefix}"
    good = sys.version_info >= (3, 11)
    return Finding("Python", "ok" if good else "missing", found, "" if good else "apt-get install python3.11-venv")


def _package(name: str) -> Finding:
    try:
        return Finding(name, "ok", importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return Finding(name, "missing", "not installed", REPAIR)


def _extra(extra: str) -> Finding:
    """The optional packages of an extra of pyproject.toml."""
    lacking = sorted(module for module in EXTRAS[extra] if importlib.util.find_spec(module) is None)
    if not lacking:
        return Finding(f"extra {extra}", "ok", ", ".join(sorted(EXTRAS[extra])))
    remedy = f"pip install 'radarize[{extra}]'"
    return Finding(f"extra {extra}", "optional", f"{', '.join(lacking)} not installed", remedy)


def _llvm() -> Finding:
    try:
        path, major = llvm.require()
    except InputError as error:
        return Finding("LLVM", "missing", str(error).partition("; ")[0], llvm.INSTALL)
    return Finding("LLVM", "ok", f"{major}, {path}")


def _library(library: str) -> Finding:
    if _loads(library):
        return Finding(library, "ok", "loads")
    return Finding(library, "missing", "not found (open3d needs it)", f"apt-get install {LIBRARIES[library]}")


def _tried(what: str, arguments: list[str], longest: float | None = None) -> Finding:
    """Run Python in its own process and return its output; no answer within `longest` s counts as a failure."""
    try:
        done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=longest)
    except subprocess.TimeoutExpired:
        return Finding(what, "missing", f"no answer within {longest:g} s", REPAIR)
    if done.returncode == 0:
        return Finding(what, "ok", done.stdout.strip())
    reason = (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
    return Finding(what, "missing", reason, llvm.INSTALL if "LLVM" in done.stderr else REPAIR)


def _ray_test() -> Finding:
    return _tried("ray test", ["-c", _RAY_TEST], 120)


def first_frame() -> float:
    """Time from start to the first frame of a scene with all features, s; longer if kernels must be compiled."""
    start = time.perf_counter()
    import numpy as np

    from radarize.radar.presets import PRESETS
    from radarsim.motion.walk import Walk
    from radarsim.scenario import Scenario
    from radarsim.world.scene import Scene

    scene = Scene.load("visitors")
    assert len(Scenario(scene, Walk(duration=1.0).through(scene, 0), PRESETS["radarize"]).frames(np.zeros(1)).samples)
    return time.perf_counter() - start


def _first_frame() -> Finding:
    return _tried("first frame", ["-m", "radarsim.doctor", "--first-frame"])


def _cuda() -> Finding:
    if importlib.util.find_spec("torch") is None:
        return Finding("CUDA", "optional", "unknown without torch")
    import torch

    if torch.cuda.is_available():
        return Finding("CUDA", "ok", torch.cuda.get_device_name())
    card = shutil.which("nvidia-smi") is not None
    # The lock file installs the CPU build; this one includes the CUDA libraries.
    remedy = f".venv/bin/pip install --force-reinstall torch=={torch.__version__.split('+')[0]}" if card else ""
    return Finding("CUDA", "optional", "an NVIDIA GPU that torch cannot use" if card else "no NVIDIA GPU", remedy)


def _chromium() -> Finding:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return Finding("Chromium", "ok", path)
    return Finding("Chromium", "optional", "only tests of reports and live page use it", "apt-get install chromium")


def _disk() -> Finding:
    free = shutil.disk_usage(os.getcwd()).free
    found = f"{free / 1e9:.1f} GB free in {os.getcwd()}"
    if free >= FREE_DISK:
        return Finding("disk", "ok", found)
    return Finding("disk", "missing", f"{found}, expected {FREE_DISK / 1e9:.0f} GB or more")


def describe() -> str:
    """Results of the check and installed versions as text for a bug report; the home folder is shown as ``~``."""
    from radarize import __version__

    needed = importlib.metadata.requires("radarize") or []
    names = sorted({re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in needed} - {"radarize"})
    versions = [f"{name} {_package(name).detail}" for name in names if _package(name).state == "ok"]
    lines = [
        f"radarize {__version__}, {platform.platform()}, {os.cpu_count()} cores",
        *(f"- {each.what}: {each.state}, {each.detail}" for each in findings() if each.what not in PACKAGES),
        "- packages: " + ", ".join(versions),
    ]
    return "\n".join(lines).replace(str(Path.home()), "~")


def examine() -> bool:
    """Print the results as a table; return whether everything required is there."""
    from radarize.io.console import print_table, working

    with working("examining this machine"):
        found = findings()
    print_table(("what", "state", "found"), [(each.what, each.state, each.detail) for each in found])
    # Printed outside of the table, without line breaks, so that the commands can be copied.
    for finding in found:
        if finding.remedy:
            print(f"{finding.what} ({finding.state}): {finding.remedy}")
    return not any(finding.state == "missing" for finding in found)


if __name__ == "__main__":
    if sys.argv[1:] == ["--missing-packages"]:
        print(" ".join(missing_packages()))
    elif sys.argv[1:] == ["--first-frame"]:
        print(f"simulated after {first_frame():.1f} s")
    else:
        sys.exit("usage: python -m radarsim.doctor --missing-packages|--first-frame (people type: radarsim doctor)")
