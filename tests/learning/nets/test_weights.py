"""Files of weights: reading back, refused files, and ONNX."""

import json
import re
import subprocess
import sys

import numpy as np
import onnxruntime
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from radarize.io.errors import InputError
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.export import export_onnx
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.learning.nets.segmentation import SegmentationNet
from radarize.learning.nets.weights import Header, build, example, load, save
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"]
NETS = {net.kind: net for net in (TranslationNet, RotationNet, SegmentationNet)}
MAPS = {"translation": ("doppler_azimuth", "doppler_elevation_aware"), "rotation": ("range_azimuth",)}


def network(kind: str, width: int = 4):
    """A network with weights and statistics that affect its output."""
    maps = MAPS.get(kind, ("range_azimuth", "elevation_aware"))
    header = Header(
        kind=kind, frames=2, maps=maps, width=width, grid=MapGrid.of(CONFIG, maps[0]), data="small", seed=3,
        metrics={"loss": 0.5},
    )  # fmt: skip
    torch.manual_seed(0)
    net = build(NETS[kind], header)
    net(*example(net, header))  # moves the batch normalisation's statistics
    return net.eval(), header


@pytest.mark.parametrize("kind", NETS)
def test_round_trip(kind, tmp_path):
    net, header = network(kind)
    path = save(net, header, tmp_path / "net.safetensors")
    again, read = load(path, NETS[kind], CONFIG)
    assert read == header and not again.training
    for a, b in zip(net.estimate(*example(net, header)), again.estimate(*example(again, header)), strict=True):
        assert torch.allclose(a, b, rtol=0.05, atol=0.02)
    with safe_open(path, "pt") as file:
        assert json.loads(file.metadata()["radarize"])["kind"] == kind
        assert {str(file.get_tensor(name).dtype) for name in file.keys()} <= {"torch.float16", "torch.int64"}  # noqa: SIM118
    (tmp_path / "other").touch()
    assert path.stat().st_mode == (tmp_path / "other").stat().st_mode  # as readable as any file
    assert not list(tmp_path.glob("*.part"))


def test_what_does_not_fit_is_refused(tmp_path):
    net, header = network("translation")
    path = save(net, header, tmp_path / "net.safetensors")
    for change, lack in (
        ({"loops": 12}, "bins of 0.306 m/s, expected at most 0.229 m/s"),
        ({"idle_time": 500e-6, "loops": 18}, "a reach of 1.15 m/s, expected at least 1.83 m/s"),
        ({"frame_period": 1e-3, "loops": 1}, "a frame period of 0.001 s, expected at least 0.00104 s"),
        ({"frame_period": 0.1}, "a frame period of 0.1 s, expected at most 0.0533 s"),
        ({"rx": (0,), "tx_order": (0, 2)}, "2 antennas in a row, expected at least 4"),
    ):
        with pytest.raises(InputError, match=f"net.safetensors: does not fit this radar, which has {lack}"):
            load(path, TranslationNet, CONFIG.model_copy(update=change))
    with pytest.raises(InputError, match="missing.safetensors: no such file"):
        load(tmp_path / "missing.safetensors", TranslationNet)
    (tmp_path / "text.safetensors").write_text("no weights at all")
    with pytest.raises(InputError, match="text.safetensors: is not a file of weights"):
        load(tmp_path / "text.safetensors", TranslationNet)
    save_file({"a": torch.zeros(2)}, tmp_path / "other.safetensors")
    with pytest.raises(InputError, match="has no header of radarize"):
        load(tmp_path / "other.safetensors", TranslationNet)
    save(net, header.model_copy(update={"width": 8}), path)
    with pytest.raises(InputError, match="its weights do not fit its header"):
        load(path, TranslationNet)
    for change, what in (
        ({"kind": "flight"}, "'flight' (corrected)"),
        ({"setting": "published"}, "'translation' (pub"),
    ):
        save(net, header.model_copy(update=change), path)
        with pytest.raises(InputError, match=re.escape(f"is a network for {what}")) as refused:
            load(path, TranslationNet)
        assert "expected one for 'translation' (corrected)" in str(refused.value)
    with torch.no_grad():
        net.resnet.head.bias[0] = 1e6
    with pytest.raises(InputError, match="resnet.head.bias has values outside the range of float16"):
        save(net, header, path)


@pytest.mark.parametrize("kind", NETS)
def test_onnx_says_the_same(kind, tmp_path):
    """Compared with another runtime, for any number of items."""
    pytest.importorskip("onnxscript", reason="the extra onnx is not installed")
    net, header = network(kind)
    path = export_onnx(net, header, tmp_path / "net.onnx")
    session = onnxruntime.InferenceSession(path)
    assert Header.model_validate_json(session.get_modelmeta().custom_metadata_map["radarize"]) == header
    two = example(net, header)
    for inputs in (two, [torch.cat([each, each[:1]]) for each in two]):
        expected = net.estimate(*inputs)
        expected = expected if isinstance(expected, tuple) else (expected,)
        named = dict(zip(("maps", "travel"), (each.numpy() for each in inputs), strict=False))
        for found, values in zip(session.run(None, named), expected, strict=True):
            assert np.allclose(found, values.detach(), atol=1e-4)


def test_loading_imports_no_compiler():
    """Loading networks does not import torch's compiler, which takes seconds."""
    script = """
import sys
from radarize.pipeline.method import Weights
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.learning.nets.weights import load
for network in (TranslationNet, RotationNet):
    load(Weights().of(network.kind), network)
print("torch" in sys.modules, "torch._dynamo" in sys.modules)
"""
    output = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert output.split() == ["True", "False"]
