"""Parameters of the SLAM back end, with units, defaults and presets.

Defaults are the preset ``lidar``. Values without a source are our own.
"""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.yamlfile import read_settings


class OdometryConfig(Frozen):
    """Standard deviations of one step, for odometry without covariances."""

    translation: float = setting(0.02, "minimum standard deviation of the translation, m", gt=0)
    rotation: float = setting(0.01, "minimum standard deviation of the rotation, rad", gt=0)
    translation_per_metre: float = setting(
        0.05, "standard deviation of the translation per metre of the step, m/m", ge=0
    )
    rotation_per_metre: float = setting(0.02, "standard deviation of the rotation per metre of the step, rad/m", ge=0)
    rotation_per_radian: float = setting(
        0.03, "standard deviation of the rotation per radian of the step, rad/rad", ge=0
    )
    scale: float = setting(
        0.01, "standard deviation of the scale error that all steps share, m/m; it is added to the covariances of "
        "odometry, which describe single steps", ge=0
    )  # fmt: skip
    missing_translation: float = setting(
        0.3, "standard deviation of the translation without any odometry (constant velocity is assumed), m", gt=0
    )
    missing_rotation: float = setting(0.2, "standard deviation of the rotation without any odometry, rad", gt=0)


class NodeConfig(Frozen):
    """Gathering of scans into the nodes of the graph.

    Scans join the open node until the sensor has moved by `distance` or `angle`, or `duration` has passed since its
    first scan. This is the motion filter. It also accumulates points of scans that are too sparse alone.
    """

    distance: float = setting(0.2, "translation after which a new node starts, m", ge=0)
    angle: float = setting(0.1, "rotation after which a new node starts, rad", ge=0)
    duration: float = setting(5.0, "time after which a new node starts, s", ge=0)
    scans: int = setting(1, "maximum number of scans used per node, evenly spaced", gt=0)
    min_points: int = setting(20, "minimum number of points of a node for matching and loop search", gt=0)


class GridConfig(Frozen):
    """Probability grids of submaps and of the final map."""

    resolution: float = setting(0.05, "cell size of submaps, m", ge=0.005)
    map_resolution: float = setting(0.05, "cell size of the final map, m", ge=0.005, le=1)
    hit: float = setting(0.7, "probability that a cell is occupied given one echo in it", gt=0.5, lt=1)
    miss: float = setting(0.45, "probability that a cell is occupied given one ray through it", gt=0, lt=0.5)
    lowest: float = setting(
        0.12, "minimum probability of a cell, so that later evidence can still change it", gt=0, lt=0.5
    )
    highest: float = setting(0.97, "maximum probability of a cell, for the same reason", gt=0.5, lt=1)
    min_range: float = setting(0.1, "minimum range of an echo, m; nearer ones are dropped", ge=0)
    max_range: float = setting(30.0, "maximum range of an echo, m; farther ones count as no echo", gt=0)
    free_range: float = setting(5.0, "range up to which rays without echo clear cells, m; 0: none", ge=0)
    nodes: int = setting(10, "number of nodes of a submap; the next submap starts when half of them are inserted", ge=2)


class MatcherConfig(Frozen):
    """Scan-to-submap matching."""

    enabled: bool = setting(
        True, "match nodes with submaps; otherwise nodes follow odometry, and submaps serve the loop search only"
    )
    presearch_distance: float = setting(
        0.3, "half width of the correlative search before the refinement, m; 0 disables it", ge=0, le=100
    )
    presearch_angle: float = setting(0.17, "half width of that search, rad", ge=0, le=4)
    presearch_sigma: float = setting(
        2.0, "as sigma, for the weight of odometry in that search: far from the match the residuals of the points are "
        "correlated, as most of them are on the same few walls", gt=0
    )  # fmt: skip
    sigma: float = setting(
        0.7, "standard deviation of the residual 1 - p of one point, with independent points; it sets the weight of a "
        "match relative to odometry, and its covariance in the graph", gt=0
    )  # fmt: skip
    translation_floor: float = setting(0.01, "minimum standard deviation of a match, m", gt=0)
    rotation_floor: float = setting(0.003, "minimum standard deviation of a match, rad", gt=0)
    alike: int = setting(
        1, "number of matches, and of closures, with fully correlated errors, because an error of one submap is common "
        "to all matches with it; the covariances of poses count them as one", ge=1
    )  # fmt: skip
    iterations: int = setting(20, "maximum number of Gauss-Newton steps", gt=0, le=1000)
    spacing: float = setting(0.05, "side of the squares in which points are averaged to one, m", ge=0.005)


