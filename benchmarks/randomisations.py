"""Which randomisations a network needs that is trained on simulated walks alone and works on real ones: each is left
out once.

Real walks are training walks, so that nothing is chosen on test walks; points are judged by instant
(`radarize.baselines.walks.clock`). The networks are smaller, and trained for less, than the shipped one.
"""

import argparse
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import torch
from jaxtyping import Bool, UInt8

from benchmarks.finetuning import window
from benchmarks.results import CLONE, Page, performed, radarhd, script
from radarize.baselines.pictures import roughening, training
from radarize.baselines.pictures.network import PictureNet
from radarize.baselines.pictures.points import points
from radarize.baselines.pictures.training import DENSE, Pictures
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.point_cloud_distance import PointCloudDistance
from radarize.baselines.walks.walks import FIRST, Walk
from radarize.evaluation.benchmark.choices import TRAINING
from radarize.io.jobs import Report
from radarize.io.recording import Recording
from radarize.io.yamlfile import read_yaml
from radarize.learning.features.table import FeatureTable
from radarize.learning.task import Settings
from radarize.learning.training.dataset import recordings
from radarsim.world.description import shipped

#: Frames of a window, as the shipped network has them.
WINDOW = Pictures.defaults.frames
#: dB, as good as nothing; m, the middle of what the radar reads too far.
_NONE, _BIAS = -200.0, sum(training.BIAS) / 2


class Variant(NamedTuple):
    """A training.

    Attributes:
        left_out: values that stand in place of those of `roughening` or `training`.
        walks: what simulated walks must be: kind, clutter, unevenness, platform.
        share: of these that are taken.
        seed: of weights, order and augmentation.
    """

    left_out: dict[str, object] = {}  # noqa: RUF012
    walks: Mapping[str, object] | None = None
    share: float = 1.0
    seed: int = 0


EVERYTHING, QUARTER = "everything", "a quarter of the walks"
SUBSETS = {
    "clutter of one density, a quarter": Variant(walks={"clutter": 1}),
    "even walls alone, a quarter": Variant(walks={"unevenness": 0}, share=0.8),
    "buildings of one style, a quarter": Variant(walks={"kind": "A"}),
    "by cart alone, a quarter": Variant(walks={"platform": "cart"}, share=0.5),
}
VARIANTS = {
    EVERYTHING: Variant(),
    f"{EVERYTHING}, another seed": Variant(seed=1),
    "no other boards (gains, phases, yaw)": Variant({"GAIN": 0.0, "PHASE": 0.0, "YAW": 0.0}),
    "no flashes that lose": Variant({"CEILING": (100.0, 100.0)}),
    "no echoes that nobody explains": Variant({"LEVELS": (_NONE, _NONE)}),
    "no gain that wanders over range": Variant({"TILT": 0.0, "PATCHY": 0.0}),
    "no noise": Variant({"NOISE": (_NONE, _NONE)}),
    "no missing cells": Variant({"MISSING": 0.0}),
    "always a tenth of the cells": Variant({"KEPT": (0.1, 0.1)}),
    "one range bias": Variant({"BIAS": (_BIAS, _BIAS)}),
    "no zoom": Variant({"ZOOM": 0.0}),
    "no turns": Variant({"TURN": 0}),
    QUARTER: Variant(share=0.26),
    **SUBSETS,
}


class Real(NamedTuple):
    """Windows of real pictures, and what the lidar saw at the instant of the newest."""

    walk: list[int]
    pictures: UInt8[np.ndarray, "item frame range azimuth"]
    lidar: list[Bool[np.ndarray, "range azimuth"]]


def real(walks: list[Walk], every: int) -> Real:
    """Windows of walks."""
    found = Real([], [], [])
    for walk in walks:
        partners = Clock.of(walk).partners(walk.frames)
        for end in range(FIRST, walk.frames, every):
            if partners[end] >= 0:
                found.walk.append(walk.number)
                found.pictures.append(window(walk, end, WINDOW))
                found.lidar.append(walk.lidar(int(partners[end])))
    return found._replace(pictures=np.stack(found.pictures))


def chosen(data: Path, variant: Variant) -> tuple[Path, ...]:
    """Simulated walks of a variant."""
    specification = read_yaml(shipped() / "datasets" / "radarhd.yaml")
    found = []
    for path in recordings(data):
        with Recording(path) as recording:
            scene, platform = recording.attributes["scene"], recording.attributes["platform"]
        about = specification["buildings"][scene.split("_")[0]] | {"platform": platform}
        if all(about[name] == value for name, value in (variant.walks or {}).items()):
            found.append(path)
    order = np.random.default_rng(0).permutation(len(found))
    return tuple(sorted(found[k] for k in order[: max(2, round(variant.share * len(found)))]))


