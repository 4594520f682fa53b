"""The SLAM back end: gather scans, match, build submaps, align their walls, close loops, optimise.

After Google's Cartographer (Hess et al., Real-Time Loop Closure in 2D LIDAR SLAM, ICRA 2016), on gtsam: matching runs
in a local frame that is smooth and drifts, the graph's poses are global and jump when loops close.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.pose import Pose, between, carried, compose, interpolate, transform
from radarize.odometry.uncertainty import ErrorModel
from radarize.slam.config import SlamConfig
from radarize.slam.correlation import Pyramid, search
from radarize.slam.grid import OccupancyGrid
from radarize.slam.loops import LoopCandidate, LoopSearch, LoopVerifier, match_covariance
from radarize.slam.matcher import match, thin
from radarize.slam.node import Node, Scan
from radarize.slam.odometry import FARTHEST, ConstantMotion, Drift, Odometry
from radarize.slam.posegraph import PoseGraph
from radarize.slam.rendering import MapRenderer
from radarize.slam.rows import Rows
from radarize.slam.submap import Submap
from radarize.slam.trimming import redundant_submaps
from radarize.slam.walls import Walls

#: Nodes whose last loop searches may wait at a time.
_AHEAD = 16
#: Who has moved by less than this share of what makes a node stands.
_STILL = 1 / 3
#: Scans that `Slam.trajectory` takes at a time.
_BLOCK = 4096
#: m: standard deviation of places of which walls tell nothing.
_ANYWHERE = 100.0
#: Submaps that an endless session forgets at a time: the graph is then solved anew.
_TRIM = 8


class Slam:
    """Simultaneous localisation and mapping from scans and odometry.

        slam = Slam(SlamConfig.preset("radar"))
        slam.add_odometry(time, pose); slam.add_scan(time, azimuths, ranges); ...
        slam.finish()
        times, poses = slam.trajectory()
        grid = slam.map()

    The same input gives the same bytes: searches for loops run in threads, but what they find is taken in a fixed
    number of nodes later (`radarize.slam.loops`).

    Odometry and scans come in any interleaving: a scan waits until odometry has reached its time. Entries that are not
    later than the one before them are left out and counted in `skipped`; scans before the first odometry entry take
    its pose, scans after the last one the last; a jump in time is a step like any other. Empty scans and
    such of nan alone follow odometry; no scans at all give an empty trajectory and map. Without any odometry motion is
    taken to go on as matched before. While the sensor stands no nodes are made, and a frame takes 40 bytes.

    Args:
        config: all parameters; the default is the preset ``lidar``.
        endless: keep no trajectory, and forget what was seen of a place longest ago: memory and time then grow with the
            ground that is covered, however often.
    """

    def __init__(self, config: SlamConfig | None = None, endless: bool = False):
        self.config, self.endless = config or SlamConfig(), endless
        self.odometry = Odometry(self.config.odometry, endless)
        self.graph = PoseGraph(self.config.loop.inlier_probability, self.config.matcher.alike)
        self.nodes: list[Node] = []
        self.submaps: list[Submap] = []
        self.skipped = {"odometry": 0, "scans": 0}
        self._waiting: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._scan_times = Rows()
        self._newest = -np.inf  # of the times of scans
        self._azimuths = np.zeros(0)  # of the last scan
        self._open: list[Scan] = []
        self._local: list[np.ndarray] = []  # of every node in the local frame
        self._drift = Drift(self.config.odometry.scale)
        self._search = LoopSearch(self.config.loop)
        self._verifier = LoopVerifier(self.graph, self._drift, self.config.loop)
        self._walls = Walls(self.config.walls)
        self._building: list[Submap] = []
        self._centers: list[np.ndarray] = []  # of finished submaps, as seen from their anchors

    def add_odometry(
        self,
        time: float,
        pose: Float[np.ndarray, "3"],
        errors: ErrorModel | Float[np.ndarray, "3 3"] | None = None,
    ) -> None:
        """Say where odometry puts the sensor.

        Args:
            time: s.
            pose: x, y (m), yaw (rad) in any fixed frame.
            errors: of the step since the entry before, or its covariance alone if steps are independent, for (x, y,
                yaw) in this pose's frame (m^2, m rad, rad^2); None: as configured in `SlamConfig.odometry`.

        Raises:
            InputError: a value is not finite, or not within `FARTHEST`, or the covariance is none.
        """
        if self.odometry.add(time, pose, errors):
            self._drain()
        else:
            self.skipped["odometry"] += 1

    def add_scan(self, time: float, azimuths: Float[np.ndarray, "beam"], ranges: Float[np.ndarray, "_"]) -> None:
        """Say what the sensor saw.

        Args:
            time: s.
            azimuths: of the beams, rad, positive to the left.
            ranges: one for each, m; inf: nothing seen on this beam; nan: not known.

        Raises:
            InputError: the time is not finite, an azimuth not within `FARTHEST`, or the lengths differ.
        """
        azimuths, ranges = np.asarray(azimuths, float), np.asarray(ranges, float)
        if not np.isfinite(time):
            raise InputError(f"scan: time is {time}, expected a finite number of seconds")
        if azimuths.ndim != 1 or azimuths.shape != ranges.shape:
            raise InputError(f"scan at {time}: {ranges.shape} ranges on {azimuths.shape} azimuths, expected one each")
        if not (np.abs(azimuths) <= FARTHEST).all():
            worst = azimuths[~(np.abs(azimuths) <= FARTHEST)][0]
            raise InputError(f"scan at {time}: has azimuth {worst:g} rad, expected within {FARTHEST:g} rad of ahead")
        if time <= self._newest:
            self.skipped["scans"] += 1
            return
        if np.array_equal(azimuths, self._azimuths):
            azimuths = self._azimuths  # kept once for all nodes
        self._azimuths = azimuths
        self._newest = float(time)
        if not self.endless:
            self._scan_times.append(self._newest)
        self._waiting.append((float(time), azimuths, ranges))
        self._drain()

    def finish(self) -> None:
        """Process what still waits, search all loops once more from the optimised poses, and optimise."""
        if not len(self.odometry):
            self.odometry = ConstantMotion(self.config.odometry)
        self._drain(final=True)
        if self._open:
            self._add_node()
        for submap in self._building:
            if 2 * len(submap.nodes) >= self.config.grid.nodes:
                self._align(submap)
        if self.config.loop.enabled:
            self._collect_closures()
            self.graph.optimise()
            self._close_again()
        self.graph.optimise()

    def trajectory(self) -> tuple[Float[np.ndarray, "scan"], Float[np.ndarray, "scan 3"]]:
        """Times (s) and poses (x, y, yaw) of every scan up to the last node's, in the frame in which odometry began;
        of an endless session none.

        Between two nodes odometry gives the shape, and the nodes its ends.
        """
        if not self.nodes or self.endless:
            return np.zeros(0), np.zeros((0, 3))
        knots, poses = np.array([node.time for node in self.nodes]), self.graph.poses
        times = self._scan_times.values[: len(self._scan_times) - len(self._waiting) - len(self._open)].copy()
        anchors, found = self.odometry.pose(knots), np.empty((len(times), 3))
        for start in range(0, len(times), _BLOCK):
            block = slice(start, start + _BLOCK)
            odometry, instants = self.odometry.pose(times[block]), times[block]
            after = np.clip(np.searchsorted(knots, instants), 1, max(len(knots) - 1, 1))
            before, after = after - 1, np.minimum(after, len(knots) - 1)
            forward = compose(poses[before], between(anchors[before], odometry))
            backward = compose(poses[after], between(anchors[after], odometry))
            share = (instants - knots[before]) / np.maximum(knots[after] - knots[before], 1e-9)
            found[block] = interpolate(forward, backward, np.clip(share, 0, 1))
        return times, found

    def covariances(self) -> Float[np.ndarray, "scan 3 3"]:
        """Covariance of every pose of `trajectory` for (x, y, yaw) in its own frame, given the first node: that of the
        node next to it in time."""
        times, _ = self.trajectory()
        if not len(times):
            return np.zeros((0, 3, 3))
        knots = np.array([node.time for node in self.nodes])
        after = np.clip(np.searchsorted(knots, times), min(1, len(knots) - 1), len(knots) - 1)
        before = np.maximum(after - 1, 0)
        return self.graph.covariances()[np.where(times - knots[before] <= knots[after] - times, before, after)]

    def warnings(self) -> list[str]:
        """One sentence where covariances could not be solved for, or none."""
        if self.graph.solved:
            return []
        return [
            "the pose graph could not be solved for covariances: those of odometry alone stand in, and loops were "
            "searched as widely as these say"
        ]

    def map(self) -> OccupancyGrid:
        """Occupancy grid of all nodes, drawn anew at their optimised poses."""
        return MapRenderer(self.config.grid).render(self.nodes, self.graph.poses)

    # --- the algorithm, step by step ---------------------------------------------------------------------------------
    def _drain(self, final: bool = False) -> None:
        while self._waiting and (final or self.odometry.covers(self._waiting[0][0])):
            time, azimuths, ranges = self._waiting.popleft()
            scan = Scan(time, self.odometry.pose(time), azimuths, ranges)
            if self._open and self._stands(scan):
                self.odometry.release(self.nodes[-1].time, self._open[-1].time)
                self._open = []  # the last node has seen it all
            elif self._open and self._moved(self._open[0], scan):
                self._add_node()
            self._open.append(scan)

    def _moved(self, first: Scan, scan: Scan) -> bool:
        return self._far(first.odometry, scan, 1.0) or scan.time - first.time >= self.config.node.duration

    def _stands(self, scan: Scan) -> bool:
        """Whether nothing has moved since the last node, which lies back by more than a node's time."""
        if not self.nodes or scan.time - self._open[0].time < self.config.node.duration:
            return False
        place = self.odometry.pose(self.nodes[-1].time)
        return not any(self._far(place, each, _STILL) for each in (*self._open, scan))

    def _far(self, place: np.ndarray, scan: Scan, share: float) -> bool:
        """Whether a scan is from elsewhere, by a share of what makes a node; without odometry nobody knows."""
        x, y, yaw = between(place, scan.odometry)
        c = self.config.node
        unknown = isinstance(self.odometry, ConstantMotion)
        return unknown or np.hypot(x, y) >= share * c.distance or abs(yaw) >= share * c.angle

    def _add_node(self) -> None:
        node = Node.gather(self._open, self.config)
        self._open = []
        if not self.nodes:
            start = self.odometry.pose(node.time)
            self._local.append(start)
            self._drift.add(start, np.zeros((3, 3)), 0.0)
            self.graph.add_node(start)
        else:
            motion, covariance = self.odometry.motion(self.nodes[-1].time, node.time)
            local = self._match(node, compose(self._local[-1], motion), covariance)
            moved = between(self._local[-1], local)
            self.graph.add_node(compose(self.graph.poses[-1], moved))
            self.graph.add_motion(len(self.nodes) - 1, len(self.nodes), motion, covariance)
            self._local.append(local)
            self._drift.add(local, covariance, float(np.hypot(motion[0], motion[1])))
            if isinstance(self.odometry, ConstantMotion):
                self.odometry.last = moved
        self.nodes.append(node)
        self.odometry.release(node.time, node.time)
        self._insert(len(self.nodes) - 1, node)
        if self.config.loop.enabled:
            self._close(len(self.nodes) - 1)

    def _match(self, node: Node, predicted: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Local pose of a new node: the prediction, moved to fit the older of the submaps being built."""
        c, points = self.config.matcher, node.points
        if not c.enabled or len(points) < self.config.node.min_points:
            return predicted
        submap = self._building[0]
        prior = between(self._local[submap.anchor], predicted)
        guess = prior
        if c.presearch_distance > 0:
            weight = np.linalg.inv(covariance) * c.presearch_sigma**2 / len(points)
            found = search(
                Pyramid.of(submap.grid, 3, c.presearch_distance),
                points,
                prior,
                distance=c.presearch_distance,
                angle=c.presearch_angle,
                min_score=0.1,
                penalty=(min(weight[0, 0], weight[1, 1]), weight[2, 2]),
            )
            guess = prior if found is None else found[0]
        result = match(
            submap.grid, points, guess, sigma=c.sigma, prior=prior, covariance=covariance, iterations=c.iterations
        )
        noise = match_covariance(result, c.translation_floor, c.rotation_floor)
        self.graph.add_match(submap.anchor, len(self.nodes), result.pose, noise)
        return compose(self._local[submap.anchor], result.pose)

    def _insert(self, number: int, node: Node) -> None:
        """Add a node to the two submaps being built; a new one starts when the older is half full."""
        if len(self._building) < 2 and (
            not self._building or len(self._building[0].nodes) >= self.config.grid.nodes // 2
        ):
            self.submaps.append(Submap(self.config, number))
            self._building.append(self.submaps[-1])
        for submap in self._building:
            submap.insert(number, node, between(self._local[submap.anchor], self._local[number]))
        if self._building[0].finished:
            done = self._building.pop(0)
            self._centers.append(done.center)
            self._align(done)
            if self.endless:
                self._trim()

    def _align(self, submap: Submap) -> None:
        """Let the walls of a submap tell the heading of the node in its middle."""
        if not self.config.walls.enabled:
            return
        middle, poses = submap.nodes[len(submap.nodes) // 2], self.graph.poses
        points = _seen(middle, self._local, {k: self.nodes[k].points for k in submap.nodes})
        if len(points) < self.config.node.min_points:
            return
        told = self._walls.associate(middle, points, poses[:, 2], lambda *nodes: self._drift.between(*nodes)[2, 2])
        if told is not None:
            other, turn = told
            x, y, _ = between(poses[other], poses[middle])
            spread = np.diag([_ANYWHERE, _ANYWHERE, np.sqrt(2) * self.config.walls.sigma]) ** 2
            self.graph.add_match(other, middle, np.array([x, y, turn]), spread)
            self.graph.update()

    def _trim(self) -> None:
        """Forget submaps of places that were shown often enough since, and the nodes that are in no other one."""
        gone = redundant_submaps(self.submaps, self.graph.poses)
        if len(gone) < _TRIM:
            return
        self._collect_closures()
        stay = [k for k, submap in enumerate(self.submaps) if submap not in gone]
        self._centers = [self._centers[k] for k in stay if k < len(self._centers)]
        self.submaps = [self.submaps[k] for k in stay]
        kept = sorted({number for submap in self.submaps for number in submap.nodes})
        self.graph.keep(kept, self._drift.between)
        self._drift.keep(kept)
        self._verifier.forget()
        self.nodes, self._local = [self.nodes[k] for k in kept], [self._local[k] for k in kept]
        place = {number: k for k, number in enumerate(kept)}
        self._walls.keep(place)
        for submap in self.submaps:
            submap.anchor, submap.nodes = place[submap.anchor], [place[number] for number in submap.nodes]

    def _close(self, number: int) -> None:
        """Begin to search a node in the submaps near it, and take in what was found for earlier ones."""
        c = self.config.loop
        if number % c.every == 0:
            self._search.submit(self._loop_candidates(number, c.candidates, c.min_score, self._drift.between))
        if self._collect_closures(number - c.lag) or number % c.update_every == 0:
            self.graph.update()

    def _close_again(self) -> None:
        """With loops closed, nodes and submaps lie where they overlap: match what was not matched.

        How far to look is what the graph does not know of a node, given the first one: closely where loops are closed,
        and as widely as ever where one was missed.
        """
        c, done = self.config.loop, set(self.graph.closures)
        near = np.diag([8 * self.config.grid.resolution / 3] * 2 + [0.03]) ** 2
        unknown = self.graph.covariances()

        def spread(anchor: int, number: int) -> np.ndarray:
            motion = between(self.graph.poses[anchor], self.graph.poses[number])
            return near + unknown[number] + carried(unknown[anchor], motion)

        numbers = range(len(self.nodes))
        for number in sorted({*numbers[:: max(c.nodes // 2, 1)], *numbers[-1:]}):  # a walk may close with its last node
            candidates = self._loop_candidates(number, 2 * c.candidates, c.final_score, spread)
            self._search.submit([q for q in candidates if (q.submap.anchor, number) not in done])
            self._collect_closures(number - _AHEAD)  # what waits takes memory
        self._collect_closures()

    def _collect_closures(self, before: int | None = None) -> bool:
        """Take in what was found for nodes up to `before`, or for all; True if poses should move for it now."""
        return any([self._verifier.check(closure) for closure in self._search.results(before)])

    def _loop_candidates(
        self, number: int, count: int, min_score: float, spread: Callable[[int, int], np.ndarray]
    ) -> list[LoopCandidate]:
        """Searches of a node and those before it in the finished submaps near it, nearest first."""
        spacing = self.config.matcher.spacing
        first = max(number - self.config.loop.nodes + 1, 0)
        poses, ready = self.graph.poses, len(self._centers)
        if len(self.nodes[number].points) < self.config.node.min_points or not ready:
            return []
        last = np.array([submap.nodes[-1] for submap in self.submaps[:ready]])
        anchors = np.array([submap.anchor for submap in self.submaps[:ready]])
        members = range(first, number + 1)
        points, fronts = (
            thin(_seen(number, poses, part), spacing)
            for part in ({k: self.nodes[k].points for k in members}, {k: self.nodes[k].fronts for k in members})
        )
        centers = compose(poses[anchors], np.pad(np.array(self._centers), ((0, 0), (0, 1))))[:, :2]
        away = np.hypot(*(centers - transform(poses[number], points.mean(axis=0))).T)
        near = np.flatnonzero((away <= self.config.loop.radius) & ((last < first) | (anchors > number)))
        return [
            LoopCandidate(
                self.submaps[k],
                number,
                points,
                fronts,
                between(poses[anchors[k]], poses[number]),
                spread(anchors[k], number),
                min_score,
            )
            for k in near[np.argsort(away[near], kind="stable")][:count]
        ]


def _seen(
    number: int, poses: Sequence[Pose] | Float[np.ndarray, "node 3"], points: Mapping[int, Float[np.ndarray, "_ 2"]]
) -> Float[np.ndarray, "point 2"]:
    """Points of several nodes as one node sees them."""
    return np.concatenate([transform(between(poses[number], poses[k]), each) for k, each in points.items()])
