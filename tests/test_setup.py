"""Set-up: the lock file, the script that applies it, LLVM, and the doctor."""

import ast
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from radarize import __version__
from radarize.io.extras import EXTRAS
from radarsim import doctor
from radarsim.machine import llvm

ROOT = Path(__file__).parents[1]
LOCK = {
    canonicalize_name(name): version
    for name, _, version in (
        line.partition("==") for line in (ROOT / "requirements.lock").read_text().splitlines() if line[:1] != "#"
    )
}


def python(code: str, **environment: str) -> subprocess.CompletedProcess:
    """Run code in a process of its own."""
    inherited = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=inherited | environment, cwd=ROOT
    )


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def names(*lines: str) -> set[str]:
    return {canonicalize_name(Requirement(line).name) for line in lines}


def imported(*packages: str) -> set[str]:
    """Modules of others that files import, wherever in them."""
    found = {
        name.split(".")[0]
        for package in packages
        for path in (ROOT / package).rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names])
    }
    return found - sys.stdlib_module_names - {"radarize", "radarsim"}


def distributions(modules: set[str]) -> set[str]:
    source = importlib.metadata.packages_distributions()
    return {canonicalize_name(name) for module in modules for name in source.get(module, [module])}


def test_what_is_imported_is_declared_and_the_other_way_round():
    """The pipeline's needs in every installation, the simulator's by extra."""
    extras = {extra: names(*lines) for extra, lines in PROJECT["optional-dependencies"].items()}
    optional = extras["ray"] | extras["viewer"] | extras["onnx"]
    always = names(*PROJECT["dependencies"])
    pipeline, both = distributions(imported("radarize")), distributions(imported("radarize", "radarsim"))
    assert pipeline <= always | optional
    assert both <= always | optional | extras["sim"]
    assert not always - both
    assert (optional | extras["sim"]) - both <= {"mapbox-earcut", "rtree", "onnx"}  # trimesh's, and torch's


def test_what_tests_and_benchmarks_import_is_declared():
    folders = ("tests", "benchmarks", "docs")  # and a module that a test writes
    own = {*folders, "own_method", *(path.stem for folder in folders for path in (ROOT / folder).rglob("*.py"))}
    declared = names(
        *PROJECT["dependencies"], *(line for each in PROJECT["optional-dependencies"].values() for line in each)
    )
    assert distributions(imported(*folders) - own) <= declared


def test_every_extras_modules_are_known():
    """Commands with a missing package name its extra."""
    for extra, modules in EXTRAS.items():
        declared = names(*PROJECT["optional-dependencies"][extra]) - names(*PROJECT["dependencies"])
        assert all(declared & distributions({module}) for module in modules)
        assert declared <= distributions(modules)


def test_the_version_is_printed_once():
    assert PROJECT["dynamic"] == ["version"]
    assert f'\nversion: "{__version__}"' in (ROOT / "CITATION.cff").read_text()
    assert re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] == __version__


def test_the_lock_pins_everything_and_names_nothing_else():
    for line in (ROOT / "requirements.lock").read_text().splitlines():
        assert line.startswith("#") or re.fullmatch(r"[A-Za-z0-9._-]+==[0-9][0-9a-z.]*", line), line
    assert LOCK["torch"] == "2.13.0"
    assert not [name for name in LOCK if name.startswith(("nvidia", "cuda", "triton"))]


def test_the_lock_is_complete():
    extras = ("sim", "ray", "viewer", "onnx", "test", "notebooks", "dev")
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in PROJECT["optional-dependencies"][extra])]
    wanted = [Requirement(line) for line in lines if not line.startswith("radarize[")]
    for name in LOCK:
        wanted += [Requirement(text) for text in importlib.metadata.requires(name) or []]
    for requirement in wanted:
        name = canonicalize_name(requirement.name)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            if name not in LOCK and name.startswith(("nvidia", "triton", "cuda")):
                continue  # of a torch built for CUDA; the lock leaves these out on purpose
            assert name in LOCK, f"{requirement} is not locked"
            assert requirement.specifier.contains(LOCK[name]), f"{requirement} against {LOCK[name]}"


def test_this_environment_is_the_locked_one():
    for name, version in LOCK.items():
        assert importlib.metadata.version(name).split("+")[0] == version


@pytest.mark.skipif(not (ROOT / ".venv/.ready").is_file(), reason="this environment was not made by setup.sh")
@pytest.mark.skipif((ROOT / ".venv").is_symlink(), reason=".venv is another checkout's, which setup.sh would replace")
def test_a_second_setup_does_nothing():
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        done = subprocess.run([ROOT / "setup.sh"], capture_output=True, text=True)
        seconds.append(time.perf_counter() - start)
        assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert min(seconds) < 1


def test_what_is_imported_stays_compiled_though_the_shell_forbids_it():
    shown = ["make", "-sC", ROOT, "--eval", "shown: ; @echo $${PYTHONDONTWRITEBYTECODE-nothing}", "shown"]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
    assert subprocess.run(shown, env=environment, capture_output=True, text=True).stdout == "nothing\n"
    assert "\nunset PYTHONDONTWRITEBYTECODE\n" in (ROOT / "setup.sh").read_text()