@cache
def table(paths: tuple[Path, ...]) -> FeatureTable:
    """Simulated walks in memory."""
    return Pictures().table(paths)


def trained(known: FeatureTable, settings: Settings, steps: int, report: Report) -> PictureNet:
    """A network after so many steps."""
    task, rng = Pictures(), np.random.default_rng(settings.seed)
    torch.manual_seed(settings.seed)
    net, generator = task.net(settings, known.grid).train(), torch.Generator().manual_seed(settings.seed)
    optimiser = torch.optim.Adam(net.parameters(), settings.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, settings.rate, total_steps=steps, pct_start=0.05)
    starts = known.starts(settings.frames)
    for step in range(steps):
        some = starts[torch.from_numpy(rng.integers(0, len(starts), settings.batch))]
        frames = task.frames(some, torch.ones(len(some), dtype=torch.long), settings.frames)
        maps, label = task.augment(task.inputs(known, frames), task.label(known, frames), generator)
        optimiser.zero_grad()
        task.loss(net, maps, label).mean().backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), task.steepest)
        optimiser.step()
        schedule.step()
        report(step + 1)
    return net.eval()


@torch.inference_mode()
def judged(net: PictureNet, windows: Real) -> dict[int, float]:
    """Median Chamfer distance of each walk, m, with that density of points that is best for all of them."""
    apart = {dense: [] for dense in DENSE}
    for pictures, lidar in zip(windows.pictures, windows.lidar, strict=True):
        likely = net.estimate(torch.from_numpy(pictures)[None, :, None].float())
        for dense, found in apart.items():
            found.append(PointCloudDistance.of_pictures(points(likely, dense)[0].numpy(), lidar).chamfer)
    best = min(apart.values(), key=np.nanmedian)
    walks = np.array(windows.walk)
    return {int(walk): float(np.nanmedian(np.array(best)[walks == walk])) for walk in np.unique(walks)}


def tried(
    variant: Variant, paths: tuple[Path, ...], windows: Real, settings: Settings, steps: int, report: Report
) -> dict[int, float]:
    """A variant, trained and judged."""
    with ExitStack() as stack:
        for name, value in variant.left_out.items():
            module = next(each for each in (roughening, training) if hasattr(each, name))
            stack.enter_context(patch.object(module, name, value))
        return judged(trained(table(paths), replace(settings, seed=variant.seed), steps, report), windows)


@script(
    "What simulated walks must vary",
    data=CLONE,
    simulated=(Path("radarhd"), "what `radarsim dataset radarhd` made"),
    steps=(500, "of each training"),
    every=(40, "of so many frames of the real walks one is judged"),
)
def main(options: argparse.Namespace) -> Page:
    """Train and judge all, beside each other."""
    walks = [Walk.find(options.data, number) for number in TRAINING]
    windows, settings = real(walks, options.every), Settings(width=8, frames=WINDOW, batch=16, rate=2e-3)
    paths = {name: chosen(options.simulated, variant) for name, variant in VARIANTS.items()}
    jobs = {
        name: partial(tried, each, paths[name], windows, settings, options.steps) for name, each in VARIANTS.items()
    }
    found, rows = dict(zip(jobs, performed(jobs, None, "trainings"), strict=True)), []
    for name, apart in found.items():
        beside = found[QUARTER if name in SUBSETS else EVERYTHING]
        worse = np.array([apart[walk] - beside[walk] for walk in apart])
        rows.append({
            "training": name, "simulated walks": len(paths[name]), "chamfer_m": float(np.mean(list(apart.values()))),
            "worse by_m": float(worse.mean()), "+-": float(worse.std(ddof=1) / np.sqrt(len(worse))),
        })  # fmt: skip
    return Page(
        rows,
        data=radarhd("RadarHD's training walks", walks),
        notes=[
            "Median Chamfer distance of a real walk's points from the lidar's of the same instant, m, mean over walks. "
            f"Worse by: than `{EVERYTHING}`, walk by walk, or than `{QUARTER}` where walks are left out; +-: standard "
            "error over walks. Another seed says by how much two trainings of one kind differ.",
            f"Each network has width {settings.width} and was trained on simulated walks alone, {options.steps} steps "
            f"of {settings.batch} windows; the density of points is the best for these walks.",
        ],
    )
