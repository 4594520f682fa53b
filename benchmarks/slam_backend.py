"""SLAM back end: errors on real lidar logs, graphs with false loops and simulated radar walks; run time and memory."""

import argparse
import time
from dataclasses import replace
from operator import itemgetter
from pathlib import Path

import numpy as np
import pandas as pd
from rich.progress import track

from benchmarks.results import SHARED, Data, NamedWalk, Page, memory_mb, script, timed
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.table import Beside
from radarize.io.jsonfile import read_json
from radarize.io.pose import between, compose, wrap
from radarize.io.tum import planar, read_tum
from radarize.pipeline.log import Log
from radarize.pipeline.methods import BEST
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig, WallsConfig
from tests.slam.world import align, ate, lap

RADISH = SHARED / "radish"
#: Cartographer on the same files, with its best settings: mean ATE, m and rad; run time, s.
THEIRS = Beside("Cartographer", "lidar logs, the very same files", simulated=False)
CARTOGRAPHER = {"intel": (0.055, 0.0126, 33), "csail": (0.130, 0.0184, 36), "orebro": (0.149, 0.0138, 19)}
#: Label of rows with the preset of Cartographer's settings.
CLASSIC = "preset cartographer"


def errors(truth: np.ndarray, estimate: np.ndarray) -> tuple[float, float]:
    """Return the mean error of position (m) and heading (rad) after rigid alignment of the positions."""
    turn, _ = align(truth, estimate)
    heading = wrap(estimate[:, 2] + np.arctan2(turn[1, 0], turn[0, 0]) - truth[:, 2])
    return ate(truth, estimate), float(np.abs(heading).mean())


def loop_length(truth: np.ndarray) -> float:
    """Return the longest path between two visits of a place (within 1 m and 60 deg), m."""
    thin = truth[:: max(1, len(truth) // 600)]
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(thin[:, :2], axis=0).T))])
    same = np.hypot(*np.moveaxis(thin[:, None, :2] - thin[None, :, :2], -1, 0)) < 1.0
    same &= np.abs(wrap(thin[:, None, 2] - thin[None, :, 2])) < np.pi / 3
    return float((np.abs(along[:, None] - along) * same).max())


def play(log: Log, config: SlamConfig) -> tuple[Slam, dict[str, float]]:
    """Run SLAM on a log; return it with run times per scan, including its odometry, and in all."""

    def clocks(done: int = 0, total: int = 0) -> None:
        instants.append((time.perf_counter(), time.thread_time(), time.process_time()))

    slam, instants = Slam(config), []
    clocks()
    log.feed(slam, clocks)
    wall, thread, _ = 1e3 * np.diff(instants, axis=0).T
    online = instants[-1][2] - instants[0][2]
    clocks()
    whole, _, used = np.subtract(instants[-1], instants[0])
    return slam, {
        "s": whole,
        "CPU s": used,
        "CPU ms per scan, all threads": 1e3 * online / len(wall),
        "ms per scan": wall.mean(),
        "p99 ms": np.percentile(wall, 99),
        "CPU ms per scan": thread.mean(),
        "p99 CPU ms": np.percentile(thread, 99),
    }


def row(case: str, log: Log, truth: np.ndarray, config: SlamConfig, against: str = "-") -> dict[str, object]:
    """Run SLAM on a log and compare it with the truth at its scans."""
    slam, took = play(log, config)
    times, poses = slam.trajectory()
    kept = np.searchsorted(log.times, times)
    alone = np.array([slam.odometry.pose(t) for t in times])
    position, heading = errors(truth[kept], poses)
    before = ate(truth[kept], alone)
    farthest, true = (np.hypot(*(path - path[0])[:, :2].T).max() for path in (poses, truth[kept]))
    return {
        "case": case,
        "path m": float(np.hypot(*np.diff(truth[:, :2], axis=0).T).sum()),
        "loop m": loop_length(truth),
        "odometry ATE m": before,
        "ATE m": position,
        "ATE rad": heading,
        "ratio": position / before,
        "length %": 100 * farthest / true - 100,
        "to beat": against,
        "closures": f"{int(slam.graph.accepted.sum())}/{len(slam.graph.closures)}",
        "submaps": len(slam.submaps),
        **took,
    }


def lidar(name: str) -> tuple[Log, np.ndarray]:
    """Read a log of the Radish repository and its corrected poses."""
    scans, odometry, truth = (RADISH / f"{name}.{what}" for what in ("scans.npz", "odometry.tum", "truth.tum"))
    return Log.read(scans, odometry), planar(read_tum(truth)[1])


def noisier(log: Log, truth: np.ndarray, rng: np.random.Generator) -> Log:
    """Add the odometry's own random errors once more, in another order."""
    steps = between(log.odometry[:-1], log.odometry[1:])
    errors = steps - between(truth[:-1], truth[1:])
    errors[:, 2] = wrap(errors[:, 2])
    poses = [log.odometry[0]]
    for step in steps + rng.permutation(errors - np.median(errors, axis=0)):
        poses.append(compose(poses[-1], step))
    return replace(log, odometry=np.array(poses))


def repeated(log: Log, truth: np.ndarray, passes: int) -> tuple[Log, np.ndarray]:
    """Repeat a log forward, backward, forward..., for a long log with many loop closures."""
    order = np.concatenate([np.arange(len(truth))[:: 1 if k % 2 == 0 else -1][k > 0 :] for k in range(passes)])
    times = np.arange(float(len(order)))
    there = replace(log, times=times, ranges=log.ranges[order], odometry_times=times, odometry=log.odometry[order])
    return there, truth[order]


