"""Graphs that come with the package: that they say what the networks say, whatever the weights."""

import numpy as np
import pytest
import torch

from radarize.methods.graphs import KINDS
from radarize.methods.method import Weights
from radarize.methods.registry import find_task
from radarize.nets.compiled import Compiled, compiled, graph_of, lent
from radarize.nets.weights import build, example, header_of, load


def altered(kind: str) -> Compiled:
    """The shipped network with weights and statistics that it never had."""
    net, header = load(Weights().of(kind), find_task(kind).network)
    torch.manual_seed(1)
    for values in lent(net).values():
        values *= 1 + 0.3 * torch.rand(values.shape)
    return Compiled(net, header)


def estimates(one, inputs: list[torch.Tensor]) -> list[np.ndarray]:
    with torch.inference_mode():
        found = one.estimate(*inputs)
    return [each.numpy() for each in (found if isinstance(found, tuple) else (found,))]


@pytest.mark.parametrize("kind", KINDS)
def test_a_graph_says_what_the_network_says(kind):
    asked = altered(kind)
    assert graph_of(asked.header).is_file()
    two = example(asked.net, asked.header)
    for inputs in (two, [each[:1] for each in two], [torch.cat([each, each[:1]]) for each in two]):
        for found, wanted in zip(estimates(asked, inputs), estimates(asked.net, inputs), strict=True):
            assert found.shape == wanted.shape
            assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()
    assert asked._session is not None  # torch was not asked


def test_a_network_of_another_shape_is_asked_in_torch():
    header = header_of(Weights().of("segmentation")).model_copy(update={"width": 4})
    asked = Compiled(build(find_task("segmentation").network, header).eval(), header)
    assert not graph_of(asked.header).is_file()
    inputs = example(asked.net, asked.header)
    assert np.array_equal(estimates(asked, inputs)[0], estimates(asked.net, inputs)[0])


def test_the_shipped_weights_are_lent():
    network = find_task("translation").network
    asked, header = compiled(Weights().of("translation"), network)
    inputs = example(asked.net, header)
    for found, wanted in zip(estimates(asked, inputs), estimates(asked.net, inputs), strict=True):
        assert np.allclose(found, wanted, atol=1e-5)
