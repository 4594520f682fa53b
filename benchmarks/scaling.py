"""How making a data set scales: one process, one per core, and Ray with two nodes of one core each, one of which dies.

The nodes are real Ray workers on this machine, each with a raylet of its own. What all ways make is compared byte by
byte.
"""

import argparse
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from benchmarks.results import Data, Page, script, surroundings, timed
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification

if TYPE_CHECKING:
    from ray.cluster_utils import Cluster

#: Walks of one length, so that workers end together.
BUILDINGS = {kind: {"kind": kind, "seed": 8100} for kind in "ABCD"}
NODES = 2


@contextmanager
def cluster() -> Iterator["Cluster"]:
    """Ray with a head without cores, and two nodes of one core each."""
    os.environ |= {
        "RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0", "PYTHONPATH": os.pathsep.join(sys.path)
    }  # fmt: skip
    import ray
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    for _ in range(NODES):
        nodes.add_node(num_cpus=1)
    try:
        yield nodes
    finally:
        ray.shutdown()
        nodes.shutdown()


def dying(nodes: "Cluster", at: float) -> Callable[[int, int], None]:
    """Progress at whose given share a node is lost, for which another one comes."""
    worker = [node for node in nodes.list_all_nodes() if node is not nodes.head_node][-1]
    lost: list[bool] = []

    def progress(done: int, total: int) -> None:
        if not lost and done >= at * total:
            lost.append(True)
            nodes.remove_node(worker, allow_graceful=False)
            nodes.add_node(num_cpus=1)

    return progress


def digests(folder: Path) -> dict[str, str]:
    """Of each recording."""
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("*.h5"))}


@script(
    "Data sets over processes and machines",
    seconds=(20.0, "of each of eight walks"),
    seed=(8100, "of the walks"),
)
def main(options: argparse.Namespace) -> Page:
    walks = [{"building": kind, "floors": [0], "platform": ["handheld", "cart"], "count": 1,
              "duration": options.seconds} for kind in BUILDINGS]  # fmt: skip
    about = {"name": "scaling", "seed": options.seed, "buildings": BUILDINGS, "recordings": walks}
    cores, rows, found = len(os.sched_getaffinity(0)), [], {}
    with tempfile.TemporaryDirectory() as name, cluster() as nodes:
        path = Path(name) / "scaling.yaml"
        path.write_text(yaml.safe_dump(about))
        specification = Specification.load(path)
        frames = sum(task.frames for task in specification.tasks)
        ways: dict[str, dict[str, object]] = {
            "one process": {"workers": 1},
            f"{cores} processes": {"workers": cores},
            f"Ray, {NODES} nodes": {"ray": nodes.address},
            f"Ray, {NODES} nodes, one lost half-way": {"ray": nodes.address, "progress": dying(nodes, 0.5)},
        }
        for way, how in ways.items():
            folder = Path(name) / way
            _, took = timed(lambda folder=folder, how=how: make(specification, folder, log=lambda line: None, **how))
            found[way] = digests(folder)
            workers = 1 if way == "one process" else cores if way.endswith("processes") else NODES
            first = rows[0]["s"] if rows else took
            rows.append(
                {"way": way, "workers": workers, "s": took, "frames/s": frames / took, "times as fast": first / took,
                 "efficiency %": 100 * first / took / workers, "same bytes": found[way] == found["one process"]}
            )  # fmt: skip
        data = Data.of("walks of seed 8100 through buildings A to D", sorted((Path(name) / "one process").glob("*.h5")))
    return Page(
        rows,
        data=data,
        notes=[
            f"{len(found['one process'])} recordings, {frames} frames. Efficiency: times as fast as one process, over "
            "workers; start of processes included. One process has all cores for its threads, several share them.",
            "Where a node is lost, its recording is begun again on another one, from the last frame that was written.",
            surroundings(),
        ],
    )