def graph_rows(seed: int) -> list[dict[str, object]]:
    """Optimise a graph of a lap (`tests.slam.world`) with ten true loop closures and some false ones."""
    rows = []
    for false in (0, 2, 5):
        graph, truth, before = lap(false, seed)
        _, took = timed(graph.optimise)
        position, heading = errors(truth, graph.poses)
        clean = rows[0]["ATE m"] if rows else position
        rows.append({
            "case": f"graph of {len(truth)} nodes, {false} false loops", "path m": 200.0, "odometry ATE m": before,
            "ATE m": position, "ATE rad": heading, "ratio": position / before, "to beat": f"{1.05 * clean:.3f} m",
            "closures": f"{int(graph.accepted.sum())}/{len(graph.closures)}", "s": took,
        })  # fmt: skip
    return rows


def radar_rows(folder: Path) -> tuple[list[dict[str, object]], list[NamedWalk]]:
    """Return means over the runs in the folder of a benchmark, with their odometry and scans, and the run with the
    largest error, by settings; and the walks."""
    paths = sorted(path.parent for path in folder.glob(f"*/{Pair(**BEST)}/reference.tum"))
    if not paths:
        raise SystemExit(f"{folder}: has no runs of {Pair(**BEST)}, expected the runs of `radarize benchmark walks`")
    radar = SlamConfig.preset("radar")
    cases = {
        "radar": radar,
        "radar, without walls": radar.model_copy(update={"walls": WallsConfig()}),
        f"radar, {CLASSIC}": SlamConfig.preset("cartographer"),
    }
    found: dict[str, list[dict[str, object]]] = {case: [] for case in cases}
    walks = []
    for path in track(paths, "radar walks"):
        log, (times, poses) = Log.read(path), read_tum(path / "reference.tum")
        truth = planar(poses)[np.abs(times[None] - log.times[:, None]).argmin(axis=1)]
        for case, config in cases.items():
            found[case].append(row(path.parent.name, log, truth, config))
        about = read_json(path / "run.json")["recording_attributes"]
        walks.append(
            NamedWalk(about.get("scene", "-"), about.get("seed"), found["radar"][-1]["path m"], "engine" in about)
        )
    summary = []
    for case, rows in found.items():
        worst = max(rows, key=itemgetter("ATE m"))
        summary.append({"case": f"{case}, mean of {len(rows)} walks", **pd.DataFrame(rows).mean(numeric_only=True)})
        summary.append(worst | {"case": f"{case}, the worst: {worst['case']}"})
    return summary, walks


@script(
    "SLAM back end",
    data=(Path, "folder of the runs of `radarize benchmark walks`; only lidar logs and graphs if none"),
    seeds=(3, "number of disturbed versions of each log"),
    seed=(7, "first seed of the disturbances"),
)
def main(options: argparse.Namespace) -> Page:
    lidar_preset, rows, walks, notes = SlamConfig.preset("lidar"), [], [], []
    warm, _ = lidar("orebro")
    play(replace(warm, times=warm.times[:60], ranges=warm.ranges[:60]), lidar_preset)
    for name, (metres, radians, seconds) in CARTOGRAPHER.items():
        log, truth = lidar(name)
        target = f"{metres} m, {radians} rad, {seconds} s"
        rows.append(row(f"lidar, {name}", log, truth, lidar_preset, target))
        walks.append(NamedWalk(name, None, rows[-1]["path m"], simulated=False))
        rows.append(row(f"lidar, {name}, {CLASSIC}", log, truth, SlamConfig.preset("cartographer")))
        disturbed: dict[str, list[str]] = {"odometry noise x 2": [], "a third of the scans lost": []}
        for seed in range(options.seeds):
            rng = np.random.default_rng(options.seed + seed)
            noise = noisier(log, truth, rng), truth
            keep = np.sort(rng.permutation(len(truth))[: 2 * len(truth) // 3])
            fewer = replace(log, times=log.times[keep], ranges=log.ranges[keep]), truth[keep]
            for found, case in zip(disturbed.values(), (noise, fewer), strict=True):
                found.append(f"{row('', *case, lidar_preset)['ATE m']:.3f}")
        notes += [f"{name}, {what}, {options.seeds} seeds: ATE {', '.join(disturbed[what])} m." for what in disturbed]
    rows += graph_rows(options.seed)
    log, truth = repeated(*lidar("intel"), passes=3)
    resident = memory_mb()
    rows.append(row("lidar, intel repeated to 500 submaps", log, truth, lidar_preset, "5 ms, p99 30 ms"))
    notes.append(
        f"Memory grew by {10 * (memory_mb() - resident) / rows[-1]['path m']:.2f} MB per 10 m on the way to "
        f"{rows[-1]['submaps']} submaps, the final optimisation included."
    )
    if options.data:
        found, simulations = radar_rows(options.data)
        rows, walks = rows + found, walks + simulations
    return Page(
        rows,
        data=Data("lidar logs of Radish and radar walks", tuple(walks), options.seed),
        networks=Networks().used(Pair(**BEST).networks) if options.data else (),
        beside=[THEIRS],
        notes=[
            "ATE: mean errors after alignment. closures: accepted / found loop closures. One preset for all logs, and "
            "one for all radar runs. Targets of the lidar logs are Cartographer's errors with its best settings.",
            "per scan: wall and processor time of `add_odometry` and `add_scan` in the calling thread; the loop search "
            "runs in two other threads. s, CPU s: the whole log, including the final optimisation.",
            "Settings for lidar were chosen among about 20 variants on these logs and their disturbed versions: "
            "results on the undisturbed logs are optimistic, the disturbed ones show the spread.",
            *notes,
        ],
    )
