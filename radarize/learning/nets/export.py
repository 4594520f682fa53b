"""Export of networks as ONNX, for other runtimes than torch."""

import logging
import warnings
from pathlib import Path

import torch
from torch import nn

from radarize.io.replacing import replacing
from radarize.learning.nets.folded import folded
from radarize.learning.nets.weights import Header, Network, example


class Estimate(nn.Module):
    """A network whose `forward` is its `estimate`."""

    def __init__(self, net: Network):
        super().__init__()
        self.net = net

    def forward(self, *inputs: torch.Tensor) -> torch.Tensor | tuple[torch.Tensor, ...]:
        return self.net.estimate(*inputs)


def export_onnx(net: Network, header: Header, path: Path) -> Path:
    """Write a network's `estimate` as an ONNX file: input ``maps`` (item, frame, map, row, azimuth) in dB, any number
    of items, and for rotation ``travel`` (item, 2), or other inputs of the network; outputs ``estimate`` and
    ``covariance``, or ``probability``.

    Raises:
        InputError: the file cannot be written.
    """
    program = _program(folded(net), header)
    program.model.metadata_props["radarize"] = header.model_dump_json()
    with replacing(path) as part:
        program.save(part, external_data=False)
    return path


def export_graph(net: Network, header: Header, path: Path) -> Path:
    """Write the graph without weights, for `compiled`, which supplies those of a file."""
    import onnx  # not installed with every radarize

    net = folded(net)
    model = _program(net, header, optimize=False).model_proto  # optimisation would fold weights into constants
    missing = {f"net.{name}" for name in net.state_dict()}
    for values in model.graph.initializer:
        if values.name in missing:
            values.ClearField("raw_data")
            values.data_location = onnx.TensorProto.EXTERNAL
            values.external_data.add(key="location", value="weights")  # no file of that name is read
    for node in model.graph.node:  # paths and names of torch's source
        node.ClearField("metadata_props")
        node.ClearField("doc_string")
    model.graph.ClearField("value_info")
    with replacing(path) as part:
        part.write_bytes(model.SerializeToString(deterministic=True))
    return path


def _program(net: Network, header: Header, optimize: bool = True) -> torch.onnx.ONNXProgram:
    # torch's exporter warns that torchvision is missing.
    logging.getLogger("torch.onnx._internal.exporter._registration").setLevel(logging.ERROR)
    inputs, item = example(net, header), torch.export.Dim("item")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            Estimate(net).cpu(), inputs, input_names=list(net.inputs), output_names=list(net.outputs),
            dynamic_shapes=(tuple({0: item} for _ in inputs),), dynamo=True, verbose=False,
            optimize=optimize,
        )  # fmt: skip
    assert program is not None  # as of dynamo=True
    return program
