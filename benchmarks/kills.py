"""Kills at random moments: what is begun again ends as if nothing had been, and a capture loses what was on its way."""

import argparse
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from benchmarks.results import Data, Page, same, script, surroundings, timed
from radarize.io.recording import Recording, recover
from radarize.radar.presets import load_config
from tests.virtual import emulator, record

#: What a data set of seconds is made of.
SPECIFICATION = {
    "name": "kills",
    "seed": 1,
    "buildings": {"office": "office"},
    "recordings": [{"building": "office", "platform": "cart", "count": 2, "duration": 0.5}],
}
EPOCHS = 4
#: s that a capture lives once its file is there.
LIVES = 1.5, 6.0


@dataclass(frozen=True)
class Case:
    """A command that is killed.

    Attributes:
        words: of the command; {out} stands for what it writes.
        again: words added when it is begun again.
        made: files below {out} that must come out the same, as a pattern.
    """

    words: Sequence[object]
    made: str
    again: tuple[str, ...] = ()

    def begin(self, out: Path, again: bool) -> subprocess.Popen:
        """Start the command, in a group of its own with all that it starts."""
        words = [str(word).format(out=out) for word in (*self.words, *(self.again if again else ()))]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen([sys.executable, "-m", *words], start_new_session=True, **quiet)


def bytes_of(case: Case, out: Path) -> dict[str, str]:
    """What a command has made, file by file; of tables their figures alone, for times differ from run to run."""

    def digest(path: Path) -> str:
        data = path.read_bytes()
        if path.suffix == ".json":
            data = json.dumps([table["rows"] for table in json.loads(data)["tables"]]).encode()
        return hashlib.sha256(data).hexdigest()

    return {str(path.relative_to(out)): digest(path) for path in sorted(out.glob(case.made))}


def killed(name: str, case: Case, kills: int, folder: Path, rng: np.random.Generator) -> dict[str, object]:
    """A command that is killed and begun again, so many times in all: a row of the table. Where it comes to its end
    before it is killed, what it made is compared, and it begins anew in another folder."""
    whole, expected, ended = folder / f"{name}-whole", {}, 0
    for each in (whole, folder / f"{name}-warm"):  # the first compiles kernels
        each.mkdir()
        code, seconds = timed(case.begin(each, again=False).wait)
        assert code == 0, f"{name} does not work"
        made = bytes_of(case, each)
        assert made and made == (expected or made), f"{name} does not make the same twice"
        expected = made
    codes, differ, count, out = set(), 0, 0, None
    while count < kills or out:
        again = out is not None
        if not again:
            out = folder / f"{name}-killed-{ended}"
            out.mkdir()
        process = case.begin(out, again)
        try:
            codes.add(process.wait(float(rng.uniform(0, seconds)) if count < kills else None))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            count += 1
            continue
        found, out, ended = bytes_of(case, out), None, ended + 1
        differ += sum(found.get(path) != each for path, each in expected.items())
    return {
        "killed": name,
        "times": count,
        "s without kills": seconds,
        "came to its end": ended,
        "exit code then, at most": max(codes, default=0),
        "files": len(expected) * ended,
        "files that differ": differ,
    }


def captures(kills: int, folder: Path, rng: np.random.Generator) -> dict[str, object]:
    """Captures that are killed while frames come: a row of the table."""
    config, _ = load_config("radarize")
    played, lost, wrong = record(folder / "played.h5", config, 32), [], 0
    for number in range(kills):
        output = folder / f"{number}.h5"
        part = output.with_name(output.name + ".part")
        with emulator(folder / "played.h5", folder, "--loop") as board:
            words = [
                "radarize.cli", "capture", "--config", "radarize", *board.options, "-o", output,
            ]  # fmt: skip
            process = Case(words, "").begin(output, again=False)
            while not part.exists() and process.poll() is None:
                time.sleep(0.005)
            first = time.time()
            time.sleep(float(rng.uniform(*LIVES)))
            os.killpg(process.pid, signal.SIGKILL)
            end = time.time()
            process.wait()
        with Recording(recover(part)) as kept:
            lost.append(end - first - len(kept) * config.frame_period)
            sent = played[np.arange(len(kept)) % len(played)]
            wrong += int((kept.adc(0, len(kept)) != sent).any(axis=(1, 2, 3, 4, 5)).sum())
        output.unlink()
    return {
        "killed": "capture, rescued by radarize recover",
        "times": kills,
        "frames that differ": wrong,
        "lost, s, at most": max(lost),
        "lost, s, mean": float(np.mean(lost)),
    }


def cases(folder: Path) -> dict[str, Case]:
    """The commands; each takes what one before it has made without kills."""
    (folder / "kills.yaml").write_text(yaml.safe_dump(SPECIFICATION))
    data = folder / "dataset-whole"
    walk = data / "office_cart_00.h5"
    train = ["radarize.cli", "train", "translation", "--data", data, "--width", 4, "--batch", 8]
    tables = ["radarize.cli", "benchmark", "odometry", "--data", data, "--methods", "doppler,first-echo"]
    return {
        "dataset": Case(
            ["radarsim.cli", "dataset", folder / "kills.yaml", "--workers", 1, "-o", "{out}"], "*.h5"
        ),
        "run": Case(["radarize.cli", "run", walk, "-o", "{out}/run"], "run/*.[tp][ug]m"),
        "train": Case([*train, "--epochs", EPOCHS, "-o", "{out}/w.safetensors"], "*.safetensors", ("--resume",)),
        "benchmark": Case([*tables, "--workers", 1, "--out", "{out}"], "odometry.json"),
    }  # fmt: skip


def rows(kills: int, seed: int, folder: Path, wanted: Callable[[str], bool] = lambda name: True) -> list[dict]:
    """Of the table, those that are wanted."""
    rng, found = np.random.default_rng(seed), []
    for name, case in cases(folder).items():
        if wanted(name) or name == "dataset":
            found.append(killed(name, case, kills if wanted(name) else 0, folder, rng))
    if wanted("capture"):
        found.append(captures(kills, folder, rng))
    return found


@script(
    "Kills at random moments",
    kills=(50, "of each command"),
    seed=(0, "of their moments"),
    only=(str, "this one alone, and what it takes, without a table"),
)
def main(options: argparse.Namespace) -> Page:
    """The table."""
    with tempfile.TemporaryDirectory() as folder:
        found = rows(options.kills, options.seed, Path(folder), lambda name: options.only in (None, name))
    if options.only:
        print(json.dumps(found, indent=2))
        return None
    return Page(
        same(found),
        data=Data("two walks of half a second in a simulated office, and noise", (), options.seed),
        notes=[
            "SIGKILL to the command and all that it has started, at moments drawn evenly from the time that it takes "
            "with warm kernels; then it is begun again. Where it comes to its end first, it begins anew in another "
            "folder; after the last kill it is let through. A capture is killed "
            f"{LIVES[0]:g}-{LIVES[1]:g} s after its file is there; "
            "frames lost are those from then on that the rescued recording lacks.",
            "Compared are bytes: of all recordings, of trajectories and map, of the trained network; and the figures "
            "of the benchmark's table.",
            surroundings(),
        ],
    )
