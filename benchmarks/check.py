"""Detection rates of `radarize check` on simulated walks with faults (`benchmarks.faults`), and false alarms.

python -m benchmarks.check --folder check
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.faults import FAULTS, Walk
from benchmarks.results import SHARED, Data, Page, performed, script, surroundings
from radarize.evaluation.benchmark.results import commit
from radarize.evaluation.benchmark.table import NONE
from radarize.io.jobs import Report
from radarize.io.load import load
from radarize.io.recording import Recording
from radarize.io.replacing import write_whole
from radarize.io.stopwatch import Stopwatch, stage
from radarize.io.yamlfile import read_beside
from radarize.odometry.inertial import Imu
from radarize.pipeline.check.check import Check, check, check_evidence
from radarize.radar.presets import PRESETS
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene

#: Start frequency of 60 GHz boards, Hz; duration of a walk, s.
_SIXTY, _DURATION = 60e9, 10.0


class Trial(NamedTuple):
    """A simulated walk, with the folder of its recording."""

    seed: int
    building: str
    platform: str
    board: str
    folder: Path

    @property
    def path(self) -> Path:
        return self.folder / f"{self.seed}.h5"

    def record(self, _: Report) -> None:
        """Simulate the recording if it does not exist."""
        if self.path.is_file():
            return
        radar = PRESETS["radarize"]
        if self.board != radar.board:
            radar = radar.changed(self.board, board=self.board, start_frequency=_SIXTY)
        scene = Scene.of({"building": {"kind": self.building, "seed": self.seed}}, f"{self.building} of {self.seed}")
        simulate(
            scene, self.path, sensors=["imu"], duration=_DURATION, seed=self.seed, platform=self.platform, radar=radar
        )

    def outcomes(self, _: Report, names: Sequence[str]) -> dict[str, "Outcome"]:
        """Check the walk with each of the faults; results are stored in a file, so that the same command continues."""
        kept = self.folder / f"{self.seed}-{commit(Path(__file__)).split()[0]}.json"
        known = json.loads(kept.read_text()) if kept.is_file() else {}
        found = {name: Outcome(tuple(kinds), *rest) for name, (kinds, *rest) in known.items()}
        if missing := [name for name in names if name not in found]:
            found |= self._judged(missing)
            write_whole(kept, json.dumps(found))
        return {name: found[name] for name in names if name in found}

    def _judged(self, names: Sequence[str]) -> dict[str, "Outcome"]:
        found = {}
        with Recording(self.path) as recording:
            whole = Walk(
                recording.config, recording.adc(0, len(recording)), recording.times, recording.valid(0, len(recording)),
                recording.truth, Imu.of(recording) if recording.has("imu/time") else None,
            )  # fmt: skip
        for name in names:
            harmed = FAULTS[name].harm(whole, np.random.default_rng([self.seed, [*FAULTS].index(name)]))
            if harmed is None:
                continue
            stopwatch = Stopwatch()
            with stopwatch.running(), stage("check"):
                checked = check_evidence(harmed.evidence)
            kinds = tuple(each.kind for each in checked.findings)
            found[name] = Outcome(kinds, FAULTS[name].kind in checked.not_observable, stopwatch.seconds["check"])
        return found


class Outcome(NamedTuple):
    """Kinds of the findings, whether the check reports the fault as not observable, and run time, s."""

    kinds: tuple[str, ...]
    unseen: bool
    seconds: float


def trials(about: dict, boards: Sequence[str], folder: Path) -> Iterator[Trial]:
    """Yield walks with alternating buildings, platforms and boards; every second board is the first one."""
    for k in range(about["count"]):
        board = boards[(k // 2 + k // 4) % len(boards)] if k % 2 else boards[0]
        yield Trial(about["first"] + k, "ABCD"[k % 4], ("handheld", "cart", "robot")[k % 3], board, folder)


def row(name: str, found: Sequence[Outcome]) -> dict[str, object]:
    """Return the detection rates of a fault over the walks in which it is observable."""
    kind = FAULTS[name].kind
    others = Counter(each for outcome in found for each in outcome.kinds if each != kind)
    unseen = sum(outcome.unseen and not outcome.kinds for outcome in found) if kind else 0
    shown = len(found) - unseen
    named = sum(kind in outcome.kinds for outcome in found)
    return {
        "fault": name,
        "kind": kind or NONE,
        "walks": len(found),
        "not observable": unseen,
        "found": f"{sum(bool(outcome.kinds) for outcome in found)}/{shown}",
        "correct kind": f"{named}/{shown}" if kind else NONE,
        "correct kind %": 100 * named / shown if kind and shown else NONE,
        "other kinds": ", ".join(f"{each} {count}" for each, count in others.most_common()) or NONE,
    }


def real() -> Iterator[tuple[str, Check]]:
    """Check public captures of radars at rest, with one frame each."""
    given: dict[str, dict] = {
        "iwr1843-pcap/test_one_frame.pcap": {"samples": 256, "loops": 16, "rx": 1},
        "iwr6843-studio": {},
        "xwr-moving-people/doppler_example_1.npy": {
            "shape": "loop,virtual,sample", "tx": "1,3", "start_frequency": 77e9, "slope": 60.012e12,
            "sample_rate": 2.5e6, "idle_time": 30e-6, "ramp_end_time": 62e-6, "adc_start_time": 6e-6,
        },
    }  # fmt: skip
    for name, options in given.items():
        if (SHARED / name).exists():
            yield name.split("/")[0], check(load(SHARED / name, **options))


@script(
    "Faults found by radarize check",
    folder=(Path("build/check"), "folder of the recordings, which are made if missing"),
    set=("test", "tuning or test"),
    few=(0, "number of walks; all if 0"),
    only=("", "parts of names of faults, comma-separated; all if empty"),
    workers=(2, "number of processes"),
)
def main(options: argparse.Namespace) -> Page:
    """Check all faults in all walks."""
    about = read_beside(__file__)
    walks = list(trials(about[options.set], about["boards"], options.folder))[: options.few or None]
    names = [name for name in FAULTS if any(word in name for word in options.only.split(","))]
    options.folder.mkdir(parents=True, exist_ok=True)
    performed({str(walk.seed): walk.record for walk in walks}, options.workers, "recordings")
    jobs = {str(walk.seed): partial(walk.outcomes, names=names) for walk in walks}
    found = performed(jobs, options.workers, "checks")
    outcomes = {name: [each[name] for each in found if name in each] for name in names}
    rows = [row(name, outcomes[name]) for name in names if outcomes[name]]
    for name, checked in real():
        kinds = tuple(each.kind for each in checked.findings)
        about_it = {"fault": f"real: {name}", "walks": 1, "other kinds": ", ".join(kinds) or NONE}
        rows.append({**dict.fromkeys(rows[0], NONE), **about_it})
    seconds = np.array([each["none"].seconds for each in found if "none" in each])
    boards = Counter(walk.board for walk in walks)
    return Page(
        rows,
        data=Data.of(f"walks of benchmarks/check.yaml, {options.set}", [walk.path for walk in walks]),
        notes=[
            f"{len(walks)} walks of {_DURATION:.0f} s (handheld, cart, robot) through furnished buildings of four "
            f"kinds; boards: {', '.join(f'{name} {count}' for name, count in boards.most_common())}. Each fault is "
            "simulated in samples, time stamps, configuration or truth of each walk whose board can have it.",
            "found: walks with any finding; correct kind: walks with a finding of the fault's kind. Both are shares of "
            "the walks in which the fault is observable: walks without findings for which the check reports the fault "
            "as not observable are left out. Rows that begin with none have no fault: their findings are false alarms.",
            "Real captures have one frame of a radar at rest, for which `no motion` is the correct finding.",
            f"Run time of a check of a walk without faults: {np.median(seconds):.2f} s (median; samples in memory, "
            f"one thread, {options.workers} processes).",
            surroundings(),
        ],
    )
