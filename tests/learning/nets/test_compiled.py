"""Graphs of the package: their output equals that of the networks, with any weights."""

import numpy as np
import pytest
import torch
from torch import nn

from radarize.learning.nets.compiled import Compiled, compiled, graph_of
from radarize.learning.nets.weights import Header, build, example, header_of, load
from radarize.learning.task import find_task
from radarize.pipeline.graphs import KINDS
from radarize.pipeline.method import Weights


def altered(kind: str) -> tuple[nn.Module, Header]:
    """The shipped network with random weights and statistics."""
    net, header = load(Weights().of(kind), find_task(kind).network)
    torch.manual_seed(1)
    for values in net.state_dict().values():
        if values.is_floating_point():
            values *= 1 + 0.3 * torch.rand(values.shape)
    return net, header


def estimates(one, inputs: list[torch.Tensor]) -> list[np.ndarray]:
    with torch.inference_mode():
        found = one.estimate(*inputs)
    return [each.numpy() for each in (found if isinstance(found, tuple) else (found,))]


@pytest.mark.parametrize("kind", KINDS)
def test_a_graph_says_what_the_network_says(kind):
    net, header = altered(kind)
    asked = Compiled(net, header)
    assert graph_of(header).is_file()
    assert b"BatchNormalization" not in graph_of(header).read_bytes()  # a third of the time
    two = example(net, header)
    for inputs in (two, [each[:1] for each in two], [torch.cat([each, each[:1]]) for each in two]):
        for found, wanted in zip(estimates(asked, inputs), estimates(net, inputs), strict=True):
            assert found.shape == wanted.shape
            assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()
    assert asked._session is not None  # torch was not asked


def test_a_network_of_another_shape_is_asked_in_torch():
    header = header_of(Weights().of("segmentation")).model_copy(update={"width": 4})
    net = build(find_task("segmentation").network, header).eval()
    asked = Compiled(net, header)
    assert not graph_of(header).is_file()
    inputs = example(net, header)
    found = estimates(asked, inputs)[0]
    assert np.array_equal(found, estimates(asked.net, inputs)[0])
    assert np.allclose(found, estimates(net, inputs)[0], atol=1e-5)


def test_the_shipped_weights_are_lent():
    network = find_task("translation").network
    asked, header = compiled(Weights().of("translation"), network)
    inputs = example(asked.net, header)
    for found, wanted in zip(estimates(asked, inputs), estimates(asked.net, inputs), strict=True):
        assert np.allclose(found, wanted, atol=1e-5)