def test_without_python_setup_prints_what_to_type(tmp_path):
    shutil.copy(ROOT / "setup.sh", tmp_path)
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("sh", "dirname"):
        (tools / name).symlink_to(shutil.which(name))
    done = subprocess.run(["/bin/sh", tmp_path / "setup.sh"], env={"PATH": str(tools)}, capture_output=True, text=True)
    assert done.returncode == 2 and "apt-get install python3 python3-venv" in done.stderr


def test_an_llvm_is_found_and_handed_to_drjit():
    done = python(
        "from radarsim.machine import llvm; llvm.require(); import os; print(os.environ['DRJIT_LIBLLVM_PATH'])"
    )
    assert done.returncode == 0, done.stderr
    assert llvm.version(done.stdout.strip()) >= llvm.OLDEST


@pytest.mark.parametrize("names", [["libLLVM-14.so.1", "libLLVM-15.so"], [], ["libLLVM.so.19.1"]])
def test_unusable_llvms_are_refused_with_the_package(tmp_path, names):
    for name in names:  # the last is called 19, but is no library
        (tmp_path / name).write_text("not a library")
    code = f"from radarsim.machine import llvm; llvm._PATTERNS = ({str(tmp_path)!r} + '/*',); llvm.require()"
    done = python(code)
    assert done.returncode == 1  # an exception, not the abort of a library
    assert "InputError: found" in done.stderr and "apt-get install libllvm19" in done.stderr
    if names[:1] == ["libLLVM-14.so.1"]:
        assert "only LLVM 15" in done.stderr


OLD = [path for major, path in llvm.installed() if 0 < major < llvm.OLDEST]


@pytest.mark.parametrize("path", [*OLD[:1], "/missing.so"])
def test_an_old_llvm_by_name_never_reaches_drjit(path, tmp_path):
    done = python("from radarsim.machine import llvm; llvm.require()", DRJIT_LIBLLVM_PATH=path)
    assert done.returncode == 1 and "InputError" in done.stderr and "libllvm19" in done.stderr and path in done.stderr
    code = "import sys; sys.argv = ['radarsim', *sys.argv[1:]]; from radarsim.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "simulate", "office", "-o", tmp_path / "x.h5", "--duration", "0.1"],
        env=os.environ | {"DRJIT_LIBLLVM_PATH": path},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2 and "libllvm19" in done.stderr and "Cannot select" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not list(tmp_path.iterdir())


def test_the_newest_usable_llvm_is_chosen(monkeypatch, tmp_path):
    for name in ("libLLVM-14.so", "libLLVM.so.19.1", "libLLVM.so.21.1"):
        (tmp_path / name).touch()
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(llvm, "_PATTERNS", (f"{tmp_path}/*",))
    opened = []
    monkeypatch.setattr(llvm, "version", lambda path: opened.append(path) or (19 if "19" in Path(path).name else 0))
    assert llvm.find() == (str(tmp_path / "libLLVM.so.19.1"), 19)  # 21 is there but does not load
    assert not any("14" in Path(path).name for path in opened)


def test_doctor_finds_this_machine_usable(capsys):
    assert doctor.examine()
    out = capsys.readouterr().out
    assert "LLVM" in out and "torch" in out and "ray test" in out and "missing" not in out


def test_doctor_names_the_extras_that_are_not_installed(monkeypatch):
    assert doctor._extra("viewer") == doctor.Finding("extra viewer", "ok", "foxglove, rerun")
    monkeypatch.setitem(EXTRAS, "viewer", {"rerun", "nowhere"})
    found = doctor._extra("viewer")
    assert found.state == "optional" and found.detail == "nowhere not installed"
    assert found.remedy == "pip install 'radarize[viewer]'"


def test_doctor_writes_a_report_that_names_no_folder_of_the_user(monkeypatch):
    found = doctor.Finding("ray test", "ok", f"{Path.home()}/libLLVM.so.19.1")
    monkeypatch.setattr(doctor, "findings", lambda: [found, doctor.Finding("torch", "ok", "2.13.0")])
    text = doctor.describe()
    assert text.startswith(f"radarize {__version__}, ") and "- ray test: ok, ~/libLLVM.so.19.1\n" in text
    assert f"numpy {LOCK['numpy']}" in text and f"mitsuba {LOCK['mitsuba']}" in text and str(Path.home()) not in text


def test_doctor_lists_what_is_missing(monkeypatch, capsys):
    monkeypatch.setitem(doctor.LIBRARIES, "libnothing.so.7", "libnothing7")
    monkeypatch.setattr(doctor, "_ray_test", lambda: doctor.Finding("ray test", "ok", ""))
    monkeypatch.setattr(doctor, "_first_frame", lambda: doctor.Finding("first frame", "ok", ""))
    assert "libnothing7" in doctor.missing_packages()
    assert not doctor.examine()
    assert "libnothing.so.7 (missing): apt-get install libnothing7\n" in capsys.readouterr().out
