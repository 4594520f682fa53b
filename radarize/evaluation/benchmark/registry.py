"""The benchmarks of `radarize benchmark NAME`: entry points of the group ``radarize.benchmarks``.

Any package may add one: a `Benchmark` with a `pairs` and a `tables`. Methods of `radarize.pipeline.methods` appear in
all of them.
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
    "Tested on platforms that, with --train, no training saw (the paper's table 3).",
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
    "Tested in buildings that, with --train, no training saw (the paper's table 5).",
    Chosen.by_odometry,
    slam.building_tables,
    "building",
    draw=draw,
)
WALKS = Benchmark(
    "Odometry and SLAM on test walks",
    "Errors of each method, whether it knows them, and the walks where SLAM is worst.",
    walks.pairs,
    walks.tables,
    "random",
    draw=draw,
    picture=lambda study, tables: walks.worst(study),
)
RUNTIME = Benchmark(
    "Run time",
    "Milliseconds per frame of every stage (the paper's table 6).",
    runtime.pairs,
    runtime.tables,
    timed=True,
)
MAPPING = Benchmark(
    "Scans and maps",
    "Scans against true surfaces, what wrong ones come from, and maps against the floor plan.",
    Chosen.by_scans,
    mapping.tables,
    "random",
    draw=partial(draw, parts="maps errors", name=lambda pair: pair.scans),
)
MULTIPATH = Benchmark(
    "Multipath",
    "Ghosts, missed surfaces, maps and odometry as multipath becomes severe (data set `stress`).",
    varied.stress_pairs,
    varied.stress_tables,
    lacks=varied.STRESS.lacks,
    draw=varied.STRESS.draw,
    picture=varied.STRESS.picture,
)
RADARS = Benchmark(
    "Other radars",
    "Networks of one radar on others, beside methods without networks (data set `radars`).",
    radars.pairs,
    radars.tables,
    lacks=radars.lacks,
)
ABLATION = Benchmark(
    "Ablations",
    "Which radar would do better: classical methods over values of its parameters (data sets `ablation/...`).",
    varied.classical_pairs,
    varied.ablation_tables,
    lacks=varied.ABLATION.lacks,
    draw=varied.ABLATION.draw,
    picture=varied.ABLATION.picture,
)
