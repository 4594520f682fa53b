"""How the platforms move, beside the figures of the paper's data set, over buildings of all styles."""

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
#: What the paper says of its platforms and data set; the gaps it leaves are "-".
THEIRS = {
    "handheld": {"distance": "over 50", "top": "up to 1.6", "ways": "forward, backward, sideways, fast turns"},
    "cart": {"distance": "over 50", "top": "up to 1.6", "ways": "mostly constant, slow turns; forward and backward"},
    "robot": {"distance": "about 20", "top": "up to 0.5", "ways": "forward and backward"},
}


def walks(count: int, seed: int) -> pd.DataFrame:
    """Statistics of one walk of each platform through some buildings, with the CPU time of planning, s."""
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
    """Means over the walks, or the extreme where it says so."""
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
    f"How the platforms move in {DURATION:.0f} s, and in the paper's data set",
    buildings=(20, "walked through"),
    seed=(0, "that they are drawn from"),
)
def main(options: argparse.Namespace) -> Page:
    """Walk and publish."""
    found = walks(options.buildings, options.seed)
    took = found["took"]
    return Page(
        [row(platform, found[found["platform"] == platform]) for platform in PLATFORMS],
        data=Data("planned walks", tuple(found["walk"]), options.seed),
        beside=[PAPER],
        notes=[
            "One walk per platform through each building of styles A to D; distance is the sensor's, over the ground.",
            "The paper gives its means over trajectories of about a minute: over 50 m by hand and on the cart, about "
            "20 m on the robot. Its totals, 4,680 m in 226,800 frames at 30 Hz, are 32 m in 52 s per trajectory, "
            "less than those means would give.",
            f"Planning a walk takes {took.median():.2f} s of CPU time (median, at most {took.max():.2f} s).",
        ],
    )
