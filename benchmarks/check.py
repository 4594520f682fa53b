"""Rates of `radarize check`: faults put into simulated walks (`benchmarks.faults`), and walks without any.

python -m benchmarks.check --folder check
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.faults import FAULTS, Walk
from benchmarks.results import Data, Page, performed, script
from radarize.io.jobs import Report
from radarize.io.recording import Recording
from radarize.io.stopwatch import Stopwatch, stage
from radarize.io.yamlfile import read_beside
from radarize.odometry.inertial import Imu
from radarize.pipeline.check.check import check_evidence
from radarize.radar.presets import PRESETS
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene

#: GHz: start of the sweep of 60 GHz boards.
_SIXTY = 60e9
_DURATION = 10.0


class Trial(NamedTuple):
    """A walk."""

    seed: int
    building: str
    platform: str
    board: str
    folder: Path

    @property
    def path(self) -> Path:
        return self.folder / f"{self.seed}.h5"

    def record(self, _: Report) -> None:
        """Make the recording if it is not there."""
        if self.path.is_file():
            return
        radar = PRESETS["radarize"]
        if self.board != radar.board:
            radar = radar.changed(self.board, board=self.board, start_frequency=_SIXTY)
        scene = Scene.of({"building": {"kind": self.building, "seed": self.seed}}, f"{self.building} of {self.seed}")
        plan = {"duration": _DURATION, "seed": self.seed, "platform": self.platform, "radar": radar}
        simulate(scene, self.path, sensors=["imu"], **plan)

    def outcomes(self, _: Report, names: Sequence[str]) -> dict[str, "Outcome"]:
        """Of the walk with each of the faults."""
        found = {}
        with Recording(self.path) as recording:
            whole = Walk(
                recording.config, recording.adc(0, len(recording)), recording.times, recording.valid(0, len(recording)),
                recording.truth, Imu.of(recording) if recording.has('imu/time') else None,
            )  # fmt: skip
        for k, name in enumerate(names):
            harmed = FAULTS[name].harm(whole, np.random.default_rng([self.seed, k]))
            if harmed is None:
                continue
            stopwatch = Stopwatch()
            with stopwatch.running(), stage("check"):
                checked = check_evidence(harmed.evidence)
            kinds = tuple(each.kind for each in checked.findings)
            found[name] = Outcome(kinds, FAULTS[name].kind in checked.not_observable, stopwatch.seconds["check"])
        return found


class Outcome(NamedTuple):
    """Kinds that were found, whether the fault was said not to be observable, and s that it took."""

    kinds: tuple[str, ...]
    unseen: bool
    seconds: float


def trials(about: dict, boards: Sequence[str], folder: Path) -> Iterator[Trial]:
    """Buildings, platforms and boards by turns; every other board is the first one."""
    for k in range(about["count"]):
        board = boards[(k // 2 + k // 4) % len(boards)] if k % 2 else boards[0]
        yield Trial(about["first"] + k, "ABCD"[k % 4], ("handheld", "cart", "robot")[k % 3], board, folder)


def row(name: str, found: Sequence[Outcome]) -> dict[str, object]:
    """Rates of a fault."""
    kind = FAULTS[name].kind
    others = Counter(each for outcome in found for each in outcome.kinds if each != kind)
    unseen = sum(outcome.unseen and kind not in outcome.kinds for outcome in found)
    observable = len(found) - unseen
    named = sum(kind in outcome.kinds for outcome in found)
    return {
        "fault": name,
        "named": kind or "-",
        "walks": len(found),
        "said not observable": unseen if kind else None,
        "found": f"{sum(bool(o.kinds) for o in found)}/{observable if kind else len(found)}",
        "named rightly": f"{named}/{observable}" if kind else None,
        "%": 100 * named / observable if kind and observable else None,
        "other kinds named": ", ".join(f"{each} {count}" for each, count in others.most_common()) or "-",
    }


@script(
    "Faults found by `radarize check`",
    folder=(Path("check"), "of the recordings, which are made if they are not there"),
    set=("test", "tuning, or test"),
    only=("", "parts of names of faults, comma-separated; all if none"),
    workers=(1, "processes"),
)
def main(options: argparse.Namespace) -> Page | None:
    about = read_beside(__file__)
    walks = list(trials(about[options.set], about["boards"], options.folder))
    words = options.only.split(",")
    names = [name for name in FAULTS if any(word in name for word in words)]
    options.folder.mkdir(parents=True, exist_ok=True)
    performed({str(walk.seed): walk.record for walk in walks}, options.workers, "recordings")
    found = performed(
        {str(walk.seed): partial(walk.outcomes, names=names) for walk in walks}, options.workers, "checks"
    )
    outcomes = {name: [each[name] for each in found if name in each] for name in names}
    rows = [row(name, outcomes[name]) for name in names if outcomes[name]]
    for each in rows:
        print(each)
    seconds = [outcome.seconds for each in outcomes.values() for outcome in each]
    if options.set != "test" or options.only:
        return None
    return Page(
        rows,
        data=Data.of("walks of benchmarks/check.yaml, test", [walk.path for walk in walks]),
        notes=[
            f"mean {np.mean(seconds):.2f}",
        ],
    )
