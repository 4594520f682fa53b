"""The benchmarks of `radarize benchmark NAME`: entry points of the group ``radarize.benchmarks``.

Any package can add a `Benchmark` with functions `pairs` and `tables`. Methods of `radarize.pipeline.methods` are
available in all of them.
"""

from functools import partial

from radarize.evaluation.benchmark import mapping, odometry, radars, runtime, slam, varied, walks
from radarize.evaluation.benchmark.drawings import draw
from radarize.evaluation.benchmark.study import Benchmark, Chosen

_PATHS = partial(draw, which="odometry", parts="trajectories errors", name=lambda pair: pair.odometry)

ODOMETRY = Benchmark(
    "Odometry",
    "Trajectories by odometry alone, tested on random splits (the paper's table 2).",
    Chosen.by_odometry,
    odometry.tables,
    "random",
    draw=_PATHS,
)
ODOMETRY_PLATFORMS = Benchmark(
    "Odometry on other platforms",
    "Trajectories by odometry on platforms that, with --train, are not in the training (the paper's table 3).",
    Chosen.by_odometry,
    odometry.platform_tables,
    "platform",
    draw=_PATHS,
)
SLAM = Benchmark(
    "SLAM",
    "Trajectories by combinations of odometry and scans (the paper's table 4).",
    slam.pairs,
    slam.tables,
    "random",
    draw=draw,
)
BUILDINGS = Benchmark(
    "SLAM in unseen buildings",
    "Trajectories by SLAM in buildings that, with --train, are not in the training (the paper's table 5).",
    Chosen.by_odometry,
    slam.building_tables,
    "building",
    draw=draw,
)
WALKS = Benchmark(
    "Odometry and SLAM on test walks",
    "Errors and NEES of each method on test walks, and the walks with the largest errors of SLAM.",
    walks.pairs,
    walks.tables,
    "random",
    draw=draw,
    picture=lambda study, tables: walks.worst(study),
)
RUNTIME = Benchmark(
    "Run time",
    "Run time of every stage, ms per frame (the paper's table 6).",
    runtime.pairs,
    runtime.tables,
    timed=True,
)
MAPPING = Benchmark(
    "Scans and maps",
    "Errors of scans against true surfaces, path types of wrong returns, and maps against the floor plan.",
    Chosen.by_scans,
    mapping.tables,
    "random",
    draw=partial(draw, parts="maps errors", name=lambda pair: pair.scans),
)
MULTIPATH = Benchmark(
    "Multipath",
    "Ghosts, missed surfaces, maps and odometry over the severity of multipath (data set `stress`).",
    varied.stress_pairs,
    varied.stress_tables,
    lacks=varied.STRESS.lacks,
    draw=varied.STRESS.draw,
    picture=varied.STRESS.picture,
)
RADARS = Benchmark(
    "Other radars",
    "Networks trained for one radar on other radars, and methods without networks (data set `radars`).",
    radars.pairs,
    radars.tables,
    lacks=radars.lacks,
)
ABLATION = Benchmark(
    "Ablations",
    "Methods without networks over parameters of the radar and its mounting (data sets `ablation/...`).",
    varied.classical_pairs,
    varied.ablation_tables,
    lacks=varied.ABLATION.lacks,
    draw=varied.ABLATION.draw,
    picture=varied.ABLATION.picture,
)
