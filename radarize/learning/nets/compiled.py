"""Networks as graphs for onnxruntime, with normalisation folded into convolutions.

The graphs, without weights, are part of the package for the networks that run live (`radarize.pipeline.graphs` writes
them). No graph is ever read from a file of weights or beside it. Networks of other shapes run in torch.
"""

import json
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import onnxruntime
import torch
from torch import Tensor

from radarize.learning.nets.folded import folded
from radarize.learning.nets.weights import Header, Network, load
from radarize.radar.config import RadarConfig

GRAPHS = Path(__file__).parent / "graphs"
#: Fields of a header that determine the graph.
_SHAPE = ("kind", "setting", "frames", "maps", "width", "grid")
#: Log level of onnxruntime: errors only.
_ERRORS = 3


class Compiled:
    """A trained network for inference.

    Args:
        net: the network, whose weights no longer change.
        header: header of its file.

    Attributes:
        net: the network with folded normalisation; header: its header.
    """

    def __init__(self, net: Network, header: Header):
        self.net, self.header = folded(net), header

    def estimate(self, *inputs: Tensor) -> Tensor | tuple[Tensor, ...]:
        """Return the result of the network's own `estimate`."""
        if self._session is None:
            return self.net.estimate(*inputs)
        fed = {name: values.contiguous().numpy() for name, values in zip(self.net.inputs, inputs, strict=True)}
        found = tuple(torch.from_numpy(values) for values in self._session.run(None, fed))
        return found if len(found) > 1 else found[0]

    @cached_property
    def _session(self) -> onnxruntime.InferenceSession | None:
        """Session of the graph; None without a graph. Created on first use, with torch's number of threads at that
        time."""
        if not (file := graph_of(self.header)).is_file():
            return None
        options = onnxruntime.SessionOptions()
        options.log_severity_level = _ERRORS
        options.intra_op_num_threads = torch.get_num_threads()
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # others need the processor
        weights = {f"net.{name}": values.numpy() for name, values in self.net.state_dict().items()}
        values = [onnxruntime.OrtValue.ortvalue_from_numpy(each) for each in weights.values()]
        options.add_external_initializers(list(weights), values)
        return onnxruntime.InferenceSession(file.read_bytes(), options, providers=["CPUExecutionProvider"])


def compiled(path: Path, network: type[Network], config: RadarConfig | None = None) -> tuple[Compiled, Header]:
    """Load a network as `radarize.learning.nets.weights.load`, in the fastest form for this machine.

    Raises:
        InputError: see `load`.
    """
    net, header = load(path, network, config)
    return Compiled(net, header), header


def graph_of(header: Header) -> Path:
    """Return the path of a network's graph, whether it exists or not."""
    shape = json.dumps(header.model_dump(mode="json", include=set(_SHAPE)), sort_keys=True)
    return GRAPHS / f"{header.kind}-{sha256(shape.encode()).hexdigest()[:8]}.onnx"
