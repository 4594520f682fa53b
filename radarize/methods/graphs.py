"""Makes the graphs that `radarize.nets.compiled` runs: ``python -m radarize.methods.graphs``."""

from radarize.methods.method import Weights
from radarize.methods.registry import find_task
from radarize.nets.compiled import GRAPHS, graph_of
from radarize.nets.export import export_graph
from radarize.nets.weights import load

#: Networks of the methods of choice.
KINDS = ("translation", "rotation", "segmentation")


def main() -> None:
    """Replace all graphs."""
    GRAPHS.mkdir(exist_ok=True)
    for former in GRAPHS.glob("*.onnx"):
        former.unlink()
    for kind in KINDS:
        print(export_graph(*(found := load(Weights().of(kind), find_task(kind).network)), graph_of(found[1])))


if __name__ == "__main__":
    main()
