"""Every parameter of the SLAM back end, with its unit, its default, and presets.

Defaults are the preset ``lidar``; values without a source are ours.
"""

from pathlib import Path

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.yamlfile import read_settings


class OdometryConfig(Frozen):
    """Uncertainty of odometry that comes without covariances, as standard deviations of one step."""

    translation: float = setting(0.02, "floor of a step, m", gt=0)
    rotation: float = setting(0.01, "floor of a step, rad", gt=0)
    translation_per_metre: float = setting(0.05, "m/m", ge=0)
    rotation_per_metre: float = setting(0.02, "rad/m", ge=0)
    rotation_per_radian: float = setting(0.03, "rad/rad", ge=0)
    scale: float = setting(
        0.01, "error of length that all steps share, m/m; added to covariances that come with the odometry, which know "
        "of each step alone", ge=0
    )  # fmt: skip
    missing_translation: float = setting(0.3, "of a step without any odometry (constant velocity is assumed), m", gt=0)
    missing_rotation: float = setting(0.2, "of a step without any odometry, rad", gt=0)


class NodeConfig(Frozen):
    """How scans are gathered into the nodes of the graph.

    Scans join the open node until the sensor has moved by `distance` or `angle`, or `duration` has passed since its
    first one. This is the motion filter, and what makes enough points of scans that are too sparse alone.
    """

    distance: float = setting(0.2, "a new node starts after so many m", ge=0)
    angle: float = setting(0.1, "or so many rad", ge=0)
    duration: float = setting(5.0, "or so many s", ge=0)
    scans: int = setting(1, "at most so many scans, evenly picked, are used of a node", gt=0)
    min_points: int = setting(20, "nodes with fewer are neither matched nor searched for loops", gt=0)


class GridConfig(Frozen):
    """Probability grids of submaps and of the final map."""

    resolution: float = setting(0.05, "cell size of submaps, m", ge=0.005)
    map_resolution: float = setting(0.05, "cell size of the final map, m", ge=0.005, le=1)
    hit: float = setting(0.7, "probability that a cell is occupied given one echo from it", gt=0.5, lt=1)
    miss: float = setting(0.45, "the same given one ray through it", gt=0, lt=0.5)
    lowest: float = setting(0.12, "least probability, so that a map can change its mind", gt=0, lt=0.5)
    highest: float = setting(0.97, "largest probability, for the same reason", gt=0.5, lt=1)
    min_range: float = setting(0.1, "nearer returns count as nothing seen, m", ge=0)
    max_range: float = setting(30.0, "farther ones too, m", gt=0)
    free_range: float = setting(5.0, "rays that saw nothing clear cells up to here, m; 0: none", ge=0)
    nodes: int = setting(10, "nodes of a submap; the next one starts when half of them are in", ge=2)


class MatcherConfig(Frozen):
    """Scan-to-submap matching."""

    enabled: bool = setting(True, "else nodes follow odometry, and submaps serve the loop search only")
    presearch_distance: float = setting(
        0.3, "half-width of the correlative search before refinement, m; 0 switches it off", ge=0, le=100
    )
    presearch_angle: float = setting(0.17, "half-width of that search, rad", ge=0, le=4)
    presearch_sigma: float = setting(
        2.0, "as sigma, for the weight of odometry in that search: far from a match the points, most of them on the "
        "same few walls, are wrong together", gt=0
    )  # fmt: skip
    sigma: float = setting(
        0.7, "standard deviation of the residual 1 - p of one point, points taken as independent: sets the weight of a "
        "match against odometry, and its covariance in the graph", gt=0
    )  # fmt: skip
    translation_floor: float = setting(0.01, "no match is believed better than this, m", gt=0)
    rotation_floor: float = setting(0.003, "nor than this, rad", gt=0)
    alike: int = setting(
        1, "so many matches, and so many closures, err alike, for one submap misleads all that are matched with it: in "
        "what is claimed of poses they count as one", ge=1
    )  # fmt: skip
    iterations: int = setting(20, "at most so many Gauss-Newton steps", gt=0, le=1000)
    spacing: float = setting(0.05, "points are thinned to one per square of this size, m", ge=0.005)


