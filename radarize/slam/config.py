"""Parameters of the SLAM back end with their units, defaults and presets.

Defaults are the preset ``lidar``, tuned on the public lidar logs intel, csail and orebro.
"""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.yamlfile import read_settings


class OdometryConfig(Frozen):
    """Uncertainty of odometry that comes without covariances, as standard deviations per step."""

    translation: float = setting(0.02, "minimum standard deviation of a step's translation", "m", gt=0)
    rotation: float = setting(0.01, "minimum standard deviation of a step's rotation", "rad", gt=0)
    translation_per_metre: float = setting(0.05, "standard deviation of translation per metre travelled", "m/m", ge=0)
    rotation_per_metre: float = setting(0.02, "standard deviation of rotation per metre travelled", "rad/m", ge=0)
    rotation_per_radian: float = setting(0.03, "standard deviation of rotation per radian turned", "rad/rad", ge=0)
    scale: float = setting(
        0.01, "standard deviation of the scale error that all steps share; added to covariances that come with the "
        "odometry, which cover each step alone", "m/m", ge=0
    )  # fmt: skip
    missing_translation: float = setting(
        0.3, "standard deviation of the translation of a step without odometry, for which constant velocity is "
        "assumed", "m", gt=0
    )  # fmt: skip
    missing_rotation: float = setting(0.2, "standard deviation of the rotation of a step without odometry", "rad", gt=0)


class NodeConfig(Frozen):
    """Nodes of the pose graph, each made of one or several consecutive scans.

    Scans join the open node until the sensor has moved by `distance` or `angle`, or `duration` has passed since its
    first scan. Sparse scans thus add up to enough points for a match.
    """

    distance: float = setting(0.2, "distance after which a new node starts", "m", ge=0)
    angle: float = setting(0.1, "rotation after which a new node starts", "rad", ge=0)
    duration: float = setting(5.0, "time after which a new node starts", "s", ge=0)
    scans: int = setting(1, "maximum number of scans used of a node, evenly spaced", "scans", gt=0)
    min_points: int = setting(
        20, "minimum number of points of a node that is matched and searched for loops", "points", gt=0
    )


class GridConfig(Frozen):
    """Occupancy grids of submaps and of the final map."""

    resolution: float = setting(0.05, "cell size of submaps", "m", tuned="CLOSURES, preset radar", ge=0.005)
    map_resolution: float = setting(0.05, "cell size of the final map", "m", ge=0.005, le=1)
    hit: float = setting(0.7, "probability that a cell is occupied, given one echo in it", "1", gt=0.5, lt=1)
    miss: float = setting(0.45, "probability that a cell is occupied, given one ray through it", "1", gt=0, lt=0.5)
    lowest: float = setting(0.12, "minimum probability of a cell, so that a map can change", "1", gt=0, lt=0.5)
    highest: float = setting(0.97, "maximum probability of a cell, for the same reason", "1", gt=0.5, lt=1)
    min_range: float = setting(0.1, "minimum range; nearer returns are dropped", "m", ge=0)
    max_range: float = setting(30.0, "maximum range; farther returns count as free space only", "m", gt=0)
    free_range: float = setting(
        5.0, "range up to which rays without a return clear cells; 0: they clear none", "m", ge=0
    )
    nodes: int = setting(
        10, "nodes of a submap; the next submap starts when it is half full", "nodes", tuned="FURNISHED, preset radar",
        ge=2
    )  # fmt: skip


class MatcherConfig(Frozen):
    """Scan-to-submap matching."""

    enabled: bool = setting(
        True, "match nodes with the current submaps; false: nodes follow odometry, and submaps serve loop closure only"
    )
    presearch_distance: float = setting(
        0.3, "half-width of the correlative search before refinement; 0: none", "m", ge=0, le=100
    )
    presearch_angle: float = setting(0.17, "half-width of that search in angle", "rad", ge=0, le=4)
    presearch_sigma: float = setting(
        2.0, "as sigma, for the weight of odometry in that search; larger, because points on the same few walls "
        "have correlated errors far from a match", "1", gt=0
    )  # fmt: skip
    sigma: float = setting(
        0.7, "standard deviation of the residual 1 - p of one point, points taken as independent; it sets the "
        "weight of a match against odometry and its covariance in the graph", "1", tuned="BEARINGS and REAL, preset "
        "radar", gt=0
    )  # fmt: skip
    translation_floor: float = setting(
        0.01, "minimum standard deviation of a match in translation", "m", tuned="EVERY and REAL, preset radar", gt=0
    )
    rotation_floor: float = setting(
        0.003, "minimum standard deviation of a match in rotation", "rad", tuned="EVERY and REAL, preset radar", gt=0
    )
    correlated: int = setting(
        1, "matches (and closures) whose errors are correlated, because they share a submap; in covariances of "
        "poses they count as one", "matches", tuned="CLOSURES, preset radar", ge=1
    )  # fmt: skip
    iterations: int = setting(20, "maximum number of Gauss-Newton steps", "steps", gt=0, le=1000)
    spacing: float = setting(0.05, "points are thinned to one per square of this size", "m", ge=0.005)


