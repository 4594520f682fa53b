"""Every benchmark, by name: what `radarize benchmark NAME` accepts.

A new one is a file with a `pairs` and a `tables`, and an entry here; new methods, which appear in all of them, are
entries in `radarize.methods`.
"""

from radarize.benchmark import mapping, odometry, runtime, slam, varied
from radarize.benchmark.benchmark import Benchmark
from radarize.benchmark.drawings import draw_maps, draw_odometry, draw_slam

BENCHMARKS: dict[str, Benchmark] = {
    "odometry": Benchmark(
        "Odometry",
        "Trajectories by odometry alone, tested on random splits (the paper's table 2).",
        odometry.pairs,
        odometry.tables,
        "random",
        draw=draw_odometry,
    ),
    "odometry-platforms": Benchmark(
        "Odometry on unseen platforms",
        "Tested on platforms that, with --train, no training saw (the paper's table 3).",
        odometry.pairs,
        odometry.platform_tables,
        "platform",
        draw=draw_odometry,
    ),
    "slam": Benchmark(
        "SLAM",
        "Trajectories by combinations of odometry and scans (the paper's table 4).",
        slam.pairs,
        slam.tables,
        "random",
        draw=draw_slam,
    ),
    "buildings": Benchmark(
        "SLAM in unseen buildings",
        "Tested in buildings that, with --train, no training saw (the paper's table 5).",
        slam.building_pairs,
        slam.building_tables,
        "building",
        draw=draw_slam,
    ),
    "runtime": Benchmark(
        "Run time",
        "Milliseconds per frame of every stage (the paper's table 6).",
        runtime.pairs,
        runtime.tables,
        timed=True,
    ),
    "mapping": Benchmark(
        "Scans and maps",
        "Scans against true surfaces, what wrong ones come from, and maps against the floor plan.",
        mapping.pairs,
        mapping.tables,
        "random",
        draw=draw_maps,
    ),
    "multipath": Benchmark(
        "Multipath",
        "Ghosts, missed surfaces, maps and odometry as multipath becomes severe (data set `stress`).",
        mapping.pairs,
        varied.stress_tables,
        lacks=varied.lacks_stress,
        draw=varied.draw_stress,
    ),
    "ablation": Benchmark(
        "Ablations",
        "Which radar would do better: classical methods over values of its parameters (data sets `ablation/...`).",
        varied.classical_pairs,
        varied.ablation_tables,
        lacks=varied.lacks_ablation,
        draw=varied.draw_ablation,
    ),
}
