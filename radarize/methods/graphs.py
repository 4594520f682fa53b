"""Makes the graphs that `radarize.nets.compiled` runs: ``python -m radarize.methods.graphs``."""

from radarize.methods.method import Weights
from radarize.methods.registry import BEST, ODOMETRY, SCANS, find_task
from radarize.nets.compiled import GRAPHS, graph_of
from radarize.nets.export import export_graph
from radarize.nets.weights import load

#: Networks of the methods of choice.
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
