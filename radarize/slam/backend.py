"""The SLAM back end: gather scans into nodes, match them, build submaps, align walls, close loops, optimise.

After Google's Cartographer (Hess et al., Real-Time Loop Closure in 2D LIDAR SLAM, ICRA 2016), on gtsam: matching runs
in a local frame, which is smooth and drifts; the poses of the graph are global and jump when loops close.
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

#: Maximum number of nodes whose loop searches wait at the end of a session.
_MAX_WAITING = 16
#: The sensor stands still if it has moved by less than this share of the distance between nodes.
_STILL_SHARE = 1 / 3
#: Number of scans that `Slam.trajectory` processes at a time.
_BLOCK = 4096
#: Standard deviation of the unobserved position in a heading constraint from walls, m.
_UNOBSERVED = 100.0
#: Number of submaps that an endless session removes at a time, as the graph is then solved from scratch.
_TRIM_BATCH = 8


class Slam:
    """Simultaneous localisation and mapping from scans and odometry.

        slam = Slam(SlamConfig.preset("radar"))
        slam.add_odometry(time, pose); slam.add_scan(time, azimuths, ranges); ...
        slam.finish()
        times, poses = slam.trajectory()
        grid = slam.map()

    The same input gives the same bytes: loops are searched in threads, but each result is used a fixed number of nodes
    after its search began (`radarize.slam.loops`).

    Odometry and scans come in any interleaving: a scan waits until odometry has reached its time. Entries that are not
    later than the previous one are dropped and counted in `skipped`. Scans before the first odometry entry get its
    pose, scans after the last one the last pose. A gap in time is a step like any other. Empty scans and scans of nan
    follow odometry. Without any scan, trajectory and map are empty. Without any odometry, the last matched motion is
    assumed to continue. While the sensor stands still no nodes are added, and a frame takes 40 bytes.

    Args:
        config: all parameters; the default is the preset ``lidar``.
        endless: keep no trajectory, and remove old submaps of places that newer ones cover: memory and time then grow
            with the mapped area, not with the duration.
    """

    def __init__(self, config: SlamConfig | None = None, endless: bool = False):
        self.config, self.endless = config or SlamConfig(), endless
        self.odometry = Odometry(self.config.odometry, endless)
        self.graph = PoseGraph(self.config.loop.inlier_probability, self.config.matcher.correlated)
        self.nodes: list[Node] = []
        self.submaps: list[Submap] = []
        self.skipped = {"odometry": 0, "scans": 0}
        self._waiting: deque[tuple[float, np.ndarray, np.ndarray]] = deque()
        self._scan_times = Rows()
        self._newest = -np.inf  # time of the last scan
        self._azimuths = np.zeros(0)  # azimuths of the last scan
        self._open: list[Scan] = []
        self._local: list[np.ndarray] = []  # pose of every node in the local frame
        self._drift = Drift(self.config.odometry.scale)
        self._search = LoopSearch(self.config.loop)
        self._verifier = LoopVerifier(self.graph, self._drift, self.config.loop)
        self._walls = Walls(self.config.walls)
        self._building: list[Submap] = []
        self._centers: list[np.ndarray] = []  # centres of finished submaps, in the frames of their anchors

    def add_odometry(
        self,
        time: float,
        pose: Float[np.ndarray, "3"],
        errors: ErrorModel | Float[np.ndarray, "3 3"] | None = None,
    ) -> None:
        """Add a pose of odometry.

        Args:
            time: s.
            pose: x, y (m), yaw (rad) in any fixed frame.
            errors: error model of the step since the previous entry, or its covariance if steps are independent, for
                (x, y, yaw) in the frame of this pose (m^2, m rad, rad^2); None: as configured in `SlamConfig.odometry`.

        Raises:
            InputError: a value is not finite or not within `FARTHEST`, or the covariance is invalid.
        """
        if self.odometry.add(time, pose, errors):
            self._process_waiting()
        else:
            self.skipped["odometry"] += 1

    def add_scan(self, time: float, azimuths: Float[np.ndarray, "beam"], ranges: Float[np.ndarray, "_"]) -> None:
        """Add a scan.

        Args:
            time: s.
            azimuths: of the beams, rad, positive to the left.
            ranges: one for each beam, m; inf: no echo on this beam; nan: unknown.

        Raises:
            InputError: the time is not finite, an azimuth is not within `FARTHEST`, or the lengths differ.
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
            azimuths = self._azimuths  # one array, shared by all nodes
        self._azimuths = azimuths
        self._newest = float(time)
        if not self.endless:
            self._scan_times.append(self._newest)
        self._waiting.append((float(time), azimuths, ranges))
        self._process_waiting()

    def finish(self) -> None:
        """Process the remaining scans, search all loops again from the optimised poses, and optimise."""
        if not len(self.odometry):
            self.odometry = ConstantMotion(self.config.odometry)
        self._process_waiting(final=True)
        if self._open:
            self._add_node()
        for submap in self._building:
            if 2 * len(submap.nodes) >= self.config.grid.nodes:
                self._align(submap)
        if self.config.loop.enabled:
            self._collect_closures()
            self.graph.optimise()
            self._search_loops_again()
        self.graph.optimise()

    def trajectory(self) -> tuple[Float[np.ndarray, "scan"], Float[np.ndarray, "scan 3"]]:
        """Return times (s) and poses (x, y, yaw) of every scan up to the last node, in the frame in which odometry
        began; empty for an endless session.

        Between two nodes the trajectory follows odometry, corrected at its ends.
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
        """Return the covariance of every pose of `trajectory` for (x, y, yaw) in its own frame, given the first node:
        that of the node nearest in time."""
        times, _ = self.trajectory()
        if not len(times):
            return np.zeros((0, 3, 3))
        knots = np.array([node.time for node in self.nodes])
        after = np.clip(np.searchsorted(knots, times), min(1, len(knots) - 1), len(knots) - 1)
        before = np.maximum(after - 1, 0)
        return self.graph.covariances()[np.where(times - knots[before] <= knots[after] - times, before, after)]

    def warnings(self) -> list[str]:
        """Return one sentence if the covariances could not be computed, else none."""
        if self.graph.solved:
            return []
        return [
            "the covariances of the pose graph could not be computed: those of odometry alone are used instead, also "
            "for the search windows of loops"
        ]

    def map(self) -> OccupancyGrid:
        """Return the occupancy grid of all nodes, rendered at their optimised poses."""
        return MapRenderer(self.config.grid).render(self.nodes, self.graph.poses)

    # --- the algorithm, step by step ---------------------------------------------------------------------------------
    def _process_waiting(self, final: bool = False) -> None:
        while self._waiting and (final or self.odometry.covers(self._waiting[0][0])):
            time, azimuths, ranges = self._waiting.popleft()
            scan = Scan(time, self.odometry.pose(time), azimuths, ranges)
            if self._open and self._stands_still(scan):
                self.odometry.release(self.nodes[-1].time, self._open[-1].time)
                self._open = []  # the last node covers these scans
            elif self._open and self._moved(self._open[0], scan):
                self._add_node()
            self._open.append(scan)

    def _moved(self, first: Scan, scan: Scan) -> bool:
        return self._is_away(first.odometry, scan, 1.0) or scan.time - first.time >= self.config.node.duration

    def _stands_still(self, scan: Scan) -> bool:
        """Whether the sensor has not moved since the last node, for longer than the duration of a node."""
        if not self.nodes or scan.time - self._open[0].time < self.config.node.duration:
            return False
        pose = self.odometry.pose(self.nodes[-1].time)
        return not any(self._is_away(pose, each, _STILL_SHARE) for each in (*self._open, scan))

    def _is_away(self, pose: np.ndarray, scan: Scan, share: float) -> bool:
        """Whether a scan is farther from a pose than a share of the distance between nodes; always if there is no
        odometry."""
        x, y, yaw = between(pose, scan.odometry)
        c = self.config.node
        no_odometry = isinstance(self.odometry, ConstantMotion)
        return no_odometry or np.hypot(x, y) >= share * c.distance or abs(yaw) >= share * c.angle

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
            self._search_loops(len(self.nodes) - 1)

    def _match(self, node: Node, predicted: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        """Local pose of a new node: the prediction, corrected by a match with the older of the submaps being built."""
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
        """Insert a node into the two submaps being built; a new one starts when the older is half full."""
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
        """Add a heading constraint from the wall directions of a submap to the node in its middle."""
        if not self.config.walls.enabled:
            return
        middle, poses = submap.nodes[len(submap.nodes) // 2], self.graph.poses
        points = _points_in_frame_of(middle, self._local, {k: self.nodes[k].points for k in submap.nodes})
        if len(points) < self.config.node.min_points:
            return
        parallel = self._walls.associate(middle, points, poses[:, 2], lambda *k: self._drift.between(*k)[2, 2])
        if parallel is not None:
            other, turn = parallel
            x, y, _ = between(poses[other], poses[middle])
            spread = np.diag([_UNOBSERVED, _UNOBSERVED, np.sqrt(2) * self.config.walls.sigma]) ** 2
            self.graph.add_match(other, middle, np.array([x, y, turn]), spread)
            self.graph.update()

    def _trim(self) -> None:
        """Remove submaps of places that newer submaps cover, and the nodes that are in no other submap."""
        redundant = redundant_submaps(self.submaps, self.graph.poses)
        if len(redundant) < _TRIM_BATCH:
            return
        self._collect_closures()
        remaining = [k for k, submap in enumerate(self.submaps) if submap not in redundant]
        self._centers = [self._centers[k] for k in remaining if k < len(self._centers)]
        self.submaps = [self.submaps[k] for k in remaining]
        kept = sorted({number for submap in self.submaps for number in submap.nodes})
        self.graph.keep(kept, self._drift.between)
        self._drift.keep(kept)
        self._verifier.forget()
        self.nodes, self._local = [self.nodes[k] for k in kept], [self._local[k] for k in kept]
        place = {number: k for k, number in enumerate(kept)}
        self._walls.keep(place)
        for submap in self.submaps:
            submap.anchor, submap.nodes = place[submap.anchor], [place[number] for number in submap.nodes]

    def _search_loops(self, number: int) -> None:
        """Start to search the submaps near a node, and process the results for earlier nodes."""
        c = self.config.loop
        if number % c.every == 0:
            self._search.submit(self._loop_candidates(number, c.candidates, c.min_score, self._drift.between))
        if self._collect_closures(number - c.lag) or number % c.update_every == 0:
            self.graph.update()

    def _search_loops_again(self) -> None:
        """Search loops again from the optimised poses, which show more overlaps of nodes and submaps.

        The search window follows the marginal covariances of the graph: it is small where loops are closed, and large
        where one was missed.
        """
        c, done = self.config.loop, set(self.graph.closures)
        near = np.diag([8 * self.config.grid.resolution / 3] * 2 + [0.03]) ** 2
        marginals = self.graph.covariances()

        def spread(anchor: int, number: int) -> np.ndarray:
            motion = between(self.graph.poses[anchor], self.graph.poses[number])
            return near + marginals[number] + carried(marginals[anchor], motion)

        numbers = range(len(self.nodes))
        for number in sorted({*numbers[:: max(c.nodes // 2, 1)], *numbers[-1:]}):  # the last node may close a loop
            candidates = self._loop_candidates(number, 2 * c.candidates, c.final_score, spread)
            self._search.submit([each for each in candidates if (each.submap.anchor, number) not in done])
            self._collect_closures(number - _MAX_WAITING)  # bounds the memory of waiting searches
        self._collect_closures()

    def _collect_closures(self, before: int | None = None) -> bool:
        """Verify the closures found for nodes up to `before`, or for all; True if the graph should be updated now."""
        return any([self._verifier.check(closure) for closure in self._search.results(before)])

    def _loop_candidates(
        self, number: int, count: int, min_score: float, spread: Callable[[int, int], np.ndarray]
    ) -> list[LoopCandidate]:
        """Loop candidates of the latest nodes up to a node: finished submaps near it, nearest first."""
        spacing = self.config.matcher.spacing
        first = max(number - self.config.loop.nodes + 1, 0)
        poses, ready = self.graph.poses, len(self._centers)
        if len(self.nodes[number].points) < self.config.node.min_points or not ready:
            return []
        last = np.array([submap.nodes[-1] for submap in self.submaps[:ready]])
        anchors = np.array([submap.anchor for submap in self.submaps[:ready]])
        members = range(first, number + 1)
        points, fronts = (
            thin(_points_in_frame_of(number, poses, part), spacing)
            for part in ({k: self.nodes[k].points for k in members}, {k: self.nodes[k].fronts for k in members})
        )
        centers = compose(poses[anchors], np.pad(np.array(self._centers), ((0, 0), (0, 1))))[:, :2]
        distances = np.hypot(*(centers - transform(poses[number], points.mean(axis=0))).T)
        near = np.flatnonzero((distances <= self.config.loop.radius) & ((last < first) | (anchors > number)))
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
            for k in near[np.argsort(distances[near], kind="stable")][:count]
        ]


def _points_in_frame_of(
    number: int, poses: Sequence[Pose] | Float[np.ndarray, "node 3"], points: Mapping[int, Float[np.ndarray, "_ 2"]]
) -> Float[np.ndarray, "point 2"]:
    """Points of several nodes in the frame of one node."""
    return np.concatenate([transform(between(poses[number], poses[k]), each) for k, each in points.items()])
