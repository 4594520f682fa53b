"""Every parameter of the SLAM back end, with its unit, its default, and presets.

Defaults are the preset ``lidar``; values without a source are ours.
"""

from pathlib import Path
from typing import Literal

from pydantic import Field

from radarize.errors import InputError
from radarize.plain import Frozen
from radarize.yamlfile import read_settings


class OdometryConfig(Frozen):
    """Uncertainty of odometry that comes without covariances, as standard deviations of one step."""

    translation: float = Field(0.02, gt=0, description="floor of a step, m")
    rotation: float = Field(0.01, gt=0, description="floor of a step, rad")
    translation_per_metre: float = Field(0.05, ge=0, description="m/m")
    rotation_per_metre: float = Field(0.02, ge=0, description="rad/m")
    rotation_per_radian: float = Field(0.03, ge=0, description="rad/rad")
    scale: float = Field(
        0.01, ge=0, description="error of length that all steps share, m/m; added to covariances that come with the "
        "odometry, which know of each step alone"
    )  # fmt: skip
    missing_translation: float = Field(
        0.3, gt=0, description="of a step without any odometry (constant velocity is assumed), m"
    )
    missing_rotation: float = Field(0.2, gt=0, description="of a step without any odometry, rad")


class NodeConfig(Frozen):
    """How scans are gathered into the nodes of the graph.

    Scans join the open node until the sensor has moved by `distance` or `angle`, or `duration` has passed since its
    first one. This is the motion filter, and what makes enough points of scans that are too sparse alone.
    """

    distance: float = Field(0.2, ge=0, description="a new node starts after so many m")
    angle: float = Field(0.1, ge=0, description="or so many rad")
    duration: float = Field(5.0, ge=0, description="or so many s")
    scans: int = Field(1, gt=0, description="at most so many scans, evenly picked, are used of a node")
    min_points: int = Field(20, gt=0, description="nodes with fewer are neither matched nor searched for loops")


class GridConfig(Frozen):
    """Probability grids of submaps and of the final map."""

    resolution: float = Field(0.05, gt=0, description="cell size of submaps, m")
    map_resolution: float = Field(0.05, gt=0, le=1, description="cell size of the final map, m")
    hit: float = Field(0.7, gt=0.5, lt=1, description="probability that a cell is occupied given one echo from it")
    miss: float = Field(0.45, gt=0, lt=0.5, description="the same given one ray through it")
    lowest: float = Field(0.12, gt=0, lt=0.5, description="least probability, so that a map can change its mind")
    highest: float = Field(0.97, gt=0.5, lt=1, description="largest probability, for the same reason")
    min_range: float = Field(0.1, ge=0, description="nearer returns count as nothing seen, m")
    max_range: float = Field(30.0, gt=0, description="farther ones too, m")
    free_range: float = Field(5.0, ge=0, description="rays that saw nothing clear cells up to here, m; 0: none")
    nodes: int = Field(10, ge=2, description="nodes of a submap; the next one starts when half of them are in")


class MatcherConfig(Frozen):
    """Scan-to-submap matching."""

    enabled: bool = Field(True, description="else nodes follow odometry, and submaps serve the loop search only")
    presearch_distance: float = Field(
        0.3, ge=0, description="half-width of the correlative search before refinement, m; 0 switches it off"
    )
    presearch_angle: float = Field(0.17, ge=0, description="half-width of that search, rad")
    presearch_sigma: float = Field(
        2.0, gt=0, description="as sigma, for the weight of odometry in that search: far from a match the points, most "
        "of them on the same few walls, are wrong together"
    )  # fmt: skip
    sigma: float = Field(
        0.7, gt=0, description="standard deviation of the residual 1 - p of one point, points taken as independent: "
        "sets the weight of a match against odometry, and its covariance in the graph"
    )  # fmt: skip
    translation_floor: float = Field(0.01, gt=0, description="no match is believed better than this, m")
    rotation_floor: float = Field(0.003, gt=0, description="nor than this, rad")
    iterations: int = Field(20, gt=0, description="at most so many Gauss-Newton steps")
    spacing: float = Field(0.05, gt=0, description="points are thinned to one per square of this size, m")


