"""Networks as ONNX, for run times other than torch."""

import logging
import warnings
from pathlib import Path

import torch
from torch import nn

from radarize.nets.weights import Header, example
from radarize.replacing import replacing


class Estimate(nn.Module):
    """A network whose `forward` is its `estimate`."""

    def __init__(self, net: nn.Module):
        super().__init__()
        self.net = net

    def forward(self, *inputs: torch.Tensor):
        return self.net.estimate(*inputs)


def export_onnx(net: nn.Module, header: Header, path: Path) -> Path:
    """Write a network's `estimate` as one ONNX file: input ``maps`` (item, frame, map, row, azimuth) in dB, any number
    of items, and for turns ``travel`` (item, 2), or what else the network names; outputs ``estimate`` and
    ``covariance``, or ``probability``.

    Raises:
        InputError: the file cannot be written.
    """
    # torch's exporter lists what it would do with torchvision.
    logging.getLogger("torch.onnx._internal.exporter._registration").setLevel(logging.ERROR)
    inputs, item = example(net, header), torch.export.Dim("item")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            Estimate(net).eval().cpu(), inputs, input_names=list(net.inputs), output_names=list(net.outputs),
            dynamic_shapes=(tuple({0: item} for _ in inputs),), dynamo=True, verbose=False,
        )  # fmt: skip
    program.model.metadata_props["radarize"] = header.model_dump_json()
    with replacing(path) as part:
        program.save(part, external_data=False)
    return path
