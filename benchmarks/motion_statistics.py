"""Motion statistics of the platforms in buildings of all styles, and those of the paper's data set."""

import argparse
import time

import numpy as np
import pandas as pd
from rich.progress import track

from benchmarks.results import Data, Page, script, walked
from radarize.evaluation.benchmark.table import PAPER
from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.statistics import Statistics
from radarsim.world.scene import Scene

DURATION = 60.0
#: Statistics of the paper's platforms and data set.
THEIRS = {
    "handheld": {"distance": "over 50", "top": "up to 1.6", "ways": "forward, backward, sideways, fast turns"},
    "cart": {"distance": "over 50", "top": "up to 1.6", "ways": "mostly constant, slow turns; forward and backward"},
    "robot": {"distance": "about 20", "top": "up to 0.5", "ways": "forward and backward"},
}


def walks(count: int, seed: int) -> pd.DataFrame:
    """Return statistics of one walk of each platform through each building, with the CPU time of planning, s."""
    rng, found = np.random.default_rng(seed), []
    for number in track(range(count), "buildings"):
        building = {"kind": "ABCD"[number % 4], "seed": int(rng.integers(10_000)), "floor": int(rng.integers(4))}
        scene = Scene.of({"building": building}, f"{building['kind']}{building['seed']}")
        for platform in PLATFORMS:
            start = time.process_time()
            motion = plan_motion(scene, platform, DURATION, np.random.default_rng(building["seed"]))
            took = time.process_time() - start
            about = {"platform": platform, "took": took, "walk": walked(scene.name, building["seed"], motion)}
            found.append(about | vars(Statistics.of(motion, scene)))
    return pd.DataFrame(found)


def row(platform: str, walks: pd.DataFrame) -> dict[str, object]:
    """Return a row of means, or extremes where named so, over the walks of a platform."""
    figures, paper = walks.drop(columns=["platform", "walk"]), THEIRS[platform]
    mean, top, least = figures.mean(), figures.max(), figures.min()
    ways = mean[["forward", "backward", "sideways", "standing"]]
    return {
        "platform": platform,
        "walks": len(walks),
        "distance m": f"{mean['distance']:.1f} ({least['distance']:.0f} to {top['distance']:.0f})",
        "paper": paper["distance"],
        "mean speed m/s": mean["mean_speed"],
        "top speed m/s": top["top_speed"],
        "paper's top": paper["top"],
        "turn rate RMS, top deg/s": f"{np.rad2deg(mean['rms_turn_rate']):.0f}, {np.rad2deg(top['top_turn_rate']):.0f}",
        "roll, pitch RMS deg": f"{np.rad2deg(mean['rms_roll']):.1f}, {np.rad2deg(mean['rms_pitch']):.1f}",
        "forward, backward, sideways, standing": ", ".join(f"{share:.0%}" for share in ways),
        "paper's ways": paper["ways"],
        "least clearance m": least["clearance"],
    }


@script(
    f"Motion statistics of the platforms over {DURATION:.0f} s, and of the paper's data set",
    buildings=(20, "number of buildings"),
    seed=(0, "seed of the buildings"),
)
def main(options: argparse.Namespace) -> Page:
    """Plan the walks."""
    found = walks(options.buildings, options.seed)
    took = found["took"]
    return Page(
        [row(platform, found[found["platform"] == platform]) for platform in PLATFORMS],
        data=Data("planned walks", tuple(found["walk"]), options.seed),
        beside=[PAPER],
        notes=[
            "One walk per platform through each building of styles A to D; distance: path length of the sensor in the "
            "horizontal plane.",
            "The paper states means over trajectories of about a minute: over 50 m (handheld, cart), about 20 m "
            "(robot). Its totals, 4,680 m in 226,800 frames at 30 Hz, are 32 m in 52 s per trajectory, less than "
            "these means.",
            f"CPU time of planning a walk: median {took.median():.2f} s, maximum {took.max():.2f} s.",
        ],
    )
