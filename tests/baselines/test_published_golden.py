"""`published` against numbers that the artefact's own, unmodified code (commit cbcb643) made of the same samples.

`published_golden.json` holds cells of its maps (every 13th row, every 17th column) of the last of `frames`, its
occupancy label of `depth_picture`, a digest of the names and shapes of its networks' tensors, and what these networks
answer with the weights of `filled` to `shown`.
"""

import base64
import json
import zlib
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import torch

from radarize.baselines.published.artefact import artefact_name, export_artefact, import_artefact, read_artefact
from radarize.baselines.published.labels import occupied
from radarize.baselines.published.maps import PublishedMaps
from radarize.io.errors import InputError
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.weights import Header, load, save
from radarize.learning.task import find_task
from radarize.radar.presets import PRESETS

pytestmark = pytest.mark.usefixtures("one_thread")

GOLDEN = json.loads(Path(__file__).with_name("published_golden.json").read_text())
FACTORS = np.exp(0.1j * np.arange(12)) * (1 + 0.02 * np.arange(12))
CONFIG = PRESETS["radarize"].model_copy(
    update={"channel_calibration": tuple((float(z.real), float(z.imag)) for z in FACTORS)}
)
PARAMETERS = {"translation": 11_174_402, "rotation": 11_211_077, "segmentation": 31_039_426}


def frames():
    """Six frames of three moving targets and of noise, int16 (frame, loop, tx, rx, sample, iq)."""
    sample, loop, slot = np.arange(96), np.arange(32), np.arange(3)
    time = np.arange(6)[:, None, None] * 33.333e-3 + 172e-6 * (3 * loop[:, None] + slot)
    place = np.array([[0, 1, 2, 3], [4, 5, 6, 7], [2, 3, 4, 5]])  # of TX1, TX3, TX2, half wavelengths
    height = np.array([0, 0, 1.0])
    signal = np.zeros((6, 32, 3, 4, 96), complex)
    for bin_, speed, azimuth, elevation, amplitude in (
        (20.3, 0.7, 0.3, 0.1, 300.0), (41.8, -0.45, -0.5, 0.0, 200.0), (63.1, 0.2, 0.05, -0.2, 120.0),
    ):  # fmt: skip
        phase = 2 * np.pi * bin_ * sample / 96 - 4 * np.pi / 3.8464e-3 * speed * time[..., None, None]
        across = np.cos(elevation) * np.sin(azimuth) * -place + np.sin(elevation) * height[:, None]
        signal += amplitude * np.exp(1j * (phase + np.pi * across[..., None]))
    noise = np.random.RandomState(0).randint(-60, 61, (*signal.shape, 2))
    fired = np.rint(np.stack([signal.real, signal.imag], axis=-1) + noise)
    adc = np.empty(fired.shape, np.int16)
    adc[:, :, [0, 2, 1]] = fired
    return adc


