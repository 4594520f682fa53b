"""Ablation of the randomisations in the training of a network on simulated walks, which is evaluated on real walks:
each randomisation is left out once.

Real walks are training walks, so that nothing is chosen on test walks; frames are matched by time
(`radarize.baselines.walks.clock`). The networks are smaller than the shipped one, and trained with fewer steps.
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

#: Frames of a window, as in the shipped network.
WINDOW = Pictures.defaults.frames
#: A negligible level, dB; the mean range offset of the radar, m.
_NONE, _BIAS = -200.0, sum(training.BIAS) / 2


class Variant(NamedTuple):
    """A training.

    Attributes:
        left_out: values that replace constants of `roughening` or `training`.
        walks: required attributes of simulated walks: kind, clutter, unevenness, platform.
        share: share of these walks that is used.
        seed: seed of weights, order and augmentation.
    """

    left_out: dict[str, object] = {}  # noqa: RUF012
    walks: Mapping[str, object] | None = None
    share: float = 1.0
    seed: int = 0


EVERYTHING, QUARTER = "everything", "a quarter of the walks"
SUBSETS = {
    "clutter of one density, a quarter": Variant(walks={"clutter": 1}),
    "flat walls only, a quarter": Variant(walks={"unevenness": 0}, share=0.8),
    "buildings of one style, a quarter": Variant(walks={"kind": "A"}),
    "cart walks only, a quarter": Variant(walks={"platform": "cart"}, share=0.5),
}
VARIANTS = {
    EVERYTHING: Variant(),
    f"{EVERYTHING}, another seed": Variant(seed=1),
    "no channel errors (gains, phases, yaw)": Variant({"GAIN": 0.0, "PHASE": 0.0, "YAW": 0.0}),
    "no limit of specular reflections": Variant({"CEILING": (100.0, 100.0)}),
    "no additional echoes": Variant({"LEVELS": (_NONE, _NONE)}),
    "no gain variation over range": Variant({"TILT": 0.0, "PATCHY": 0.0}),
    "no noise": Variant({"NOISE": (_NONE, _NONE)}),
    "no deleted cells": Variant({"MISSING": 0.0}),
    "constant share of kept cells, 10 %": Variant({"KEPT": (0.1, 0.1)}),
    "constant range bias": Variant({"BIAS": (_BIAS, _BIAS)}),
    "no scaling": Variant({"ZOOM": 0.0}),
    "no rotation": Variant({"TURN": 0}),
    QUARTER: Variant(share=0.26),
    **SUBSETS,
}


class Real(NamedTuple):
    """Windows of real pictures, with the lidar's picture at the time of the newest frame."""

    walk: list[int]
    pictures: UInt8[np.ndarray, "item frame range azimuth"]
    lidar: list[Bool[np.ndarray, "range azimuth"]]


def real(walks: list[Walk], every: int) -> Real:
    """Read windows of real walks."""
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
    """Select the simulated walks of a variant."""
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
    """Read simulated walks into memory."""
    return Pictures().table(paths)


def trained(known: FeatureTable, settings: Settings, steps: int, report: Report) -> PictureNet:
    """Train a network for a number of steps."""
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
    """Return the median Chamfer distance of each walk, m, with the density of points that is best over all walks."""
    distances = {dense: [] for dense in DENSE}
    for pictures, lidar in zip(windows.pictures, windows.lidar, strict=True):
        likely = net.estimate(torch.from_numpy(pictures)[None, :, None].float())
        for dense, found in distances.items():
            found.append(PointCloudDistance.of_pictures(points(likely, dense)[0].numpy(), lidar).chamfer)
    best = min(distances.values(), key=np.nanmedian)
    walks = np.array(windows.walk)
    return {int(walk): float(np.nanmedian(np.array(best)[walks == walk])) for walk in np.unique(walks)}


def tried(
    variant: Variant, paths: tuple[Path, ...], windows: Real, settings: Settings, steps: int, report: Report
) -> dict[int, float]:
    """Train and evaluate a variant."""
    with ExitStack() as stack:
        for name, value in variant.left_out.items():
            module = next(each for each in (roughening, training) if hasattr(each, name))
            stack.enter_context(patch.object(module, name, value))
        return judged(trained(table(paths), replace(settings, seed=variant.seed), steps, report), windows)


@script(
    "Ablation of randomisations",
    data=CLONE,
    simulated=(Path("radarhd"), "data set made by `radarsim dataset radarhd`"),
    steps=(500, "steps of each training"),
    every=(40, "every N-th frame of the real walks is evaluated"),
)
def main(options: argparse.Namespace) -> Page:
    """Train and evaluate all variants in parallel."""
    walks = [Walk.find(options.data, number) for number in TRAINING]
    windows, settings = real(walks, options.every), Settings(width=8, frames=WINDOW, batch=16, rate=2e-3)
    paths = {name: chosen(options.simulated, variant) for name, variant in VARIANTS.items()}
    jobs = {
        name: partial(tried, each, paths[name], windows, settings, options.steps) for name, each in VARIANTS.items()
    }
    found, rows = dict(zip(jobs, performed(jobs, None, "trainings"), strict=True)), []
    for name, each in found.items():
        reference = found[QUARTER if name in SUBSETS else EVERYTHING]
        worse = np.array([each[walk] - reference[walk] for walk in each])
        rows.append({
            "training": name, "simulated walks": len(paths[name]), "chamfer_m": float(np.mean(list(each.values()))),
            "increase_m": float(worse.mean()), "+-": float(worse.std(ddof=1) / np.sqrt(len(worse))),
        })  # fmt: skip
    return Page(
        rows,
        data=radarhd("RadarHD's training walks", walks),
        notes=[
            "chamfer_m: median Chamfer distance of a real walk's points from the lidar's, matched by time, m, mean "
            f"over walks. increase_m: mean difference to `{EVERYTHING}` on the same walks, or to `{QUARTER}` for "
            "subsets of the simulated walks; +-: standard error over walks. `another seed` shows the difference "
            "between two trainings with the same settings.",
            f"Each network has width {settings.width} and was trained on simulated walks only, for {options.steps} "
            f"steps of {settings.batch} windows; the density of points is the best on these walks.",
        ],
    )