class LoopConfig(Frozen):
    """Loop closure."""

    enabled: bool = Field(True, description="search for loops at all")
    radius: float = Field(10.0, gt=0, description="submaps with their centre this near to a node are searched, m")
    distance: float = Field(3.0, gt=0, description="half-width of the search window, m")
    angle: float = Field(0.5, gt=0, description="half-width of the search window, rad")
    candidates: int = Field(4, gt=0, description="at most so many submaps are searched per node, nearest first")
    every: int = Field(4, gt=0, description="only every so-many-th node is searched for")
    nodes: int = Field(
        1, gt=0, description="points of so many nodes, the latest ones, are searched for together: one view may be too "
        "poor; at the end such windows overlap by half"
    )  # fmt: skip
    front: float = Field(
        0.0, ge=0, description="so far in front of its points, m, a node must find the submap free, else a wall fits "
        "to any other one, a corridor's left to its right; 0: not asked, where every view is rich enough"
    )  # fmt: skip
    min_score: float = Field(
        0.6, gt=0, lt=1, description="mean probability that a closure needs at its points, and of being free in front"
    )
    final_score: float = Field(
        0.5, gt=0, lt=1, description="as min_score, for the search at the end: the graph then says how far to look, "
        "and judges at once"
    )  # fmt: skip
    levels: int = Field(5, ge=0, le=8, description="halvings of the resolution in the branch-and-bound search")
    sigma: float = Field(
        0.7, gt=0, description="as the matcher's, for closures: also how well another pose must fit to be as likely"
    )
    translation_floor: float = Field(0.02, gt=0, description="no closure is believed better than this, m")
    rotation_floor: float = Field(0.006, gt=0, description="nor than this, rad")
    lag: int = Field(4, ge=0, description="what a search in the background finds is taken in so many nodes later")
    support: int = Field(3, gt=0, description="closures that contradict the estimate are believed if so many agree")
    update_every: int = Field(10, gt=0, description="nodes between updates of the graph where no loop has just closed")
    inlier_probability: float = Field(
        0.99, gt=0, lt=1, description="closures whose error is less likely than one minus this are rejected"
    )


class SlamConfig(Frozen):
    """All parameters of `radarize.slam.backend.Slam`."""

    odometry: OdometryConfig = OdometryConfig()
    node: NodeConfig = NodeConfig()
    grid: GridConfig = GridConfig()
    matcher: MatcherConfig = MatcherConfig()
    loop: LoopConfig = LoopConfig()

    @classmethod
    def preset(cls, name: Literal["radar", "lidar", "cartographer"]) -> "SlamConfig":
        """A named set of parameters.

        ``lidar``: wide, dense and exact scans. ``radar``: 88 deg and 4.28 m of noisy scans at 30 Hz with odometry that
        is good in translation and weak in heading; matches weigh little, so that they do no harm. ``cartographer``:
        what the paper published of its settings, and Cartographer's own defaults beside them, where they apply.

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
        # Cartographer's settings published with Radarize: 0.08 m cells, ranges of 0.3-4.284 m.
        grid=GridConfig(resolution=0.08, hit=0.65, miss=0.45, min_range=0.3, max_range=4.284, free_range=0.0, nodes=16),
        matcher=MatcherConfig(
            presearch_distance=0.0, presearch_angle=0.0, sigma=2.0, translation_floor=0.03, rotation_floor=0.015
        ),
        loop=LoopConfig(
            radius=8.0, distance=3.0, angle=0.5, candidates=5, every=4, nodes=8, front=0.25, min_score=0.4,
            final_score=0.4, levels=4, sigma=2.0, translation_floor=0.05, rotation_floor=0.02,
        ),
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