def depth_picture():
    """Waves, steps and holes, mm."""
    u, v = np.arange(848)[None], np.arange(100)[:, None]
    depth = 2500 + 1200 * np.sin(0.02 * u) + 3 * v + 900 * (u > 600)
    depth = np.where((u > 300) & (u < 340), 700 + 2 * u, depth)
    depth = np.where((u // 50) % 7 == 3, 0, depth)
    return np.rint(np.where(u < 60, 60 + u, depth)).astype(np.uint16)


def shown(shape):
    count = torch.arange(np.prod(shape), dtype=torch.float64)
    return (0.5 + 0.5 * torch.sin(0.01 * count * (1 + 0.001 * count / len(count)))).reshape(shape).float()


def filled(tensors):
    """Values of any tensors, by their place and name."""
    made = {}
    for k, (name, values) in enumerate(tensors.items()):
        made[name] = values
        if values.is_floating_point():
            count = torch.arange(values.numel(), dtype=torch.float64)
            new = torch.sin(0.37 * count + k) / max(1, values.numel() / values.shape[0]) ** 0.5
            if name.endswith("running_var"):
                new = 1 + 0.5 * torch.sin(count + k)
            elif values.ndim == 1:
                new = 0.3 * torch.sin(count + k) + name.endswith("weight")
            made[name] = new.reshape(values.shape).float()
    return made


def test_maps_are_the_artefacts():
    made = PublishedMaps(CONFIG)(frames(), frames=np.array([5]))
    assert set(made) == set(GOLDEN["maps"])
    for name, cells in GOLDEN["maps"].items():
        assert np.ptp(cells) > 0.1  # not constant
        assert made[name][0][::13, ::17] == pytest.approx(np.array(cells), abs=1e-4), name


def test_occupancy_is_the_artefacts():
    bits = np.unpackbits(np.frombuffer(zlib.decompress(base64.b85decode(GOLDEN["occupancy"])), np.uint8))
    pinhole = np.array([423.993011474609, 423.993011474609, 432.966033935547, 50.9377288818359])
    found = occupied(depth_picture()[None], pinhole)[0]
    assert np.array_equal(found, bits.reshape(96, 88)) and found.sum() > 400


@pytest.mark.parametrize("kind", PARAMETERS)
def test_weights_are_exchanged_with_the_artefact(kind, tmp_path):
    """Its names and shapes; what its network answers, ours does with its weights; and they come back as they were."""
    task = find_task(f"published-{kind}")
    header = Header(
        kind=kind, setting="published", frames=2 if kind == "rotation" else 1, maps=task.maps, width=64,
        grid=MapGrid.of(CONFIG, task.maps[0], PublishedMaps),
    )  # fmt: skip
    net = task.network(header.frames, header.maps, 64)
    assert sum(values.numel() for values in net.parameters()) == PARAMETERS[kind]
    theirs = {other: values for name, values in net.state_dict().items() if (other := artefact_name(kind, name))}
    text = "\n".join(f"{name} {tuple(values.shape)}" for name, values in theirs.items())
    assert sha256(text.encode()).hexdigest() == GOLDEN["tensors"][kind]
    theirs = filled(theirs)
    torch.save({"model_state_dict": theirs}, tmp_path / "theirs.pth")
    net, read = read_artefact(tmp_path / "theirs.pth", kind, CONFIG)
    assert read.grid == header.grid and read.frames == header.frames

    grid, expected = header.grid, GOLDEN["answers"][kind]
    maps = shown((header.frames * len(header.maps), grid.rows, grid.azimuths))[None]
    windows = maps.reshape(1, header.frames, len(header.maps), grid.rows, grid.azimuths)
    if kind == "rotation":  # the artefact's second frame comes in reverse order
        windows = torch.stack([maps[:, :3], maps[:, 3:].flip(1)], dim=1)
    with torch.no_grad():
        found = net.estimate(windows)[:, ::24, ::22] if kind == "segmentation" else net(windows)
    assert found.flatten().tolist() == pytest.approx(expected, abs=2e-5)

    ours = import_artefact(tmp_path / "theirs.pth", kind, CONFIG, tmp_path / "ours.safetensors")
    assert load(ours, task.network, CONFIG)[1].kind == kind
    back = torch.load(export_artefact(ours, tmp_path / "back.pth"), weights_only=True)
    assert back["model_type"] == {"rotation": "ECAResNet18", "segmentation": "UNet", "translation": "ResNet18"}[kind]
    assert back["model_state_dict"].keys() == theirs.keys()
    for name, values in theirs.items():
        assert torch.equal(back["model_state_dict"][name], values.half().to(values.dtype)), name  # files are float16


def test_other_weights_are_refused(tmp_path):
    with pytest.raises(InputError, match="none.pth: no such file"):
        read_artefact(tmp_path / "none.pth", "rotation", CONFIG)
    torch.save({"model_state_dict": {"conv1.weight": torch.zeros(1)}}, tmp_path / "other.pth")
    with pytest.raises(InputError, match="has not the weights of the artefact's network for rotation"):
        read_artefact(tmp_path / "other.pth", "rotation", CONFIG)
    task = find_task("published-rotation")
    header = Header(
        kind="rotation", setting="published", frames=2, maps=task.maps, width=2,
        grid=MapGrid.of(CONFIG, task.maps[0], PublishedMaps),
    )  # fmt: skip
    path = tmp_path / "small.safetensors"
    save(task.network(2, task.maps, 2), header, path)
    with pytest.raises(InputError, match="of width 2, expected a published one of width 64"):
        export_artefact(path, tmp_path / "small.pth")
