"""Write the ONNX graphs that `radarize.learning.nets.compiled` runs: ``python -m radarize.pipeline.graphs``."""

from radarize.learning.nets.compiled import GRAPHS, graph_of
from radarize.learning.nets.export import export_graph
from radarize.learning.nets.weights import load
from radarize.learning.task import find_task
from radarize.pipeline.method import Weights
from radarize.pipeline.methods import BEST, ODOMETRY, SCANS

#: Networks of the default methods.
KINDS = (*ODOMETRY[BEST["odometry"]].networks, *SCANS[BEST["scans"]].networks)


def main() -> None:
    """Replace all graphs."""
    GRAPHS.mkdir(exist_ok=True)
    for former in GRAPHS.glob("*.onnx"):
        former.unlink()
    for kind in KINDS:
        net, header = load(Weights().of(kind), find_task(kind).network)
        print(export_graph(net, header, graph_of(header)))


if __name__ == "__main__":
    main()