class LoopConfig(Frozen):
    """Loop closure."""

    enabled: bool = setting(True, "search for loop closures")
    radius: float = setting(10.0, "maximum distance of a node from the centre of a submap that is searched, m", gt=0)
    distance: float = setting(3.0, "half width of the search window, m", gt=0, le=100)
    angle: float = setting(0.5, "half width of the search window, rad", gt=0, le=4)
    candidates: int = setting(4, "maximum number of submaps searched per node, nearest first", gt=0)
    every: int = setting(4, "search loops for every N-th node", gt=0)
    nodes: int = setting(
        1, "number of latest nodes whose points are searched together, as one view may have too few features; in the "
        "search at the end such windows overlap by half", gt=0
    )  # fmt: skip
    front: float = setting(
        0.0, "distance in front of its points at which the submap has to be free, m; it prevents a match of a wall "
        "with the other side of another wall, such as both walls of a corridor; 0 disables the test, for sensors with "
        "a wide field of view", ge=0
    )  # fmt: skip
    min_score: float = setting(
        0.6, "minimum score of a closure: mean probability of occupied cells at the points, and of free cells in front "
        "of them", gt=0, lt=1
    )  # fmt: skip
    final_score: float = setting(
        0.5, "as min_score, for the search at the end, where the graph gives the search window and rejects outliers at "
        "once", gt=0, lt=1
    )  # fmt: skip
    levels: int = setting(5, "number of halvings of the resolution in the branch-and-bound search", ge=0, le=8)
    sigma: float = setting(
        0.7, "standard deviation of the residual of one point, as the matcher's; also for the comparison with other "
        "poses", gt=0
    )  # fmt: skip
    translation_floor: float = setting(0.02, "minimum standard deviation of a closure, m", gt=0)
    rotation_floor: float = setting(0.006, "minimum standard deviation of a closure, rad", gt=0)
    lag: int = setting(4, "number of nodes after which the result of a background search is used", ge=0)
    support: int = setting(
        3, "minimum number of closures that agree with each other, if they contradict the current estimate", gt=0
    )
    update_every: int = setting(10, "number of nodes between updates of the graph without a new closure", gt=0)
    inlier_probability: float = setting(
        0.99, "a closure is rejected if its error is less likely than one minus this", gt=0, lt=1
    )


class WallsConfig(Frozen):
    """Heading constraints from wall directions (`radarize.slam.walls`)."""

    enabled: bool = setting(False, "use heading constraints from wall directions")
    sigma: float = setting(0.01, "standard deviation of the wall direction of a submap, rad", gt=0)
    contrast: float = setting(
        1.6, "minimum ratio of the concentration of points along the wall direction to that along any other direction",
        gt=1
    )  # fmt: skip


class SlamConfig(Frozen):
    """Parameters of `radarize.slam.backend.Slam`."""

    odometry: OdometryConfig = OdometryConfig()
    node: NodeConfig = NodeConfig()
    grid: GridConfig = GridConfig()
    matcher: MatcherConfig = MatcherConfig()
    loop: LoopConfig = LoopConfig()
    walls: WallsConfig = WallsConfig()

    @classmethod
    def preset(cls, name: str) -> "SlamConfig":
        """Return a named preset.

        ``lidar``: wide, dense and accurate scans. ``radar``: narrow, sparse and noisy scans at 30 Hz with odometry that
        is accurate in translation and less in heading; matches have a small weight, and wall directions constrain the
        heading. ``cartographer``: the settings that the Radarize paper published for Cartographer, and Cartographer's
        defaults otherwise.

        Raises:
            InputError: there is no preset of that name.
        """
        if name not in PRESETS:
            raise InputError(f"preset is {name!r}, expected one of {', '.join(PRESETS)}")
        return PRESETS[name]

    @classmethod
    def load(cls, path: str | Path, preset: str = "lidar") -> "SlamConfig":
        """Return a preset with changes from a YAML file, with sections and fields named as here.

        Raises:
            InputError: no such preset or file, or a field that does not exist or has an invalid value.
        """
        return read_settings(path, cls.preset(preset), "sections with fields, such as grid: {nodes: 10}")


PRESETS: dict[str, SlamConfig] = {
    "lidar": SlamConfig(),
    "radar": SlamConfig(
        odometry=OdometryConfig(
            translation=0.005, rotation=0.005, translation_per_metre=0.03, rotation_per_metre=0.03,
            rotation_per_radian=0.05,
        ),
        node=NodeConfig(distance=0.3, angle=0.2, duration=3.0, scans=10, min_points=25),
        # min_range as published with Radarize. Tuning sets, by name in `radarize.evaluation.benchmark.choices`: cell
        # size, number of correlated matches and scores of closures on CLOSURES; weights of matches and closures on
        # BEARINGS, EVERY and the real walks of CLOSURES; minimum standard deviations of matches on the same; walls on
        # WALLS and the real walks.
        grid=GridConfig(hit=0.65, miss=0.45, min_range=0.3, free_range=0.0, nodes=16),
        matcher=MatcherConfig(
            presearch_distance=0.0, presearch_angle=0.0, sigma=4.0, translation_floor=0.02, rotation_floor=0.01,
            alike=16,
        ),
        loop=LoopConfig(
            radius=8.0, distance=3.0, angle=1.0, candidates=5, every=4, nodes=8, front=0.25, min_score=0.55,
            final_score=0.4, levels=4, sigma=1.5, translation_floor=0.015, rotation_floor=0.009,
        ),
        walls=WallsConfig(enabled=True),
    ),
    # As published with Radarize: 0.08 m cells, 30 scans per submap (Cartographer finishes one after twice as many),
    # ranges of 0.3-4.284 m, no online correlative matcher, 100 iterations, optimisation every 90 nodes, default loop
    # closure (window 7 m and 30 deg, score 0.55, distance 15 m). Its weights of occupied space, translation and
    # rotation (70, 600, 40) model the uncertainty of odometry; here the covariances of odometry replace them.
    "cartographer": SlamConfig(
        node=NodeConfig(distance=0.2, angle=0.0175, duration=5.0, scans=1, min_points=10),
        grid=GridConfig(
            resolution=0.08, hit=0.55, miss=0.49, min_range=0.3, max_range=4.284, free_range=4.284, nodes=60
        ),
        matcher=MatcherConfig(presearch_distance=0.0, presearch_angle=0.0, iterations=100),
        loop=LoopConfig(
            radius=15.0, distance=7.0, angle=0.5236, every=3, min_score=0.55, final_score=0.55, levels=6,
            update_every=90, support=1,
        ),
    ),
}  # fmt: skip