class LoopConfig(Frozen):
    """Loop closure."""

    enabled: bool = setting(True, "search for loops at all")
    radius: float = setting(10.0, "submaps with their centre this near to a node are searched, m", gt=0)
    distance: float = setting(3.0, "half-width of the search window, m", gt=0, le=100)
    angle: float = setting(0.5, "half-width of the search window, rad", gt=0, le=4)
    candidates: int = setting(4, "at most so many submaps are searched per node, nearest first", gt=0)
    every: int = setting(4, "only every so-many-th node is searched for", gt=0)
    nodes: int = setting(
        1, "points of so many nodes, the latest ones, are searched for together: one view may be too poor; at the end "
        "such windows overlap by half", gt=0
    )  # fmt: skip
    front: float = setting(
        0.0, "so far in front of its points, m, a node must find the submap free, else a wall fits to any other one, a "
        "corridor's left to its right; 0: not asked, where every view is rich enough", ge=0
    )  # fmt: skip
    min_score: float = setting(
        0.6, "mean probability that a closure needs at its points, and of being free in front", gt=0, lt=1
    )
    final_score: float = setting(
        0.5, "as min_score, for the search at the end: the graph then says how far to look, and judges at once",
        gt=0, lt=1
    )  # fmt: skip
    levels: int = setting(5, "halvings of the resolution in the branch-and-bound search", ge=0, le=8)
    sigma: float = setting(
        0.7, "as the matcher's, for closures: also how well another pose must fit to be as likely", gt=0
    )
    translation_floor: float = setting(0.02, "no closure is believed better than this, m", gt=0)
    rotation_floor: float = setting(0.006, "nor than this, rad", gt=0)
    lag: int = setting(4, "what a search in the background finds is taken in so many nodes later", ge=0)
    support: int = setting(3, "closures that contradict the estimate are believed if so many agree", gt=0)
    update_every: int = setting(10, "nodes between updates of the graph where no loop has just closed", gt=0)
    inlier_probability: float = setting(
        0.99, "closures whose error is less likely than one minus this are rejected", gt=0, lt=1
    )


class WallsConfig(Frozen):
    """Headings from the walls of submaps, see `radarize.slam.walls`."""

    enabled: bool = setting(False, "walls tell headings at all")
    sigma: float = setting(0.01, "standard deviation of the direction of a submap's walls, rad", gt=0)
    contrast: float = setting(1.6, "so much better than along any other direction points must pile up along it", gt=1)


class SlamConfig(Frozen):
    """All parameters of `radarize.slam.backend.Slam`."""

    odometry: OdometryConfig = OdometryConfig()
    node: NodeConfig = NodeConfig()
    grid: GridConfig = GridConfig()
    matcher: MatcherConfig = MatcherConfig()
    loop: LoopConfig = LoopConfig()
    walls: WallsConfig = WallsConfig()

    @classmethod
    def preset(cls, name: str) -> "SlamConfig":
        """A named set of parameters.

        ``lidar``: wide, dense and exact scans. ``radar``: narrow, short and noisy scans at 30 Hz with odometry that is
        good in translation and weak in heading; matches weigh little, so that they do no harm, closures as much as they
        are worth, and walls tell headings. ``cartographer``: what the paper published of its settings, and
        Cartographer's own defaults beside them, where they apply.

        Raises:
            InputError: there is no preset of that name.
        """
        if name not in PRESETS:
            raise InputError(f"preset is {name!r}, expected one of {', '.join(PRESETS)}")
        return PRESETS[name]

    @classmethod
    def load(cls, path: str | Path, preset: str = "lidar") -> "SlamConfig":
        """A preset with what a YAML file says otherwise: sections and fields named as here.

        Raises:
            InputError: no such preset or file, or a field that does not exist or has an impossible value.
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
        # Cartographer's settings published with Radarize: ranges from 0.3 m. Cells, how many err alike, and what
        # closures need were chosen on `benchmark.choices.CLOSURES`, what matches and closures count for, since
        # odometry's headings are better than theirs, on `BEARINGS` and the real walks of `CLOSURES`; how right matches
        # are at best, and what closures count for, since ranges are better, on `EVERY` and the same real walks; walls,
        # since then, on `WALLS` and those.
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
    # Published with Radarize: 0.08 m cells, 30 scans per submap (Cartographer finishes one after twice as many), ranges
    # of 0.3-4.284 m, no online correlative matcher, 100 iterations, optimisation every 90 nodes, stock loop closure
    # (window 7 m and 30 deg, score 0.55, distance 15 m). Its weights of occupied space, translation and rotation (70,
    # 600, 40) stand for what is known of the odometry, which here comes with a covariance.
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
