"""What simulation saves of reality: the network for RadarHD's pictures trained on real walks alone, and the same walks
shown to one that was trained in simulation first.

Pictures are matched by time (`radarize.baselines.walks.clock`), and judged by time and by frame index. Only training
walks are shown, and only test walks judge. The weights stay with whoever makes them, and those that are there already
are not made again. Made for a GPU; `--steps 10` tries it on two cores.
"""

import argparse
import math
from collections.abc import Callable
from itertools import count, product
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import torch
from jaxtyping import UInt8
from matplotlib.figure import Figure
from torch import Generator, Tensor

from benchmarks.results import CLONE, Page, UsedNetwork, radarhd, script, tracked
from radarize.baselines.pictures.network import PictureNet
from radarize.baselines.pictures.points import points
from radarize.baselines.pictures.training import DENSE, elsewhere, entropy, unpacked
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.point_cloud_distance import PointCloudDistance
from radarize.baselines.walks.walks import FIRST, PERIOD, Walk
from radarize.evaluation.benchmark.choices import TRAINING
from radarize.io.console import progress
from radarize.learning.nets.weights import Header, build, load, save
from radarize.pipeline.method import Weights
from radarize.radar.presets import PRESETS
from radarize.signal.maps import Maps


class Distances(NamedTuple):
    """Chamfer distances, m."""

    number: float
    instant: float


#: Walks by how many of them are shown; steps and rates of both trainings.
SHOWN = {
    1: (112,),
    5: (112, 118, 123, 129, 136),
    25: TRAINING,
}
RATES = {"alone": 1e-3, "tuned": 3e-4}
STEPS = {
    (1, "alone"): 1000,
    (5, "alone"): 2000,
    (25, "alone"): 3000,
    (1, "tuned"): 400,
    (5, "tuned"): 800,
    (25, "tuned"): 2500,
}
#: Frames of a walk from one that is read to the next, as the network's windows have them: 0.2 s.
EVERY, BATCH = 4, 64
#: Test walks by place.
GROUPS = {
    "building of the training": (117, 132),
    "another building": (227, 230, 233, 237, 242),
    "standing still": (248, 250),
}


class Seen:
    """Real walks in memory: the radar's pictures, and the lidar's of the same instants."""

    def __init__(self, walks: list[Walk], device: torch.device):
        self.radar, self.lidar, self.there = [], [], []
        for walk in walks:
            frames = range(0, walk.frames, EVERY)
            partners = Clock.of(walk).partners(walk.frames)[frames]
            lidar = np.stack([np.packbits(walk.lidar(max(0, partner)), axis=1) for partner in partners.tolist()])
            self.radar.append(torch.from_numpy(np.stack([walk.radar(frame) for frame in frames])).to(device))
            self.lidar.append(torch.from_numpy(lidar).to(device))
            self.there.append(partners >= 0)

    def items(self, window: int) -> list[tuple[int, int]]:
        """Walk and newest frame of each window."""
        return [(walk, k) for walk, there in enumerate(self.there) for k in range(window - 1, len(there)) if there[k]]

    def windows(self, items: list[tuple[int, int]], window: int) -> tuple[Maps, Tensor]:
        """Pictures and labels."""
        pictures = torch.stack([self.radar[walk][k - window + 1 : k + 1] for walk, k in items]).float()
        return pictures[:, :, None], unpacked(torch.stack([self.lidar[walk][k] for walk, k in items]))


def trained(
    seen: Seen, start: Path | None, rate: float, steps: int, report: Callable[[], None]
) -> tuple[PictureNet, Header]:
    """The network after so many steps on real walks, and its header."""
    device = seen.radar[0].device
    net, header = load(Weights().of("pictures") if start is None else start, PictureNet, PRESETS["radarhd"])
    if start is None:
        torch.manual_seed(0)
        net = build(PictureNet, header)
    net = net.to(device).train().requires_grad_(True)
    items, rng = seen.items(header.frames), np.random.default_rng(0)
    generator, optimiser = Generator(device).manual_seed(0), torch.optim.Adam(net.parameters(), rate)
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = (
            rate * min(1, 20 * (step + 1) / steps) * (1 + math.cos(math.pi * step / steps)) / 2
        )
        chosen = [items[k] for k in rng.integers(0, len(items), BATCH)]
        pictures, label = elsewhere(*seen.windows(chosen, header.frames), generator)
        loss = entropy(net(pictures), label).mean()
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        report()
    return net.eval(), header


@torch.inference_mode()
def dense(net: PictureNet, seen: Seen, window: int, every: int = 12) -> float:
    """The probability from which on every cell has a point that brings the points nearest to the lidar's, on the walks
    that were shown."""
    apart = {value: [] for value in DENSE}
    for item in seen.items(window)[::every]:
        pictures, label = seen.windows([item], window)
        likely = net.estimate(pictures)
        for value, found in apart.items():
            shown = points(likely, value)[0].cpu().numpy()
            found.append(PointCloudDistance.of_pictures(shown, label[0].bool().cpu().numpy()).chamfer)
    return min(apart, key=lambda value: np.nanmedian(apart[value]))


