"""Kills at random times: commands that are restarted give the same results, and a capture loses only its last
frames."""

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

#: Specification of a short data set.
SPECIFICATION = {
    "name": "kills",
    "seed": 1,
    "buildings": {"office": "office"},
    "recordings": [{"building": "office", "platform": "cart", "count": 2, "duration": 0.5}],
}
EPOCHS = 4
#: Time from the creation of a capture's file to its kill, s.
LIVES = 1.5, 6.0


@dataclass(frozen=True)
class Case:
    """A command that is killed.

    Attributes:
        words: words of the command; {out} is replaced by the output folder.
        made: pattern of the files in {out} that must be the same.
        again: words added for a restart.
    """

    words: Sequence[object]
    made: str
    again: tuple[str, ...] = ()

    def begin(self, out: Path, again: bool) -> subprocess.Popen:
        """Start the command in a process group of its own."""
        words = [str(word).format(out=out) for word in (*self.words, *(self.again if again else ()))]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen([sys.executable, "-m", *words], start_new_session=True, **quiet)


def bytes_of(case: Case, out: Path) -> dict[str, str]:
    """Return digests of the files that a command has made; of tables only the figures, because times differ."""

    def digest(path: Path) -> str:
        data = path.read_bytes()
        if path.suffix == ".json":
            data = json.dumps([table["rows"] for table in json.loads(data)["tables"]]).encode()
        return hashlib.sha256(data).hexdigest()

    return {str(path.relative_to(out)): digest(path) for path in sorted(out.glob(case.made))}


def killed(name: str, case: Case, kills: int, folder: Path, rng: np.random.Generator) -> dict[str, object]:
    """Kill and restart a command a number of times; return a row of the table. If it ends before the kill, its files
    are compared, and it is started in another folder."""
    whole, expected, ended = folder / f"{name}-whole", {}, 0
    for each in (whole, folder / f"{name}-warm"):  # the first run compiles kernels
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
        "kills": count,
        "s without kills": seconds,
        "completed": ended,
        "largest exit code": max(codes, default=0),
        "files": len(expected) * ended,
        "files that differ": differ,
    }


def captures(kills: int, folder: Path, rng: np.random.Generator) -> dict[str, object]:
    """Kill captures while frames arrive; return a row of the table."""
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
        "killed": "capture, recovered by radarize recover",
        "kills": kills,
        "frames that differ": wrong,
        "lost, max, s": max(lost),
        "lost, mean, s": float(np.mean(lost)),
    }


def cases(folder: Path) -> dict[str, Case]:
    """Return the commands; each uses the results of earlier ones without kills."""
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
    """Return the selected rows of the table."""
    rng, found = np.random.default_rng(seed), []
    for name, case in cases(folder).items():
        if wanted(name) or name == "dataset":
            found.append(killed(name, case, kills if wanted(name) else 0, folder, rng))
    if wanted("capture"):
        found.append(captures(kills, folder, rng))
    return found


@script(
    "Kills at random times",
    kills=(50, "number of kills of each command"),
    seed=(0, "seed of their times"),
    only=(str, "run only this command, without a table"),
)
def main(options: argparse.Namespace) -> Page:
    """Run all commands with kills."""
    with tempfile.TemporaryDirectory() as folder:
        found = rows(options.kills, options.seed, Path(folder), lambda name: options.only in (None, name))
    if options.only:
        print(json.dumps(found, indent=2))
        return None
    return Page(
        same(found),
        data=Data("two walks of half a second in a simulated office, and noise", (), options.seed),
        notes=[
            "SIGKILL to the command and all of its processes, at a random time, uniform over its run time with "
            "compiled kernels; then it is restarted. If it ends before the kill, it is started in another folder; "
            f"after the last kill it runs to its end. A capture is killed {LIVES[0]:g}-{LIVES[1]:g} s after its file "
            "exists; lost: frames since then that are missing in the recovered recording.",
            "Compared are the bytes of all recordings, trajectories, the map and the trained network, and the figures "
            "of the benchmark's table.",
            surroundings(),
        ],
    )
