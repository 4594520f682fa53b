"""Fine-tuning on real walks: a network for RadarHD's pictures, trained on real walks alone, and pretrained in
simulation.

Networks are trained on training walks, with pictures matched by time (`radarize.baselines.walks.clock`), and evaluated
on test walks, matched by time and by frame index. Weights are written to a folder of the user's; existing weights are
used again. Trainings need a GPU; `--steps 10` is a trial on two cores.
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
    """Chamfer distances with frames matched by index and by time, m."""

    by_index: float
    by_time: float


#: Training walks by their number; learning rates and steps of both trainings (`tuned`: pretrained in simulation).
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
#: Interval of the frames that are read, as in the network's windows: 0.2 s; batch size.
EVERY, BATCH = 4, 64
#: Test walks by place.
GROUPS = {
    "building of the training": (117, 132),
    "another building": (227, 230, 233, 237, 242),
    "standing still": (248, 250),
}


class Seen:
    """Real walks in memory: pictures of the radar, and of the lidar matched by time."""

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
        """Return walk and newest frame of each window."""
        return [(walk, k) for walk, there in enumerate(self.there) for k in range(window - 1, len(there)) if there[k]]

    def windows(self, items: list[tuple[int, int]], window: int) -> tuple[Maps, Tensor]:
        """Return pictures and labels of windows."""
        pictures = torch.stack([self.radar[walk][k - window + 1 : k + 1] for walk, k in items]).float()
        return pictures[:, :, None], unpacked(torch.stack([self.lidar[walk][k] for walk, k in items]))


def trained(
    seen: Seen, start: Path | None, rate: float, steps: int, report: Callable[[], None]
) -> tuple[PictureNet, Header]:
    """Train the network for a number of steps on real walks; return it with its header."""
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
    """Choose the probability above which every cell has a point, by the least median Chamfer distance on the training
    walks."""
    distances = {value: [] for value in DENSE}
    for item in seen.items(window)[::every]:
        pictures, label = seen.windows([item], window)
        likely = net.estimate(pictures)
        for value, found in distances.items():
            shown = points(likely, value)[0].cpu().numpy()
            found.append(PointCloudDistance.of_pictures(shown, label[0].bool().cpu().numpy()).chamfer)
    return min(distances, key=lambda value: np.nanmedian(distances[value]))


def train(options: argparse.Namespace) -> None:
    """Train the networks whose weights do not exist."""
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
    """Return the radar's pictures of the window that ends at a frame."""
    return np.stack([walk.radar(k) for k in range(end - EVERY * (frames - 1), end + 1, EVERY)])


def judged(walks: list[Walk], path: Path, every: int) -> tuple[dict[int, Distances], Header]:
    """Return the median Chamfer distances of each walk, m, matched by frame index and by time."""
    net, header = load(path, PictureNet, PRESETS["radarhd"])
    found = {}
    for walk in walks:
        partners, distances = Clock.of(walk).partners(walk.frames), []
        for end in (frame for frame in range(FIRST, walk.frames, every) if partners[frame] >= 0):
            pictures = torch.from_numpy(window(walk, end, header.frames))[None, :, None].float()
            with torch.inference_mode():
                cells = points(net.estimate(pictures), net.dense)[0].numpy()
            distances.append(
                [PointCloudDistance.of_pictures(cells, walk.lidar(k)).chamfer for k in (end, int(partners[end]))]
            )
        found[walk.number] = Distances(*(float(each) for each in np.nanmedian(distances, axis=0)))
    return found, header


def draw(rows: list[dict]) -> Figure:
    """Plot the Chamfer distance over the duration of the real training walks, with and without simulation."""
    figure, axes = plt.subplots(1, len(GROUPS), figsize=(11, 3.2), sharey=True)
    for axis, group in zip(axes, GROUPS, strict=True):
        for how, word in (("tuned", "simulation first"), ("alone", "real walks alone")):
            some = [row for row in rows if row["how"] == how]
            axis.plot([row["minutes"] for row in some], [row[group] for row in some], "o-", label=word)
        axis.axhline(next(row[group] for row in rows if row["how"] == "simulation"), ls=":", label="simulation alone")
        axis.set(title=group, xlabel="real training walks, min", xscale="log")
    axes[0].set(ylabel="Chamfer distance, m", ylim=(0, None))
    axes[0].legend()
    figure.tight_layout()
    return figure


def _path(folder: Path, shown: int, how: str) -> Path:
    return folder / f"{how}-{shown}.safetensors"


@script(
    "Fine-tuning on real walks",
    data=CLONE,
    start=(Weights().of("pictures"), "weights trained in simulation"),
    steps=(0, "steps of each training; the numbers of the page if 0"),
    weights=(Path("tuned"), "folder of the weights"),
    every=(6, "every N-th frame of the test walks is evaluated"),
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
            row[place if by == "by_time" else f"{place}, by frame index"] = mean
        rows.append(row)
    return Page(
        rows,
        figure=draw(rows),
        data=radarhd("RadarHD's test walks", walks),
        networks=tuple(UsedNetwork.of(path) for path in paths.values()),
        notes=[
            "Median Chamfer distance of a walk's points from the lidar's, matched by time and by frame index, m; mean "
            "over the walks of a group. `alone`: trained on real walks only; `tuned`: pretrained on simulated walks; "
            "`simulation`: trained on simulated walks only.",
            "Steps, learning rates and training walks were fixed before the evaluation on test walks; the probability "
            "above which every cell has a point was chosen on the training walks.",
        ],
    )
