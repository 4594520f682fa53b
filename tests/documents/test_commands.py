"""Every command of README and docs, in order, as a reader types them.

Commands are those of the pages (`pages.py`), except for `TYPED_INSTEAD`: all shorter, and on virtual hardware.
The other pages follow README, with what it left behind. A command that is new on a page runs here by itself, or fails.
The suite types README, with the kernels that the checkout has compiled: in a fresh one, those of set-up. The other
pages take minutes more: `make documents` types them, too, all of it where no kernel has been compiled yet.
"""

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.documents.given import ALL, DATASETS, GIVEN, SECONDS, STUDIO, specification
from tests.documents.pages import APART, FIRST, PAGES, ROOT, THEN, Command, commands
from tests.virtual import free_ports

WALK = f"--duration {SECONDS}"
#: What is typed instead: pattern, replacement; in this order, each on what the one before left.
TYPED_INSTEAD = (
    # Shorter.
    (r"--duration \d+", WALK),
    (r"^(radarsim simulate (?!.*--(?:duration|waypoints|trajectory)).*)$", rf"\1 {WALK}"),
    (r"^(radarsim simulate .*--sensors adc-by-cause).*$", r"\1 --duration 0.1"),
    (r"^radarsim dataset (\S+)", r"radarsim dataset short/\1.yaml"),
    (r"--epochs \d+", "--epochs 1"),
    (r"^((?:radarize|torchrun .* -m radarize\.cli) train (?!.*--epochs).*)$", r"\1 --epochs 1"),
    (r"--width 64", ""),
    (r"^((?:radarize|torchrun .* -m radarize\.cli) train .*)$", r"\1 --width 4"),
    (r"^(radarize benchmark ablation .*)$", r"\1 --methods doppler,first-echo"),  # which has no networks
    (r"^(radarize benchmark (?!real |.*--methods).* --data .*)$", r"\1 --methods learned,segmentation"),
    (r"^((?:radarsim dataset|radarize benchmark (?!list|real)).*)$", r"\1 --workers 1"),  # others take seconds to begin
    (r"^(radarsim twin .*)$", r"\1 --every 60"),
    (r"^(radarize train radarhd-pictures .*)$", r"\1 --frames 3"),  # two seconds are more than the walks have
    (r"^(radarize train milliego .*)$", r"\1 --frames 2"),  # the walks have seven at 5 Hz
    (r"--nproc-per-node 4", "--nproc-per-node 1"),
    (r"^(radarize (?:capture|live) .*)$", r"\1 --duration 0.5"),
    # A cluster: tests/io/jobs and tests/dataset have one.
    (r" --ray auto", ""),
    # The virtual radar in place of a real one, on ports that are free, its recording left alone.
    (r"--port \S+( --host \S+ --dca \S+)?", "--port {tty} --host 127.0.0.1 --dca 127.0.0.2 {ports}"),
    (r"^(radarize (?:capture|live) .*)-o walk\.h5", r"\1-o captured.h5"),
    (r"^(radarize (?:capture|live) .*-o .*)$", r"\1 --overwrite"),  # README's is typed before
    (r"^(radarize live .*)$", r"\1 --address 127.0.0.1:0"),
    (r"^(radarsim emulate \S+) --port-link \S+", r"\1 --port-link {tty} {ports} --loop"),
    (r"--foxglove \S+", "--foxglove 127.0.0.1:0"),
    # A window needs a screen.
    (r"^(radarize view (?!.*--save).*)$", r"\1 --save view.rrd"),
    # Places of the readers' own: where the room has none.
    (r"--origin '[^']*'", "--origin '0 0 0 0 0 0'"),
    (r"--at '[^']*'", "--at '9 6 1 0 0 0'"),
)
#: What is not typed at all, and why.
NOT_TYPED = {
    r"make test": "this is part of it",
    r"make demo": "README has it in a block, which is typed",
    r"docker .*": "needs a Docker daemon; the workflow builds the image",
    r"radarize calibrate .*": "needs a walk of 20 s (tests/pipeline/calibration)",
    r"radarize run .* --board .*": "the same",
    r"radarize check .*": "ends with 1 where it finds anything (tests/pipeline/check)",
    r"radarize recover .*": "nothing was killed (tests/capture/test_kept.py)",
    r"pip install .*": "tests/test_wheel.py installs the wheel",
    r"(ros2|python3|ros/bin/pip) .*": "needs ROS 2; tests/examples has its messages",
    r"make (docs|setup)": "makes an environment",
    r"make results": "takes days",
    r"sudo .*": "changes the machine's network and groups",
    r"radarsim doctor.*": "compiles what the others compile, too; tests/test_setup.py runs it",
    r"python -m (benchmarks|docs)\..*": "draws the page's own pictures, by the checkout's scripts",
}
if not STUDIO.is_dir():
    NOT_TYPED[r"radarize import studio_folder .*"] = f"{STUDIO} is not there, a public capture"
#: Options that name what a command writes.
OUTPUT = ("-o", "--out")


def typed(command: str) -> str:
    for pattern, replacement in TYPED_INSTEAD:
        command = re.sub(pattern, replacement, command)
    return command


def reason_not_to(command: Command) -> str | None:
    return next((why for pattern, why in NOT_TYPED.items() if re.fullmatch(pattern, command.text)), None)


