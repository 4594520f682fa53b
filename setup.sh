#!/bin/sh
# Sets this machine up: system packages, .venv with exactly the packages of requirements.lock, this project in it.
# Called by `make demo` and `make test`; does nothing, in well under a second, where everything is in place, and
# repairs what is not: a .venv of another checkout, of a vanished Python, or with packages of other versions.
set -eu
cd "$(dirname "$0")"
# What is imported here is compiled for good, as in an installation, though the shell may forbid that elsewhere (as
# many containers do): otherwise every command compiles thousands of modules anew, which takes as long as loading them.
unset PYTHONDONTWRITEBYTECODE

# Imported once after installing; looked for every time.
NEEDED="torch onnxruntime numba h5py scipy gtsam evo open3d trimesh drjit mitsuba sionna plotly matplotlib typer pytest"

find_python() {
    # PYTHON=... chooses another interpreter. 3.11 is what the lock file was written and tested with.
    for candidate in ${PYTHON:-} python3.11 python3.12 python3.13 python3; do
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    echo "setup: no Python >= 3.11 with its venv module found; type: apt-get install python3 python3-venv" >&2
    return 2
}

# Whether .venv is whole: it runs, belongs to this folder, and holds every locked version.
is_complete() {
    .venv/bin/python - 2>/dev/null <<PYTHON
import importlib.metadata, importlib.util, pathlib, sys, tomllib

assert pathlib.Path(sys.prefix) == pathlib.Path(".venv").resolve()
assert pathlib.Path(".venv/.ready").read_text() == pathlib.Path("requirements.lock").read_text()
assert sys.prefix in pathlib.Path(".venv/bin/radarize").read_text().splitlines()[0]
for line in pathlib.Path("requirements.lock").read_text().splitlines():
    if not line.startswith("#"):
        name, version = line.split("==")
        assert importlib.metadata.version(name).split("+")[0] == version
assert all(importlib.util.find_spec(name) for name in "$NEEDED".split())
about = tomllib.loads(pathlib.Path("pyproject.toml").read_text())["project"]
groups = {"console_scripts": about["scripts"], **about["entry-points"]}
declared = {(group, name, value) for group, points in groups.items() for name, value in points.items()}
found = importlib.metadata.distribution("radarize").entry_points
assert declared == {(point.group, point.name, point.value) for point in found}
PYTHON
}

install_system_packages() {
    missing=$("$1" -m radarsim.doctor --missing-packages)
    [ -n "$missing" ] || return 0
    command="apt-get install -y --no-install-recommends $missing"
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        echo "setup: $command"
        if apt-get update -qq && DEBIAN_FRONTEND=noninteractive $command -qq >/dev/null; then
            return 0
        fi
        echo "setup: that failed; LLVM 19 for older systems comes from https://apt.llvm.org" >&2
    else
        echo "setup: system packages are missing; type: sudo $command" >&2
    fi
    return 2
}

install_python_packages() {
    # Modules are compiled when somebody imports them (--no-compile), which of most of them nobody ever does.
    pip="python -m pip --disable-pip-version-check install -qq --no-deps --no-compile"
    # The lock file is complete, so nothing is resolved (--no-deps): no package can bring the CUDA build of torch, or
    # anything else, along. torch goes first, because it is the one whose build matters: without the CUDA libraries
    # that it was not given, the build for CUDA does not import, and the one for processors takes its place.
    (
        PATH="$PWD/.venv/bin:$PATH"
        echo "setup: installing PyTorch"
        $pip "$(grep '^torch==' requirements.lock)" &&
            echo "setup: installing the packages of requirements.lock (about a minute)" &&
            $pip -r requirements.lock &&
            { python -c 'import torch' 2>/dev/null || $pip --force-reinstall "$(grep '^torch==' requirements.lock)" \
                --index-url https://download.pytorch.org/whl/cpu; } &&
            $pip --no-build-isolation --editable . &&
            python -c "import $(echo $NEEDED | tr ' ' ',')" &&
            python -m pip --disable-pip-version-check check >/dev/null
    )
}

if is_complete; then
    install_system_packages .venv/bin/python
    exit
fi
python=$(find_python)
install_system_packages "$python"
# First in what is there, where it runs and belongs here; if that does not come out whole, from nothing.
for attempt in repair renew; do
    if [ $attempt = renew ] || ! .venv/bin/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null ||
        [ "$(.venv/bin/python -c 'import sys; print(sys.prefix)')" != "$(pwd -P)/.venv" ]; then
        rm -rf .venv
        echo "setup: creating .venv with $("$python" --version)"
        "$python" -m venv .venv
    fi
    rm -f .venv/.ready
    if install_python_packages; then
        cp requirements.lock .venv/.ready
        echo "setup: compiling the simulator (half a minute, once)"
        .venv/bin/python -m radarsim.doctor --first-frame >/dev/null || true # `radarsim doctor` tells what is wrong
        is_complete && exit
    fi
done
echo "setup: the packages of requirements.lock could not be installed; the reason stands above" >&2
exit 2