def train(options: argparse.Namespace) -> None:
    """Make the weights that are not there yet."""
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    plan = {key: options.steps or steps for key, steps in STEPS.items() if not _path(options.weights, *key).is_file()}
    done = count(1)
    with progress("steps") as report:
        for (shown, how), steps in plan.items():
            walks = [Walk.find(options.data, number) for number in SHOWN[shown]]
            seen = Seen(walks, device)
            step = lambda: report(next(done), sum(plan.values()))  # noqa: E731
            net, header = trained(seen, options.start if how == "tuned" else None, RATES[how], steps, step)
            net.dense.fill_(dense(net, seen, header.frames))
            metrics = {"minutes": sum(walk.frames for walk in walks) * PERIOD / 60}
            data = f"{shown} real walks" + (f" after {header.data}" if how == "tuned" else "")
            _path(options.weights, shown, how).parent.mkdir(parents=True, exist_ok=True)
            save(net, header.model_copy(update={"data": data, "metrics": metrics}), _path(options.weights, shown, how))


def window(walk: Walk, end: int, frames: int) -> UInt8[np.ndarray, "frame range azimuth"]:
    """The radar's pictures that a network sees at a frame."""
    return np.stack([walk.radar(k) for k in range(end - EVERY * (frames - 1), end + 1, EVERY)])


def judged(walks: list[Walk], path: Path, every: int) -> tuple[dict[int, Distances], Header]:
    """Median Chamfer distance of each walk, m, by number and by instant."""
    net, header = load(path, PictureNet, PRESETS["radarhd"])
    found = {}
    for walk in walks:
        partners, apart = Clock.of(walk).partners(walk.frames), []
        for end in (frame for frame in range(FIRST, walk.frames, every) if partners[frame] >= 0):
            pictures = torch.from_numpy(window(walk, end, header.frames))[None, :, None].float()
            with torch.inference_mode():
                cells = points(net.estimate(pictures), net.dense)[0].numpy()
            apart.append(
                [PointCloudDistance.of_pictures(cells, walk.lidar(k)).chamfer for k in (end, int(partners[end]))]
            )
        found[walk.number] = Distances(*(float(each) for each in np.nanmedian(apart, axis=0)))
    return found, header


def draw(rows: list[dict]) -> Figure:
    """Error over minutes, with and without simulation before."""
    figure, axes = plt.subplots(1, len(GROUPS), figsize=(11, 3.2), sharey=True)
    for axis, group in zip(axes, GROUPS, strict=True):
        for how, word in (("tuned", "simulation first"), ("alone", "real walks alone")):
            some = [row for row in rows if row["how"] == how]
            axis.plot([row["minutes"] for row in some], [row[group] for row in some], "o-", label=word)
        axis.axhline(next(row[group] for row in rows if row["how"] == "simulation"), ls=":", label="simulation alone")
        axis.set(title=group, xlabel="minutes of real walks", xscale="log")
    axes[0].set(ylabel="Chamfer distance, m", ylim=(0, None))
    axes[0].legend()
    figure.tight_layout()
    return figure


@script(
    "What simulation saves of reality",
    data=CLONE,
    start=(Weights().of("pictures"), "weights that were trained in simulation"),
    steps=(0, "of each training; as many as it is worth if 0"),
    weights=(Path("tuned"), "folder of the weights"),
    every=(6, "of so many frames of the test walks one is judged"),
)
def main(options: argparse.Namespace) -> Page:
    train(options)
    walks = Walk.tests(options.data)
    paths = {(0, "simulation"): options.start} | {key: _path(options.weights, *key) for key in STEPS}
    rows = []
    for (shown, how), path in tracked([*paths.items()], "judging"):
        found, header = judged(walks, path, options.every)
        row = {"how": how, "real walks": shown, "minutes": header.metrics.get("minutes", 0.0)}
        for (place, some), by in product(GROUPS.items(), reversed(Distances._fields)):
            mean = np.mean([getattr(found[walk], by) for walk in some if walk in found])
            row[place if by == "instant" else f"{place}, by number"] = mean
        rows.append(row)
    return Page(
        rows,
        figure=draw(rows),
        data=radarhd("RadarHD's test walks", walks),
        networks=tuple(UsedNetwork.of(path) for path in paths.values()),
        notes=[
            "Median Chamfer distance of a walk's points from the lidar's of the same instant, and of the same number, "
            "m, mean over the walks of a group; `alone`: trained on real walks alone; `tuned`: trained on simulated "
            "walks first; `simulation`: on these alone.",
            "Steps, rates and walks were fixed before any test walk was looked at; the probability from which on "
            "every cell has a point is that which is best on the walks that were shown.",
        ],
    )


def _path(folder: Path, shown: int, how: str) -> Path:
    return folder / f"{how}-{shown}.safetensors"