class Reader:
    """A reader who types commands in a folder.

    Args:
        folder: where.
        caches: folder of compiled kernels; none for the checkout's own.
    """

    def __init__(self, folder: Path, caches: Path | None):
        self.folder, self.log = folder, folder / "log.txt"
        self.environment = os.environ | {"PYTHONPATH": str(ROOT)}
        if caches:
            self.environment["NUMBA_CACHE_DIR"] = str(caches)
        shell = [sys.executable, Path(__file__).parent / "shell.py"]
        self.shell = subprocess.Popen(
            shell, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=self.environment
        )
        self.ports, self.radar = free_ports(), None
        self.took: dict[str, float] = {}

    def type(self, command: Command) -> str | None:
        """Run a command; return its output if it failed, else None."""
        before = self.log.stat().st_size if self.log.exists() else 0
        if command.script:
            (self.folder / "script.py").write_text(command.text)
            words = ["python", "script.py"]
        else:
            ports = "--command-port {} --data-port {}".format(*self.ports)
            line = typed(command.text).replace("{tty}", str(self.folder / "tty")).replace("{ports}", ports)
            words = shlex.split(line)
            if words[0] not in ("radarize", "radarsim", "torchrun"):
                return f"{line}: no rule to run it; {Path(__file__).name} has tables for that"
            if command.mentioned:
                words = [*shlex.split(command.text), "--help"]
            elif words[1] == "emulate":
                return self.switch_on(words)
            elif "--port" in words:
                self.switch_on()
            for option, name in zip(["", *words], words, strict=False):
                if option not in OUTPUT:
                    self.prepare(name)
        outputs = [name for option, name in zip(words, words[1:], strict=False) if option in OUTPUT]
        begun = time.time()
        order = {"words": words, "folder": str(self.folder), "log": str(self.log)}
        print(json.dumps(order), file=self.shell.stdin, flush=True)
        code, used = self.shell.stdout.readline().split()
        code, self.took[" ".join(words)] = int(code), float(used)
        missing = [name for name in outputs if not self.written(name, begun)]
        if code == 0 and not missing:
            return None
        output = self.log.read_bytes()[before:].decode(errors="replace")[-1500:]
        return f"{' '.join(words)}\nexit code {code}, not written: {missing}\n{output}"

    def written(self, name: str, since: float) -> bool:
        """Whether a file or folder of that name, whatever its ending, is of this moment or later."""
        found = [*self.folder.glob(f"{name}*"), *self.folder.glob(f"{name}/**/*")]
        return any(path.stat().st_mtime > since - 1 for path in found)

    def prepare(self, name: str) -> None:
        """Have a short specification where a data set is asked for, and a file that the pages take as given."""
        path = self.folder / name
        if name.startswith("short/") and not path.exists():
            specification(name.removeprefix("short/").removesuffix(".yaml"), path)
        for given in ("adc_data.bin",) if name == "profile.cfg" else (name,):
            if given in GIVEN and not (self.folder / given).exists():
                GIVEN[given](self.folder / given)

    def switch_on(self, words: list[str] | None = None) -> None:
        """The virtual radar, with the words of a page if they come first."""
        if self.radar:
            return
        default = typed("radarsim emulate walk.h5 --port-link tty")
        ports = "--command-port {} --data-port {}".format(*self.ports)
        words = words or shlex.split(default.replace("{tty}", str(self.folder / "tty")).replace("{ports}", ports))
        command = [sys.executable, "-m", "radarsim.cli", *words[1:]]
        self.radar = subprocess.Popen(
            command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=self.environment
        )
        assert self.radar.stdout.readline().startswith("serial port")

    def leave(self) -> None:
        self.shell.communicate()
        assert self.shell.returncode == 0
        if self.radar:
            self.radar.send_signal(signal.SIGINT)
            self.radar.communicate(timeout=60)
            assert self.radar.returncode == 0


def read(page: str, folder: Path, caches: Path | None) -> list[str]:
    """Type all commands of a page; returns failures."""
    reader = Reader(folder, caches)
    try:
        failures = [reader.type(command) for command in commands(page) if not reason_not_to(command)]
    finally:
        print("processor time", *(f"{s:6.1f} s  {words}" for words, s in reader.took.items()), sep="\n")
        reader.leave()
    return [failure for failure in failures if failure]


@pytest.fixture(scope="module")
def failures(tmp_path_factory) -> dict[str, list[str]]:
    """Commands of each page, in an empty folder; with DOCUMENTS set, of all pages and without compiled kernels."""
    folder = tmp_path_factory.mktemp("documents")
    caches, first = folder / "caches" if ALL else None, folder / "first"
    first.mkdir()
    found = {FIRST: read(FIRST, first, caches)}

    def follow(pages: tuple[str, ...]) -> dict[str, list[str]]:
        copy = folder / Path(pages[0]).stem
        shutil.copytree(first, copy, ignore=shutil.ignore_patterns("tty", "log.txt", "real.h5"))
        return {page: read(page, copy, caches) for page in pages}

    with ThreadPoolExecutor() as readers:
        for more in readers.map(follow, THEN if ALL else ()):
            found |= more
    return found


@pytest.mark.parametrize("page", PAGES if ALL else (FIRST,))
def test_every_command_of_a_page_works(page, failures):
    assert not failures[page], "\n\n".join(failures[page])


def test_no_page_is_forgotten_and_no_exception_outlives_its_command():
    found = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md")} | {"README.md"}
    assert {page for page in found if not page.startswith(APART)} == set(PAGES)
    everything = [command.text for page in PAGES for command in commands(page)]
    for pattern in NOT_TYPED:
        assert any(re.fullmatch(pattern, text) for text in everything), f"no page has {pattern} any more"
    for name in DATASETS:
        assert any(text.startswith(f"radarsim dataset {name} ") for text in everything), f"no page makes {name}"


def test_an_unknown_command_fails(tmp_path):
    reader = Reader(tmp_path, None)
    try:
        assert "no rule to run it" in reader.type(Command("ros2 run radar"))
        assert "exit code 2" in reader.type(Command("radarize info missing.h5"))
        assert "exit code 2" in reader.type(Command("radarize frobnicate"))
    finally:
        reader.leave()
