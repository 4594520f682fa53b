"""How the platforms move, beside the figures of the paper's data set, over buildings of all styles."""

import time

import numpy as np
import pandas as pd
from rich.progress import track

from benchmarks.results import Data, Walk, command_line, publish
from radarize.benchmark.table import PAPER
from radarsim.planner import plan_motion
from radarsim.platforms import PLATFORMS
from radarsim.scene.scene import Scene
from radarsim.statistics import Statistics

DURATION = 60.0
#: What the paper says of its platforms and data set; the gaps it leaves are "-".
THEIRS = {
    "handheld": {"distance": "over 50", "top": "up to 1.6", "ways": "forward, backward, sideways, fast turns"},
    "cart": {"distance": "over 50", "top": "up to 1.6", "ways": "mostly constant, slow turns; forward and backward"},
    "robot": {"distance": "about 20", "top": "up to 0.5", "ways": "forward and backward"},
}


def walks(count: int, seed: int) -> tuple[dict[str, list[Statistics]], list[Walk], list[float]]:
    """Statistics by platform of one walk each through some buildings, the walks, and the CPU times of planning, s."""
    rng = np.random.default_rng(seed)
    found: dict[str, list[Statistics]] = {name: [] for name in PLATFORMS}
    times, made = [], []
    for number in track(range(count), "buildings"):
        building = {"kind": "ABCD"[number % 4], "seed": int(rng.integers(10_000)), "floor": int(rng.integers(4))}
        scene = Scene.of({"building": building}, f"{building['kind']}{building['seed']}")
        for platform, statistics in found.items():
            start = time.process_time()
            motion = plan_motion(scene, platform, DURATION, np.random.default_rng(building["seed"]))
            times.append(time.process_time() - start)
            statistics.append(Statistics.of(motion, scene))
            made.append(Walk(scene.name, building["seed"], statistics[-1].distance, simulated=True))
    return found, made, times


def row(platform: str, found: list[Statistics]) -> dict[str, object]:
    """Means over the walks, or the extreme where it says so."""
    walks = pd.DataFrame(list(map(vars, found)))
    mean, top, least, paper = walks.mean(), walks.max(), walks.min(), THEIRS[platform]
    ways = mean[["forward", "backward", "sideways", "standing"]]
    return {
        "platform": platform,
        "walks": len(found),
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


PARSER = command_line(
    __doc__,
    buildings=(20, "walked through"),
    seed=(0, "that they are drawn from"),
)


def main() -> None:
    """Walk and publish."""
    arguments = PARSER.parse_args()
    found, made, times = walks(arguments.buildings, arguments.seed)
    publish(
        "motion_statistics",
        f"How the platforms move in {DURATION:.0f} s, and in the paper's data set",
        [row(platform, statistics) for platform, statistics in found.items()],
        data=Data("planned walks", tuple(made), arguments.seed),
        networks=(),
        beside=[PAPER],
        notes=[
            "One walk per platform through each building of styles A to D; distance is the sensor's, over the ground.",
            "The paper gives its means over trajectories of about a minute: over 50 m by hand and on the cart, about "
            "20 m on the robot. Its totals, 4,680 m in 226,800 frames at 30 Hz, are 32 m in 52 s per trajectory, "
            "less than those means would give.",
            f"Planning takes {np.median(times):.2f} s of CPU time (median, at most {max(times):.2f} s) a walk.",
        ],
    )


if __name__ == "__main__":
    main()