class LoopConfig(Frozen):
    """Loop closure."""

    enabled: bool = setting(True, "search for loop closures")
    radius: float = setting(
        10.0, "maximum distance of a submap's centre from the node for it to be searched", "m", gt=0
    )
    distance: float = setting(3.0, "half-width of the search window", "m", gt=0, le=100)
    angle: float = setting(0.5, "half-width of the search window in angle", "rad", gt=0, le=4)
    candidates: int = setting(4, "maximum number of submaps searched per node, nearest first", "submaps", gt=0)
    every: int = setting(4, "search every N-th node only", "nodes", gt=0)
    nodes: int = setting(
        1, "latest nodes whose points are searched together, where one view is too sparse; in the final search such "
        "windows overlap by half", "nodes", tuned="CLOSURES, preset radar", gt=0
    )  # fmt: skip
    front: float = setting(
        0.0, "distance in front of its points at which a node must find the submap free, so that the left wall of a "
        "corridor is not matched with the right one; 0: no such test", "m", tuned="CLOSURES, preset radar", ge=0
    )  # fmt: skip
    min_score: float = setting(
        0.6, "minimum mean probability at the points of a closure, and of being free in front of them", "1",
        tuned="CLOSURES, preset radar", gt=0, lt=1
    )  # fmt: skip
    final_score: float = setting(
        0.5, "as min_score, for the final search, whose window is set by the covariance of the graph", "1",
        tuned="CLOSURES, preset radar", gt=0, lt=1
    )  # fmt: skip
    levels: int = setting(5, "halvings of the resolution in the branch-and-bound search", "levels", ge=0, le=8)
    sigma: float = setting(
        0.7, "as the matcher's sigma, for closures; also the weight of alternative poses in a closure's covariance",
        "1", tuned="EVERY and REAL, preset radar", gt=0
    )  # fmt: skip
    translation_floor: float = setting(
        0.02, "minimum standard deviation of a closure in translation", "m", tuned="EVERY and REAL, preset radar", gt=0
    )
    rotation_floor: float = setting(
        0.006, "minimum standard deviation of a closure in rotation", "rad", tuned="EVERY and REAL, preset radar", gt=0
    )
    lag: int = setting(4, "delay after which the result of a background search enters the graph", "nodes", ge=0)
    support: int = setting(
        3, "closures that must agree before they are accepted against the current estimate", "closures", gt=0
    )
    update_every: int = setting(10, "interval of graph updates where no loop has just been closed", "nodes", gt=0)
    inlier_probability: float = setting(
        0.99, "closures whose error has a probability below one minus this are rejected", "1", gt=0, lt=1
    )


class WallsConfig(Frozen):
    """Heading constraints from the wall directions of submaps (`radarize.slam.walls`)."""

    enabled: bool = setting(False, "use wall directions", tuned="WALLS and REAL, preset radar")
    sigma: float = setting(
        0.01, "standard deviation of the wall direction of a submap", "rad", tuned="WALLS and REAL, preset radar", gt=0
    )
    contrast: float = setting(
        1.6,
        "minimum ratio of the points' concentration along the wall direction to that along any other",
        "1",
        tuned="FURNISHED, preset radar",
        gt=1,
    )


class SlamConfig(Frozen):
    """SLAM back end (`radarize.slam.backend.Slam`)."""

    odometry: OdometryConfig = OdometryConfig()
    node: NodeConfig = NodeConfig()
    grid: GridConfig = GridConfig()
    matcher: MatcherConfig = MatcherConfig()
    loop: LoopConfig = LoopConfig()
    walls: WallsConfig = WallsConfig()

    @classmethod
    def preset(cls, name: str) -> "SlamConfig":
        """Return a named set of parameters.

        ``lidar``: wide, dense and accurate scans. ``radar``: narrow, short and noisy scans at 30 Hz with odometry that
        is accurate in translation and drifts in heading; matches have a low weight, wall directions constrain the
        heading. ``cartographer``: the settings published with the paper, and Cartographer's defaults for the others.

        Raises:
            InputError: there is no preset of that name.
        """
        if name not in PRESETS:
            raise InputError(f"preset is {name!r}, expected one of {', '.join(PRESETS)}")
        return PRESETS[name]

    @classmethod
    def load(cls, path: str | Path, preset: str = "lidar") -> "SlamConfig":
        """Return a preset with the values of a YAML file in their place; sections and fields as here.

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
        # Ranges from 0.3 m as in Cartographer's settings published with Radarize; the fields have what the rest was
        # tuned on.
        grid=GridConfig(hit=0.65, miss=0.45, min_range=0.3, free_range=0.0, nodes=10),
        matcher=MatcherConfig(
            presearch_distance=0.0, presearch_angle=0.0, sigma=4.0, translation_floor=0.02, rotation_floor=0.01,
            correlated=16,
        ),
        loop=LoopConfig(
            radius=8.0, distance=3.0, angle=1.0, candidates=5, every=4, nodes=8, front=0.25, min_score=0.55,
            final_score=0.4, levels=4, sigma=1.5, translation_floor=0.015, rotation_floor=0.009,
        ),
        walls=WallsConfig(enabled=True, contrast=1.4),
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
